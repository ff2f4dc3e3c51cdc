"""Data that are of one body are taken as such."""

import numpy as np
import pandas as pd
import pytest
from hidden_effects import injected_impacts, recorded

from thesis_lib.critique.drops.one_body import balance_groups, refuse_what_is_not_one_body, touch_groups
from thesis_lib.critique.drops.settings import OneBody
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import CAUSES, ELLIPSE_BODY, SQUARE, CompliantContact, HiddenCauses
from thesis_lib.studies.proof import next_drops


@pytest.mark.parametrize("seed", range(6))
def test_one_body_with_a_small_cause_is_never_two(seed):
    """One impact in each of 50 trials: two sets of three coefficients make noise four times smaller."""
    cause, size = "com_offset_x", 0.35
    hidden = HiddenCauses.model_validate({cause: size * CAUSES[cause].size})
    rng = generator(1000 + seed, "next experiment", cause, f"{size:g}").spawn(4)[0]
    refuse_what_is_not_one_body(
        "drops", observe(next_drops._drops(ELLIPSE_BODY, next_drops.RELEASE, 50, hidden, rng)), OneBody()
    )


@pytest.mark.parametrize(("second", "told_apart"), [(0.0, False), (0.8, True)])
def test_bodies_that_turn_differently_are_two_and_one_misses_its_balance_by_noise_alone(
    second: float, told_apart: bool
):
    """Three impacts in each of 100 trials; angular momentum about the contact point is kept."""
    made = [
        injected_impacts("body", 300, seed, "wrong_inertia", {"wrong_inertia.d_I": d_I}, SQUARE)
        for seed, d_I in ((1, 0.0), (2, second))
    ]
    table = pd.concat([part.impacts.assign(trial=part.impacts["trial"] // 3 + 100 * i) for i, part in enumerate(made)])
    o = observe(Dataset("bodies", made[0].header, impacts=table.reset_index(drop=True)))
    groups = balance_groups(o)
    assert groups.told_apart(OneBody()) == told_apart
    if told_apart:
        assert np.array_equal(groups.second, groups.trials >= 100) or np.array_equal(groups.second, groups.trials < 100)
        with pytest.raises(
            UserError, match=r"100 trials \(trial 0-99\) and 100 trials \(trial 100-199\).*k² (0.99|1).* and 1.[78]"
        ):
            refuse_what_is_not_one_body("bodies", o, OneBody())
    else:
        assert groups.one == pytest.approx(1.0, abs=0.12)  # a robust spread of 600 is known to 5 %


@pytest.mark.parametrize("cause", ["camera_roll", "camera_slope"])
def test_a_surface_that_slopes_in_the_picture_makes_no_two_bodies(cause: str):
    """Where nobody asked for the slope, two bodies explained 3 times as much as one."""
    hidden = HiddenCauses.model_validate({cause: CAUSES[cause].size})
    o = observe(recorded(ELLIPSE_BODY, 120, 7, contact=CompliantContact(contact_time=3e-4), hidden=hidden))
    for groups in (touch_groups(o), balance_groups(o)):
        assert groups.one < 2.5 and np.mean(groups.margin < OneBody().clear) > 0.5
