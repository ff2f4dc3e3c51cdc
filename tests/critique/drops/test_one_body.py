"""Data that are of one body are taken as such."""

import pytest

from thesis_lib.critique.drops.observations import observe
from thesis_lib.critique.drops.one_body import refuse_what_is_not_one_body
from thesis_lib.critique.proof import next_drops
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import CAUSES, ELLIPSE_BODY, HiddenCauses


@pytest.mark.parametrize("seed", range(6))
def test_one_body_with_a_small_cause_is_never_two(seed):
    """One impact in each of 50 trials: two sets of three coefficients make noise four times smaller."""
    cause, size = "com_offset_x", 0.35
    hidden = HiddenCauses.model_validate({cause: size * CAUSES[cause].size})
    rng = generator(1000 + seed, "next experiment", cause, f"{size:g}").spawn(4)[0]
    refuse_what_is_not_one_body("drops", observe(next_drops._drops(ELLIPSE_BODY, next_drops.RELEASE, 50, hidden, rng)))
