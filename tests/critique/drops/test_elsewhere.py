"""Hits on a hand or another object: MuJoCo has them, the library has no effect for them."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from thesis_lib.bodies.solids import Box
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops, fit_model
from thesis_lib.critique.drops.elsewhere import HitsElsewhere, hits_elsewhere
from thesis_lib.critique.drops.settings import ElsewhereSettings
from thesis_lib.critique.results.summary import struck_elsewhere
from thesis_lib.critique.selection.discovery import Discovery
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mujoco.outside import HAND
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.tosses.camera import CameraInSpace, film
from thesis_lib.simulate.tosses.world import TossedWorld

TOSSES = 30


def boxes(tosses, contact_time=1e-3, **hidden):
    body = {"shape": Box(half_extents=(0.05, 0.04, 0.03)), "mass": 0.25, "homogeneous": True}
    header = SpaceHeader.model_validate(
        {"schema": 2, "body": body, "rate": 240.0, "noise": {"position": 2e-4, "rotation": 2e-3}}
    )
    world = TossedWorld(header, hidden=hidden, contact_time=contact_time)
    return film("boxes", world, MujocoTosses(), CameraInSpace(), tosses, np.random.default_rng(3))


@cache
def found(*hidden):
    dataset = boxes(TOSSES, **dict(hidden))
    fitted = fit_model(dataset, "convex_contact")
    o = fitted.whitening.observations
    return o, lambda o=o, **settings: hits_elsewhere(fitted, o, ElsewhereSettings(**settings))


@pytest.mark.slow
def test_a_hand_in_flight_is_found_in_the_trials_that_it_touched():
    o, elsewhere = found(("hand.push", 15.0), ("hand.share", 0.4))
    hand = elsewhere()
    assert 0.2 * TOSSES < hand.trials < 0.7 * TOSSES
    assert all(0.0 < t < HAND[1] + 0.01 for _, t in hand.hits)
    assert elsewhere(share=0.9) is elsewhere(trials=TOSSES) is None  # as few may be errors of tracking
    away = o.found.away
    noisy = replace(o.found, away=replace(away, std=100.0 * away.std))
    assert elsewhere(replace(o, found=noisy)) is None  # noise alone may change the velocity as much


@pytest.mark.slow
def test_hits_above_the_surface_are_found_though_the_law_fits_all_others_and_none_where_nothing_is_hidden():
    o, elsewhere = found()
    assert elsewhere() is None and elsewhere(trials=1) is None
    single = np.flatnonzero(o.span == 0.0)
    hit = single[np.argsort(o.slope[single, 0, 2])[:4]]  # the fastest
    value = o.value.copy()
    value[hit, :, 2] += 0.01  # height, as on another object of 10 mm
    raised = elsewhere(replace(o, value=value), trials=1)
    assert set(raised.hits) == set(zip(o.trial[hit].tolist(), o.t[hit].tolist()))
    value[hit, :, 2] -= 0.02  # so far below the surface a body has been struck elsewhere, or it has hopped unseen
    filtered = replace(o.found, guard=0.02)
    assert elsewhere(replace(o, value=value), trials=1).trials
    assert elsewhere(replace(o, value=value, found=filtered), trials=1) is None


@pytest.mark.slow
def test_contacts_of_tens_of_milliseconds_are_refused_as_no_impulse_describes_them():
    with pytest.raises(UserError, match=r"cannot be compared with impact laws\. Contacts last about 3. ms"):
        criticise_drops(boxes(12, contact_time=0.02), rng=np.random.default_rng(0))


@pytest.mark.parametrize("found, verdict", [(None, "adequate"), (HitsElsewhere(3, 9, [(1, 0.2)]), "unexplained")])
def test_hits_elsewhere_decide_the_verdict_of_a_model_that_leaves_nothing_else(found, verdict):
    discovery = Discovery({}, "mirtich", (), None, None, None, {})
    observed = SimpleNamespace(found=SimpleNamespace(down=None))
    critique = SimpleNamespace(
        stand_ins={}, discovery=discovery, observations=observed, elsewhere=found, is_structured=False
    )
    assert DropsCritique.verdict.fget(critique) == verdict


def test_the_first_hits_are_listed_and_the_others_counted():
    hits = [(trial, 0.1 * trial) for trial in range(8)]
    said = struck_elsewhere(HitsElsewhere(8, 20, hits).content())
    assert "In 8 of 20 trials" in said and "trial 4 at 0.400 s and 3 more" in said and "trial 5" not in said
