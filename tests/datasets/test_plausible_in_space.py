"""What `datasets check` says of a set in space: units, gravity, orientations; and nothing where nothing is wrong."""

import json
import re

import numpy as np
import pandas as pd
import pytest
from folders import write
from folders_in_space import body, header, impacts
from scipy.spatial.transform import Rotation
from tossed import flights

from tests.tosses import simulate_tosses
from thesis_lib.commands.datasets import main
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.checks.in_space import motion_facts
from thesis_lib.datasets.format.validate import DatasetError
from thesis_lib.datasets.summary import summarise, summary_text
from thesis_lib.simulate.tosses.drawn import make
from thesis_lib.simulate.tosses.drawn_in_worlds import worlds_cases
from thesis_lib.studies.proof.space import engine_of

Q = ["qw", "qx", "qy", "qz"]


def said(head=None, **tables) -> str:
    """All errors and warnings of a dataset, as text."""
    try:
        return "\n".join(map(str, dataset_of(head or header(), **tables).warnings))
    except DatasetError as error:
        return str(error)


@pytest.mark.parametrize("spin", [2.0, 8.0, 20.0])
def test_nothing_is_said_of_good_flights(spin):
    frame = flights(spin=spin)
    assert said(trajectories=frame) == ""
    facts = motion_facts(frame, dataset_of(header(), trajectories=frame).in_space)
    assert facts.flights == 8 and facts.reading == "" and not len(facts.turned.rows) and facts.lost_orientation == 0.0
    np.testing.assert_allclose(facts.fall, [0.0, 0.0, -9.81], atol=0.2)


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_stamps_of_few_digits_and_lost_frames_do_not_hide_the_rate(lost):
    # most steps of a camera at 240 Hz are 4 ms long if stamps are whole milliseconds
    frame = flights().assign(t=lambda table: table["t"].round(3))
    seen = frame[np.random.default_rng(1).random(len(frame)) >= lost].reset_index(drop=True)
    assert "(239.9 Hz)" in said(header(rate=250.0), trajectories=seen)
    assert "rate" not in said(header(rate=240.0), trajectories=seen)
    assert dataset_of(header(), trajectories=frame).rate == pytest.approx(240.0, rel=0.002)


@pytest.mark.parametrize(("factor", "unit"), [(1000.0, "millimetres"), (100.0, "millimetres or centimetres")])
def test_lengths_in_other_units_are_refused(factor, unit):
    frame = flights()
    frame[["x", "y", "z"]] *= factor
    assert f"columns x, y, z: look like {unit}" in said(trajectories=frame)
    slow = flights(noise=(2e-5, 3e-3))
    slow[["x", "y", "z"]] *= 100.0
    ten = flights().assign(**{axis: 10.0 * flights()[axis] for axis in "xyz"})
    assert "millimetres read as centimetres: with this unit 8 free flights fall; as written, by 98.1 m/s²" in said(
        trajectories=ten
    )
    assert "x, y, z: look like cm: with this unit 8 free flights fall" in said(trajectories=slow[slow["t"] < 0.18])


@pytest.mark.parametrize("axis", ["x", "z"])
def test_an_axis_in_another_unit_is_named(axis):
    frame = flights()
    assert f"column {axis}: is not in the unit of the others" in said(
        trajectories=frame.assign(**{axis: 1e-3 * frame[axis]})
    )


def test_gravity_along_another_axis_is_refused_with_the_one_to_write():
    text = said(header(gravity=[0, -9.81, 0], surface=None), trajectories=flights())
    assert "gravity: nothing falls along the stated gravity; 8 free flights fall along [" in text
    assert "write gravity: [" in text and "-9.8" in text
    tilted = Rotation.from_euler("x", 6.0, degrees=True).apply([0.0, 0.0, -9.81])
    assert "free flights fall 6." in said(header(gravity=tilted.tolist()), trajectories=flights(trials=20))
    still = flights().assign(x=0.0, y=0.0, z=1.0)
    assert "no free flight is seen" in said(trajectories=still)
    still.loc[still["trial"] == 3] = flights()
    text = said(header(gravity=[0, -9.81, 0], surface=None), trajectories=still)  # one of eight may be chance
    assert "no free flight is seen" in text and "write gravity" not in text


def test_one_correction_of_gravity_suffices():
    frame = flights(trials=20)
    tilted = Rotation.from_euler("x", 20.0, degrees=True).apply([0.0, 0.0, -9.81])
    text = said(header(gravity=tilted.tolist()), trajectories=frame)
    written = np.array(json.loads(re.findall(r"write gravity: (\[.*?\])", text)[0]))
    assert np.degrees(np.arccos(-written[2] / np.linalg.norm(written))) < 1.0
    assert "off the stated gravity" not in said(header(gravity=written.tolist()), trajectories=frame)


MISREAD = [
    (lambda q: q[:, [1, 2, 3, 0]], "as x, y, z, w (the scalar last)"),
    (lambda q: q * [1, -1, -1, -1], "reversed (of a left-handed frame"),
]


@pytest.mark.parametrize(("wrong", "right"), MISREAD)
def test_quaternions_that_are_written_otherwise_are_named(wrong, right):
    frame = flights(trials=20)
    frame[Q] = wrong(frame[Q].to_numpy())
    assert f"read {right}" in said(trajectories=frame)


def test_a_tracked_frame_that_is_turned_is_no_wrong_quaternion():
    turn = Rotation.from_rotvec([1.0, -0.5, 2.0])
    frame = flights(trials=20)
    q = Rotation.from_quat(frame[Q].to_numpy(), scalar_first=True) * turn
    frame[Q] = q.as_quat(scalar_first=True)
    tracked = {"quaternion": turn.as_quat(scalar_first=True).tolist()}
    assert said(header(tracked=tracked), trajectories=frame) == ""
    assert said(header(tracked="unknown"), trajectories=frame) == ""


@pytest.mark.parametrize(
    ("height", "words"), [(0.5, "m below the surface"), (-0.5, "m above the surface"), (0.005, "")]
)
def test_a_surface_far_from_the_hits_is_named(height, words):
    frame = simulate_tosses(header(), 10, np.random.default_rng(0)).trajectories
    text = said(header(surface={"point": [0.0, 0.0, height]}), trajectories=frame)
    assert text == "" if not words else re.search(rf"at \d+ hits the lowest point of the body is 0\.\d+ {words}", text)


def test_lost_orientations_and_jumps_are_counted():
    frame = flights()
    frame.loc[100:260, Q] = np.nan
    assert "the orientation is lost in 34% of the samples" in said(trajectories=frame)
    flipped = flights()
    turn = Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0])
    rows = slice(90, 109)
    q = Rotation.from_quat(flipped.loc[rows, Q].to_numpy(), scalar_first=True) * turn
    flipped.loc[rows, Q] = q.as_quat(scalar_first=True)
    text = said(trajectories=flipped)
    assert "the orientation jumps at 2 of 480 samples, by 90° (median), and 4.2% of the samples lie between" in text
    fast = flights(spin=15.0)  # which turns by half a radian while eight frames are lost
    assert "jumps" not in said(trajectories=fast.drop(index=range(30, 38)))


def test_another_tag_that_takes_over_is_named_and_a_hit_is_not():
    frame = flights()
    rows = slice(90, 109)
    away = Rotation.from_quat(frame.loc[rows, Q].to_numpy(), scalar_first=True).apply([0.004, 0.0, 0.0])
    moved = frame.copy()
    moved.loc[rows, ["x", "y", "z"]] += away
    assert "the position jumps at 2 of 480 samples, by 4.2 mm (median), and 4.2% of the samples" in said(
        trajectories=moved
    )
    hit = frame.copy()
    late = (hit["trial"] == 1) & (hit["t"] > 0.1)
    hit.loc[late, "z"] += 3.0 * (hit["t"][late] - 0.1)
    assert "jumps" not in said(trajectories=hit)


def test_heights_that_repeat_to_the_last_digit_are_no_measurement():
    frame = flights()
    last = frame.groupby("trial").tail(1).index
    text = said(trajectories=frame.assign(z=frame["z"].mask(frame.index.isin(last), 0.0514874)))
    assert (
        "column z, rows 60, 120, 180, 240 and 4 more: 0.0514874 occurs in 8 trials, to the last digit: it was" in text
    )
    few = frame.groupby("trial").head(20)  # of which the copies themselves are no small share
    text = said(trajectories=few.assign(z=few["z"].mask(few.index.isin(few.groupby("trial").tail(1).index[:4]), 0.03)))
    assert "0.03 occurs in 4 trials, to the last digit: it was" in text
    for digits in (3, 4):  # some coordinates stand in three trials by chance
        assert "last digit" not in said(trajectories=frame.round(digits))
        assert "last digit" not in said(trajectories=few.round(digits))


def test_a_clock_that_is_off_shows_in_the_fall():
    text = said(header(rate=None), trajectories=flights(trials=20).assign(t=lambda frame: frame["t"] * 250.0 / 240.0))
    found = re.search(r"fall by 9.*frames were taken at (\S+) Hz and not at the 230.4 Hz of their times", text)
    assert found and float(found[1]) == pytest.approx(240.0, rel=3e-3)


@pytest.mark.parametrize(
    ("lever", "wrong", "right"), [([0.04, 0.0, 0.0], *MISREAD[0]), ([0.01, 0.01, 0.0], *MISREAD[1])]
)
def test_quaternions_that_are_written_otherwise_are_named_whatever_point_is_tracked(lever, wrong, right):
    frame = flights(trials=12)
    frame[["x", "y", "z"]] += Rotation.from_quat(frame[Q].to_numpy(), scalar_first=True).apply(lever)
    tracked = {"position": lever}
    assert said(header(tracked=tracked), trajectories=frame) == ""
    frame[Q] = wrong(frame[Q].to_numpy())
    assert f"read {right}" in said(header(tracked=tracked), trajectories=frame)
    assert f"read {right}" in said(header(tracked="unknown"), trajectories=frame)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body": body(shape={"kind": "box", "half_extents": [50.0, 40.0, 30.0]})}, "millimetres?"),
        (
            {"body": body(homogeneous=None, radii_of_gyration=[0.2, 0.2, 0.2])},
            "a radius of gyration of 0.2 m is larger",
        ),
        ({"body": body(mass=250.0)}, "250 kg would be denser than any metal"),
        ({"gravity": [0.0, 0.0, -9810.0]}, "is more than on any planet"),
        ({"noise": {"position": 0.3}}, "noise.position: 0.3 m is larger than the body"),
        ({"noise": {"rotation": 3.0}}, "noise.rotation: 3 rad is most of a turn"),
    ],
)
def test_headers_that_contradict_themselves(changes, message):
    assert message in said(header(**changes), trajectories=flights())


def test_hits_must_lie_on_the_surface_and_approach_it():
    assert said(impacts=impacts()) == ""
    assert "0.2 m off the surface" in said(impacts=impacts().assign(z=0.23))
    assert "does not approach the surface" in said(impacts=impacts().assign(vz_pre=2.0))
    assert "millimetres or centimetres per second" in said(impacts=impacts().assign(vz_pre=-2000.0))


@pytest.mark.slow
def test_check_prints_what_is_in_a_set_in_space(tmp_path, capsys):
    hits = impacts(8)
    hits.loc[0, ["vz_pre", "vz_post"]] = -0.2, 0.1
    folder = write(tmp_path / "drops", header(), trajectories=flights(), impacts=hits)
    assert main(["check", str(folder)]) == 0
    text = capsys.readouterr().out
    assert "body        box, reaches 0.07071 m" in text and "flights     8, which fall by (" in text
    assert (
        "hits        8 can be used in 8 trials (corner 0, edge 0, face 7, weak 1)" in text
        and "only, no verdict: 8 usable" in text
    )
    assert "The dataset is valid." in text
    assert main(["check", str(folder), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["dimensions"] == 3 and facts["motion"]["flights"] == 8 and facts["motion"]["reading"] == "as stated"
    assert facts["detection"]["by_contact"] == {"corner": 0, "edge": 0, "face": 7}
    assert facts["surfaces"]["surface"]["normal"] == [0.0, 0.0, 1.0]


def test_the_reach_of_a_body_counts_from_its_centre_of_mass():
    off = body(center_of_mass=[0.01, 0.0, 0.0], homogeneous=None, radii_of_gyration=[0.03] * 3)
    text = summary_text(dataset_of(header(body=off), trajectories=flights()))
    assert f"box, reaches {np.linalg.norm([0.06, 0.04, 0.03]):.4g} m from its centre of mass" in text


SPOILT = {
    "scaled": lambda frame, rng: frame.assign(
        **{name: frame[name] * 10.0 ** rng.integers(-12, 9) for name in ["x", "z"]}
    ),
    "times": lambda frame, rng: frame.assign(t=frame["t"] * 10.0 ** rng.integers(-6, 6)),
    "unoriented": lambda frame, rng: frame.assign(
        **{name: frame[name].where(rng.random(len(frame)) < 0.0) for name in Q}
    ),
    "still": lambda frame, rng: frame.assign(x=0.0, y=0.0, z=0.0),
    "unturned": lambda frame, rng: frame.assign(qw=1.0, qx=0.0, qy=0.0, qz=0.0),
    "thin": lambda frame, rng: frame[rng.random(len(frame)) < 0.5],
    "short": lambda frame, rng: frame.groupby("trial").head(rng.integers(1, 14)),
    "one of many": lambda frame, rng: frame.assign(trial=frame["trial"] + 10**12),
}


@pytest.mark.parametrize("spoilt", SPOILT)
def test_whatever_the_numbers_are_a_set_is_described_or_refused(spoilt):
    rng = np.random.default_rng(len(spoilt))
    for seed in range(6):
        frame = SPOILT[spoilt](flights(3, frames=int(rng.integers(14, 40)), seed=seed), rng)
        gravity = [[0.0, 0.0, -9.81], [0.0, 0.0, 0.0], [0.0, 1e-6, 0.0], [9.81, 0.0, 0.0]][seed % 4]
        tracked = [None, "unknown", {"position": [0.1, 0.0, 0.0]}][seed % 3]
        try:
            made = dataset_of(header(gravity=gravity, tracked=tracked), trajectories=frame)
        except DatasetError:
            continue
        json.dumps(summarise(made), allow_nan=False)
        assert "flights" in summary_text(made)


@pytest.mark.slow
def test_flights_that_a_low_pass_and_noise_cut_in_two_are_neither_releases_nor_catches():
    case = next(case for case in worlds_cases() if (case.world, case.truth, case.seed) == ("mujoco", "nothing", 4))
    assert case.drawn["filter"] == "butterworth"
    made = make(case, engine_of(case))
    facts = motion_facts(made.trajectories, made.in_space)
    assert facts.flights > 100 and facts.held == {} and facts.in_the_air == {}


@pytest.mark.slow
def test_bodies_that_are_held_first_or_caught_are_named_with_the_time(tmp_path, capsys):
    frame = flights(trials=10)  # all end above the table
    parts = []
    for trial, toss in frame.groupby("trial"):
        held = toss.iloc[[0]].iloc[np.zeros(60, int)].assign(t=toss["t"].iloc[0] - np.arange(60, 0, -1) / 240.0)
        parts += [held.iloc[30:] if trial < 4 else held[:0], toss]
    facts = motion_facts(pd.concat(parts, ignore_index=True), dataset_of(header(), trajectories=frame).in_space)
    assert list(facts.held) == [0, 1, 2, 3] and len(facts.in_the_air) == 10
    for times, end in ((facts.held, "min"), (facts.in_the_air, "max")):
        own = frame.groupby("trial")["t"].agg(end)
        np.testing.assert_allclose(list(times.values()), own[list(times)], atol=0.02)
    folder = write(tmp_path / "drops", header(), trajectories=pd.concat(parts, ignore_index=True))
    assert main(["check", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "4 trials begin before the release of the body (trial 0 until" in said and ", trial 3 until" in said
    assert (
        "10 trials end in the air: caught, out of view, or beyond the table's edge (trial 0 at" in said
        and "5 more)" in said
    )
    folder = write(tmp_path / "caught", header(), trajectories=frame)
    assert main(["check", str(folder)]) == 0
    assert "releases    10 trials end in the air" in capsys.readouterr().out
