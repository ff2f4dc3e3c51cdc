"""What a wrong clock, a wrong scale and a mistyped size look like is said beside the effects that stand for them."""

import numpy as np
import pytest
from bouncing_disk import RADIUS, RATE, bouncing

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk, Polygon
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.results.clock_and_size import ON_EARTH, could_be, said
from thesis_lib.critique.results.diagnosis import parameters
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.effects import EFFECTS
from thesis_lib.report.critique.effects import effects as told_in_report
from thesis_lib.statistics.wording import NBSP

CALLED = RATE * 240.0 / 235.0  # Hz, of a camera that takes `RATE`
LONGER = (240.0 / 235.0) ** 2  # lengths that make free fall look as that camera does
STANDARD_ERRORS = 4.0  # by chance once in 16,000
AS_MUCH = 1e-3  # relative: two fits of one motion in other units


def seen(cause: str) -> tuple[Dataset, dict, dict]:
    """Drops of a disk with one fault of the record, dg as it is fitted to them, and what else that could be."""
    dataset, _ = bouncing([0.6] * 12, 0.3, np.random.default_rng(5))
    table, header = dataset.trajectories, dataset.header
    if cause == "clock":
        table, header = table.assign(t=table["t"] * RATE / CALLED), header.model_copy(update={"rate": CALLED})
    else:
        table = table.assign(x=table["x"] * LONGER, y=table["y"] * LONGER)
        body = Body(shape=Disk(radius=RADIUS * LONGER), radius_of_gyration=header.body.radius_of_gyration * LONGER)
        header = header.model_copy(update={"body": body})
    dataset = Dataset(cause, header, table)
    fitted = fit(Model(LAWS["mirtich"], (EFFECTS["wrong_gravity"],)), observe(dataset))
    found = [{"name": "wrong_gravity", "parameters": parameters(fitted, "wrong_gravity.")}]
    return dataset, found[0]["parameters"]["dg"], could_be("wrong_gravity", found, header)


def test_a_camera_called_faster_than_it_is_and_long_lengths_look_alike():
    (_, dg, clock), (_, same, scale) = seen("clock"), seen("scale")
    error = 0.5 * dg["std"] / 9.81  # relative, of the rate
    assert dg["value"] == pytest.approx(9.81 * (LONGER - 1.0), abs=STANDARD_ERRORS * dg["std"])
    assert clock["rate"] == pytest.approx(RATE, rel=STANDARD_ERRORS * error) and clock["believed_rate"] == CALLED
    assert clock["clock"] == pytest.approx(RATE / CALLED - 1.0, abs=STANDARD_ERRORS * error) and error < 0.002
    assert scale["scale"] == pytest.approx(LONGER - 1.0, abs=STANDARD_ERRORS * 2.0 * error)
    assert same["value"] == pytest.approx(dg["value"], rel=AS_MUCH)
    assert scale["scale"] == pytest.approx(clock["scale"], rel=AS_MUCH)


def of_gravity(dg: float, std: float | None = 0.01, gravity: float = 9.81, rate: float | None = 240.0) -> dict:
    body = Body(shape=Disk(radius=0.03), radius_of_gyration=0.02)
    effect = {"name": "wrong_gravity", "parameters": {"dg": {"value": dg, "std": std, "unit": "m/s²"}}}
    return effect | {
        "could_be": could_be("wrong_gravity", [effect], Header(body=body, gravity=gravity, rate=rate, schema=1))
    }


def test_the_rate_that_free_fall_would_mean_is_said():
    (sentence,) = said([of_gravity(0.42)])
    assert (
        "10.23 m/s² points to the clock or the scale: "
        "frames taken at 235 Hz rather than 240 (2.1\xa0% fewer)" in sentence
    )
    assert "or all lengths 4.3\xa0% too large, including those of the body, would look the same." in sentence
    assert "a clock that is 2.1\xa0% too slow," in next(said([of_gravity(0.42, rate=None)]))
    slower = next(said([of_gravity(-0.42)]))
    assert "9.390 m/s² points to the clock, the scale or, for a light body, buoyancy" in slower and "% more)" in slower
    assert "all lengths 4.3\xa0% too small" in slower


@pytest.mark.parametrize(
    ("dg", "std", "gravity"),
    [(0.0, 0.01, 9.81), (ON_EARTH[1] - 9.7, 0.001, 9.7), (0.42, 0.21, 9.81), (0.42, None, 9.81), (0.42, 0.01, 5.0)],
    ids=["free fall", "another place", "within two standard errors", "a bound", "a slope"],
)
def test_nothing_is_said_where_gravity_may_be_what_it_is(dg, std, gravity):
    assert list(said([of_gravity(dg, std, gravity)])) == []


def of_size(shape, k_g: float, **sizes: tuple[float, float]) -> list[dict]:
    names = {"wrong_size": "s", "wrong_inertia": "d_I"}
    found = [
        {"name": name, "parameters": {names[name]: {"value": value, "std": std, "unit": "1"}}}
        for name, (value, std) in sizes.items()
    ]
    header = Header(body=Body(shape=shape, radius_of_gyration=k_g), schema=1)
    return [effect | {"could_be": could_be(effect["name"], found, header)} for effect in found]


def test_the_inertia_that_follows_from_a_mistyped_radius_is_one_cause_with_it():
    shape = Disk(radius=0.025)
    k_g = shape.radius_of_gyration
    two = of_size(shape, k_g, wrong_size=(0.2, 0.002), wrong_inertia=(0.45, 0.01))
    (sentence,) = said(two)
    assert "The body is 20\xa0% larger than its stated shape, from which its radius of gyration was" in sentence
    assert "wrong size and wrong inertia are this one cause" in sentence and "--shape disk:0.03000." in sentence
    assert two[0]["could_be"]["explains"] == ["wrong_inertia"] and two[1]["could_be"] is None
    for alone in ({}, {"wrong_inertia": (0.3, 0.01)}):  # 0.44 is that of the larger body
        effects = of_size(shape, k_g, wrong_size=(0.2, 0.002), **alone)
        assert effects[0]["could_be"]["explains"] == [] and "one cause" not in next(said(effects))
    assert list(said(of_size(shape, 1.01 * k_g, wrong_size=(0.2, 0.002)))) == []  # k was measured
    square = Polygon(vertices=((-0.02, -0.02), (0.02, -0.02), (0.02, 0.02), (-0.02, 0.02)))  # is told the factor
    (sentence,) = said(of_size(square, square.radius_of_gyration, wrong_size=(-0.05, 0.001)))
    assert "5.0\xa0% smaller" in sentence and "with the lengths of --shape times 0.9500." in sentence


def test_the_report_says_it_beside_the_effect():
    gain = {"held_out_log_score_per_impact": 3.0, "interval": [2.0, 4.0], "p_value": 0.001}
    about = {"family": "flight", "clears": True, "gain": gain, "indistinguishable_from": [], "material_in": ["flight"]}
    effect = of_gravity(0.42) | about
    page = str(told_in_report({"effects": [effect], "rejected": [], "search": {"limit": None, "value": None}}))
    assert next(said([effect])).replace(NBSP, " ") in page.replace(NBSP, " ")
