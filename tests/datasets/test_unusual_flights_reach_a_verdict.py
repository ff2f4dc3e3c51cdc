"""The critique of drops in air, of hits that stay down, of soft contacts and of energy that grows."""

import numpy as np
import pytest
from falling_disk import damped, growing, light_balls, soft, stopping

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


@pytest.mark.parametrize(
    ("dataset", "effect", "parameter", "size"),
    [
        (lambda: light_balls(c_q=0.12), "quadratic_drag", "c_q", 0.12),
        (lambda: damped(0.04, trials=20, rate=100.0, duration=2.5), "linear_drag", "c_v", 0.04),
    ],
    ids=["air", "damping"],
)
def test_drag_is_named_with_its_size(dataset, effect: str, parameter: str, size: float):
    found = verdict(dataset())
    assert found["verdict"] == "effects" and [one["name"] for one in found["effects"]] == [effect]
    assert found["effects"][0]["parameters"][parameter]["value"] == pytest.approx(size, rel=SIZE)


def test_a_law_is_not_adequate_where_slow_hits_do_not_rebound():
    found = verdict(stopping(1.0))
    assert found["verdict"] == "unexplained" and not found["remaining"]["structured"]
    assert "but for none below" in found["summary"][0]
    assert any("does not rebound" in sentence for sentence in found["summary"])


def test_energy_that_grows_is_no_fault_of_the_camera():
    found = verdict(growing(60.0, 1))
    assert found["verdict"] == "unexplained" and any("Energy grows at" in sentence for sentence in found["summary"])
    assert not any(one["family"] == "measurement" for one in found["effects"])
    assert not any(word in " ".join(found["summary"]) for word in ("camera", "surface height", "smoothed"))


def test_soft_contacts_are_refused_with_their_duration():
    with pytest.raises(UserError, match=r"cannot be compared with impact laws. Contacts last about 5\d ms"):
        criticise_drops(soft(0.05, 240.0), rng=np.random.default_rng(3))
