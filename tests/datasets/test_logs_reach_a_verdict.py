"""From a take of motion capture to the name of what is missing: export, plane, drops, impacts, critique."""

import numpy as np
import pytest

from tests.datasets.exports import write_motive
from tests.datasets.in_space import take
from thesis_lib.commands.datasets import main
from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.datasets import read_dataset
from thesis_lib.simulate.rig.hidden_causes import HiddenCauses

OFFSET = 1e-3  # m, of the centre of mass along the body's x axis
NEAR = 2e-4  # m; some five standard errors from the impacts of 80 drops


@pytest.mark.slow
def test_a_take_of_motion_capture_tells_where_the_centre_of_mass_is(tmp_path):
    """One long export in millimetres, y up, of drops in a plane 4° off the vertical, with noise and lost samples."""
    recorded = take(80, up="y", hidden=HiddenCauses(com_offset_x=OFFSET), duration=0.6)
    log = write_motive(recorded, tmp_path / "take.csv", units="Millimeters", lost=0.02)
    body = ("--body", "plate", "--shape", "ellipse:0.035,0.025", "--k-g", "0.019235")
    assert main(["init", str(log), "-o", str(tmp_path / "drops"), *body]) == 0
    found = criticise_drops(read_dataset(tmp_path / "drops"), rng=np.random.default_rng(0))
    assert found.verdict == "effects"
    assert [step.effect.name for step in found.discovery.steps] == ["com_offset"]
    assert found.ladder[-1][1].values["com_offset.c_x"] == pytest.approx(OFFSET, abs=NEAR)
