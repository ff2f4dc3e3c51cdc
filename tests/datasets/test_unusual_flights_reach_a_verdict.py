"""The critique of drops in air, of hits that stay down, of soft contacts and of energy that grows."""

import numpy as np
import pytest
from falling_disk import bounces, drops, once_a_step, released, spring

from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.results.diagnosis import diagnosis
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.errors import UserError

SIZE = 0.02  # relative: the size of a force on 40 flights of 0.2 s and more
pytestmark = pytest.mark.slow  # each searches the library of effects


def verdict(dataset: Dataset) -> dict:
    content = diagnosis(criticise_drops(dataset, rng=np.random.default_rng(0)), np.random.default_rng(1))
    assert not any("nan" in sentence for sentence in content["summary"])
    return content


def test_air_drag_is_named_with_its_size():
    rng = np.random.default_rng(0)
    dataset = drops(
        released(45, rng, (0.3, 0.42), (4.0, 8.0), 0.0),
        bounces(0.9, 0.25),
        rate=143.0,
        duration=0.5,
        rng=rng,
        air=lambda v: -0.12 * np.hypot(v[:, :1], v[:, 1:2]) * v * [1.0, 1.0, 0.0],
        noise=(5e-4, 5e-4, 0.0),
        has_angle=False,
    )
    found = verdict(dataset)
    assert found["verdict"] == "effects" and [one["name"] for one in found["effects"]] == ["quadratic_drag"]
    assert found["effects"][0]["parameters"]["c_q"]["value"] == pytest.approx(0.12, rel=SIZE)


def test_linear_damping_of_long_flights_is_named_with_its_size():
    rng = np.random.default_rng(1)
    dataset = drops(
        released(20, rng, (2.0, 4.0), (-0.5, 0.5), 2.0),
        bounces(0.95, 0.1),
        rate=100.0,
        duration=2.5,
        rng=rng,
        air=lambda v: -0.04 * v * [1.0, 1.0, 0.0],
        steps=20,
    )
    found = verdict(dataset)
    assert found["verdict"] == "effects" and [one["name"] for one in found["effects"]] == ["linear_drag"]
    assert found["effects"][0]["parameters"]["c_v"]["value"] == pytest.approx(0.04, rel=SIZE)


def test_a_law_is_not_adequate_where_slow_hits_do_not_rebound():
    rng = np.random.default_rng(2)
    state = released(30, rng, (0.05, 0.45), (-0.2, 0.2), 5.0)
    found = verdict(drops(state, bounces(0.5, 0.2, 1.0), rate=120.0, duration=1.2, rng=rng))
    assert found["verdict"] == "unexplained" and not found["remaining"]["structured"]
    assert "does not rebound" in found["summary"][0]
    assert any("and for none below" in sentence for sentence in found["summary"])


def test_energy_that_grows_is_no_fault_of_the_camera():
    rng = np.random.default_rng(4)
    state = released(16, rng, (1.5, 4.0), (-0.5, 0.5), 2.0)
    dataset = drops(state, once_a_step, rate=60.0, duration=3.0, rng=rng, noise=(1e-4, 1e-4, 1e-4), steps=1)
    found = verdict(dataset)
    assert found["verdict"] == "unexplained" and "Energy grows at" in found["summary"][0]
    assert not any(one["family"] == "measurement" for one in found["effects"])
    assert not any(word in " ".join(found["summary"]) for word in ("camera", "surface height", "smoothed"))


def test_soft_contacts_are_refused_with_their_duration():
    rng = np.random.default_rng(3)
    state = released(20, rng, (0.2, 0.8), (-0.3, 0.3), 4.0)
    dataset = drops(state, spring(0.05, 4.0), rate=240.0, duration=1.5, rng=rng, noise=(1e-4, 1e-4, 1e-3))
    with pytest.raises(UserError, match=r"cannot be compared with impact laws. Contacts last about 5\d ms"):
        criticise_drops(dataset, rng=rng)
