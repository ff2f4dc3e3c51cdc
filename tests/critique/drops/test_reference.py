"""Where places, clocks and numbers of releases begin changes no verdict, no effect and no size."""

from dataclasses import replace
from datetime import date, timedelta

import numpy as np
import pandas as pd
import pytest
from hidden_effects import drops, injected_impacts, simulated

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.selection.scan import scan
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.samples import position
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Reference, Rig
from thesis_lib.extensions.effect_probe import RIGS, at_scale, random_states
from thesis_lib.mechanics.state import State
from thesis_lib.studies.proof.compute import counted_from

LAW = "anitescu_potra_newton"
DAY = date(2026, 1, 14)
N = 120
SIGMAS = 4.0
CLEAR = 100.0  # nats: beside an effect that explains ten times the noise
DIGITS = 1e-6  # of what is computed from numbers near 1000; relative
CLOCK = 1e-3  # the same where the clock has steps of a quarter of a microsecond
EXACT = 1e-12


def elsewhere(dataset: Dataset, x: float = 0.0, t: float = 0.0, trials: np.ndarray | None = None) -> Dataset:
    """The same drops in numbers that begin elsewhere; `trials` are the new numbers of the releases."""

    def moved(table: pd.DataFrame | None) -> pd.DataFrame | None:
        if table is None:
            return None
        table = table.assign(x=table["x"] + x, **({"t": table["t"] + t} if "t" in table else {}))
        if trials is None:
            return table
        _, number = np.unique(table["trial"], return_inverse=True)
        return table.assign(trial=trials[number])

    return replace(dataset, trajectories=moved(dataset.trajectories), impacts=moved(dataset.impacts))


def by_date(n: int) -> np.ndarray:
    """Numbers of releases of which one was made a day."""
    return np.array([int(f"{DAY + timedelta(days=i):%Y%m%d}") for i in range(n)])


def fitted(dataset: Dataset, name: str) -> tuple[Observations, float, Fit]:
    """Observations from the middle, the gain of the score test in nats, and the fit with an effect."""
    o = observe(dataset)
    world = Drops(o.counted_from(o.middle))
    plain = world.fit(LAW, ())
    gain = scan(world.slopes(plain, [EFFECTS[name]]), 9, np.random.default_rng(0)).gain[name]
    return world.observations, gain, world.fit(LAW, (EFFECTS[name],), plain.values)


@pytest.mark.parametrize("numbers", [np.arange(N), np.arange(N) + 1000, by_date(N)], ids=["0", "1000", "date"])
def test_wear_is_found_however_releases_are_numbered(numbers):
    data = elsewhere(injected_impacts("worn", N, 31, "wear", {"wear.w": -0.002}), trials=numbers)
    o, gain, found = fitted(data, "wear")
    assert gain > CLEAR
    if np.ptp(numbers) == N - 1:  # the end of a month is not a release: by date the drift of a number is another
        true = counted_from(
            replace(o.rig.reference, trial=o.rig.reference.trial - numbers[0]), TRUE | {"wear.w": -0.002}
        )
        for name in ("epsilon", "wear.w"):
            assert abs(found.values[name] - true[name]) < SIGMAS * found.std[name], name
    assert found.values["wear.w"] < -SIGMAS * found.std["wear.w"] and 0.4 < found.values["epsilon"] < 0.6


TRUE = {"mu": 0.2, "epsilon": 0.6}  # of `injected_impacts`


@pytest.mark.parametrize("x", [0.0, 3.0, -3.0])
@pytest.mark.parametrize("name", ["position_dependent_restitution", "position_dependent_friction"])
def test_what_depends_on_place_is_found_wherever_the_drops_fall(name, x):
    (p,) = EFFECTS[name].parameters
    hidden = {f"{name}.{p.name}": 1.0}
    o, gain, found = fitted(elsewhere(injected_impacts("sloping", N, 32, name, hidden), x=x), name)
    true = counted_from(replace(o.rig.reference, x=o.rig.reference.x - x), TRUE | hidden)
    assert gain > CLEAR
    for key, value in true.items():
        assert abs(found.values[key] - value) < SIGMAS * found.std[key], key


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.along])
def test_true_values_of_another_reference_say_the_same(name):
    effect, model = EFFECTS[name], Model(LAWS[LAW], (EFFECTS[name],), takes_time=True)
    if effect.family == "measurement":  # the camera's own origin cannot be known
        return
    values = TRUE | {"tau": 5e-4} | {f"{name}.{key}": value for key, value in at_scale(effect).items()}
    rig = RIGS["quadrilateral"]
    states = random_states(rig, 50, np.random.default_rng(3))
    there = Reference(x=0.1, t=0.5, trial=20.0)

    def struck(rig: Rig, values: dict[str, float]) -> State:
        return bind(model, values, rig).predict(states)

    here, moved = struck(rig, values), struck(replace(rig, reference=there), counted_from(there, values))
    np.testing.assert_allclose(moved.v, here.v, atol=1e-9)


def test_instants_a_nanosecond_apart_are_told_apart_whatever_the_numbers():
    trial = np.repeat([20260114, 20260115], 3)
    t = np.tile([0.0, 0.004, 0.004 + 2e-9], 2)
    assert position(trial, t, trial, t).tolist() == list(range(6))
    assert position(trial, t, trial, t + 1e-9).tolist() == [1, 2, 3, 4, 5, 6]
    assert position(trial, t + 1.7e9, trial[::3], t[::3] + 1.7e9).tolist() == [0, 3]


@pytest.mark.parametrize(
    ("move", "digits"),
    [({"x": 3.0, "t": 1e3, "trials": np.arange(40) + 1000}, DIGITS), ({"t": 1.7e9, "trials": by_date(40)}, CLOCK)],
    ids=["1000", "epoch"],
)
def test_the_same_impacts_are_observed(move, digits):
    one = drops()
    data = Dataset("plain", one.header, one.trajectories)
    here, there = observe(data), observe(elsewhere(data, **move))
    assert len(there) == len(here) and there.hits.tolist() == here.hits.tolist()
    shifted = there.value - [move.get("x", 0.0), 0.0, 0.0]
    for ours, theirs in ((shifted, here.value), (there.slope, here.slope), (there.cov, here.cov)):
        np.testing.assert_allclose(ours, theirs, rtol=digits, atol=digits * np.abs(theirs).max())
    np.testing.assert_allclose(there.flights.acceleration, here.flights.acceleration, atol=10.0 * digits)


def test_the_middle_is_that_of_the_training_impacts_and_none_between_walls():
    o = observe(elsewhere(injected_impacts("plain", N, 33, "wear", {"wear.w": 0.0}), trials=np.arange(N) + 1000))
    assert o.middle.trial == 1060.0 and abs(o.middle.x) < 0.1
    assert o.counted_from(o.middle).rig.reference == o.middle
    assert o.rows(np.arange(0)).middle == Reference()


@pytest.mark.slow
def test_the_verdict_does_not_depend_on_where_numbers_begin():
    """Restitution by place: the same at 3 m, after 1,000 s and with releases numbered by date."""
    data = simulated("sloping", 34, restitution_slope=0.5)
    n = len(np.unique(data.trajectories["trial"]))
    both = (data, elsewhere(data, x=3.0, t=1e3, trials=by_date(n)))
    small = CritiqueSettings(folds=2, finalists=2, max_effects=1)
    here, there = (criticise_drops(one, rng=np.random.default_rng(4), settings=small) for one in both)
    assert isinstance(here, DropsCritique) and isinstance(there, DropsCritique)
    assert [step.effect.name for step in here.discovery.steps] == ["position_dependent_restitution"]
    assert [step.effect.name for step in there.discovery.steps] == ["position_dependent_restitution"]
    assert here.verdict == there.verdict == "effects"
    assert there.ladder[-1][1].values == pytest.approx(here.ladder[-1][1].values, rel=1e-3, abs=1e-6)
    assert there.training.rig.reference.x == pytest.approx(here.training.rig.reference.x + 3.0, abs=EXACT)
