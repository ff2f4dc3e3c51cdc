"""The search on a world made for this test: a line through noisy points, and four curves that it may lack."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Self, TypeVar

import numpy as np
import pytest

from thesis_lib.critique.selection.bases import Bases
from thesis_lib.critique.selection.discovery import Path, Step, judge_held_out
from thesis_lib.critique.selection.evidence import Evidence
from thesis_lib.critique.selection.scan import orthonormal, scan
from thesis_lib.critique.selection.search import Search, search, split
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Slopes, World

TRIALS, POINTS = 20, 15
IDLE = 7  # columns of a bundle without use
SIZE = 1.0  # of what is injected, in units of the noise
SIGMAS = 4.0


@dataclass(frozen=True)
class Curve:
    """y grows by p `shape`(x); p is fitted."""

    name: str


SHAPES = {
    "square": lambda x: x**2 - np.mean(x**2),
    "wave": lambda x: np.sin(4.0 * x),
    "twin_of_wave": lambda x: 3.0 * np.sin(4.0 * x) + 0.5 * x,  # with the line's slope it is the wave
    "step": np.sign,
}


@dataclass(frozen=True)
class Fitted:
    base: str
    effects: tuple[Curve, ...]
    values: dict[str, float]
    score: float


@dataclass(frozen=True)
class Scores:
    trial: np.ndarray
    z: np.ndarray
    base: str

    trials = property(lambda self: np.unique(self.trial))
    units = property(lambda self: len(self.z))
    total = property(lambda self: float(-0.5 * self.z @ self.z))

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        return np.array([-0.5 * np.sum(self.z[self.trial == k] ** 2) for k in trials])


class Line(World[Curve, Fitted, Scores]):
    """Points (x, y) with noise of standard deviation 1, and y = a + b x with effects."""

    unit, bases = "point", ("line",)

    def __init__(self, trial: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        self.trial, self.x, self.y = trial, x, y
        self.trials = np.unique(trial)
        self.candidates = {name: Curve(name) for name in SHAPES}

    def part(self, trials: np.ndarray) -> Self:
        rows = np.isin(self.trial, trials)
        return type(self)(self.trial[rows], self.x[rows], self.y[rows])

    def columns(self, effects, base: str = "line") -> np.ndarray:
        of_base = [np.ones_like(self.x), self.x] + [np.exp(3.0 * self.x)] * (base == "bend")
        return np.column_stack([*of_base, *(self.shape(e.name) for e in effects)])

    def shape(self, name: str) -> np.ndarray:
        """Columns (n, k) of a curve; those of a bundle are its square and what has nothing to do with y."""
        if name in SHAPES:
            return SHAPES[name](self.x)[:, None]
        others = np.random.default_rng(len(name)).standard_normal((len(self.x), IDLE))
        return np.column_stack([SHAPES["square"](self.x), others])

    def residual(self, fitted: Fitted) -> np.ndarray:
        return self.y - self.columns(fitted.effects, fitted.base) @ list(fitted.values.values())

    def fit(self, base, effects, start=None, effort="full") -> Fitted:
        X = self.columns(effects, base)
        p = np.linalg.lstsq(X, self.y, rcond=None)[0]
        z = self.y - X @ p
        names = [f"{e.name}{i or ''}" for e in effects for i in range(self.shape(e.name).shape[1])]
        return Fitted(base, effects, dict(zip((*"abc"[: X.shape[1] - len(names)], *names), p)), float(-0.5 * z @ z))

    def judge(self, fitted: Fitted) -> Scores:
        return Scores(self.trial, self.residual(fitted), fitted.base)

    def cross_validate(self, fitted: Fitted, folds: np.ndarray) -> Scores:
        parts = []
        for k in np.unique(folds):
            others = self.part(self.trials[folds != k]).fit(fitted.base, fitted.effects)
            parts.append(self.part(self.trials[folds == k]).judge(others))
        return Scores(np.concatenate([p.trial for p in parts]), np.concatenate([p.z for p in parts]), fitted.base)

    def slopes(self, fitted: Fitted, candidates) -> Slopes:
        columns = {e.name: -self.shape(e.name) for e in candidates}
        return Slopes(self.residual(fitted), -self.columns(fitted.effects, fitted.base), columns, unit_noise=True)

    def is_material(self, better: Scores, worse: Scores, candidate: Curve, settings: SearchSettings) -> bool:
        before, after = (np.sqrt(np.mean(judgement.z**2)) for judgement in (worse, better))
        return settings.matters(before, after, 0.0)


L = TypeVar("L", bound=Line)


def line(seed: int, kind: type[L] = Line, bend: float = 0.0, **hidden: float) -> L:
    rng = np.random.default_rng(seed)
    trial = np.repeat(np.arange(TRIALS), POINTS)
    x = rng.uniform(-1.0, 1.0, len(trial))
    y = 0.3 + 2.0 * x + rng.standard_normal(len(trial)) + bend * np.exp(3.0 * x)
    return kind(trial, x, y + sum((size * SHAPES[name](x) for name, size in hidden.items()), np.zeros_like(x)))


def halves(world: L) -> tuple[L, L]:
    """Training and held-out trials."""
    training, unseen = split(world.trials, 0.3, np.random.default_rng(0))
    return world.part(training), world.part(unseen)


def found(world: Line, settings: SearchSettings | None = None, **options):
    return search(world, settings or SearchSettings(), np.random.default_rng(1), **options)


def test_what_is_injected_is_found_with_its_size():
    world = line(0, square=3.0 * SIZE)
    discovery = found(world)
    assert [step.effect.name for step in discovery.steps] == ["square"]
    (step,) = discovery.steps
    assert step.alternatives == () and discovery.verdict(is_structured=False) == "effects"
    assert "square" not in discovery.last_scan.gain  # what was taken has left the candidates
    std = 1.0 / np.linalg.norm(SHAPES["square"](world.x))
    assert discovery.fitted.values["square"] == pytest.approx(3.0 * SIZE, abs=4.0 * std)
    # the gain of the fit is that of the score test, because the model is linear
    gain = discovery.fitted.score - discovery.bases["line"].score
    assert step.scan.gain["square"] == pytest.approx(gain, rel=1e-9)


def test_parameters_that_gain_by_chance_do_not_rank_a_candidate_first():
    world = line(0, square=3.0 * SIZE)
    world.candidates |= {"bundle": Curve("bundle")}
    gains = {name: world.fit("line", (e,)).score for name, e in world.candidates.items()}
    assert gains["bundle"] > gains["square"]
    (step,) = found(world, SearchSettings(finalists=1)).steps
    assert step.effect.name == "square" and "bundle" in step.alternatives


class Turned(Line):
    """A wave that shows on one of two bases alone, which fit equally well without it."""

    bases, rivals = ("line", "turned"), 2

    def columns(self, effects, base: str = "line") -> np.ndarray:
        seen = np.array([1.0, 1.0, *(float(base == "turned" or e.name != "wave") for e in effects)])
        return super().columns(effects, base) * seen

    def turns_bases(self, candidate):
        return candidate.name == "wave"


def test_an_effect_that_turns_bases_is_tried_with_each(monkeypatch):
    monkeypatch.delitem(SHAPES, "twin_of_wave")
    discovery = found(line(0, Turned, wave=3.0 * SIZE), SearchSettings(rivalled=1))
    assert [step.effect.name for step in discovery.steps] == ["wave"] and discovery.fitted.base == "turned"


def test_of_twins_the_one_that_leaves_earlier_effects_where_they_are_enters(monkeypatch):
    world = line(0, wave=3.0 * SIZE)
    (step,) = found(world).steps
    first = step.effect.name
    monkeypatch.setattr(Line, "moved", lambda self, fitted, before: 9.0 * (fitted.effects[-1].name == first))
    (step,) = found(world).steps
    assert {first, step.effect.name} == {"wave", "twin_of_wave"} and step.effect.name != first
    assert step.alternatives == (first,)
    # not one that predicts worse
    monkeypatch.setattr(Line, "moved", lambda self, fitted, before: 9.0 * (fitted.effects[-1].name != "square"))
    (step,) = found(world).steps
    assert step.effect.name == first
    # and one that moves further and predicts worse is no alternative
    monkeypatch.setattr(Line, "moved", lambda self, fitted, before: 9.0 * (fitted.effects[-1].name == "square"))
    near = {name: world.fit("line", (world.candidates[name],)) for name in ("wave", "square")}
    evidence = Evidence(world, SearchSettings(), np.random.default_rng(1))
    judgements = dict(zip(near, evidence.judged(list(near.values()))))
    assert evidence.as_good_by_moving("wave", judgements, near, world.fit("line", ())) == []


def test_a_fit_on_a_base_of_the_reserve_starts_with_the_effects_of_the_quick_fit(monkeypatch):
    """They have been moved together; the parameters of the base itself are those of the model, which has that base."""
    world = line(0)
    monkeypatch.setattr(world, "values_of_base", lambda fitted: {"a": fitted.values["a"]}, raising=False)
    fitted = Fitted("bend", (Curve("square"),), {"a": 1.0, "square": 2.0}, 0.0)
    quick = Fitted("line", (Curve("square"), Curve("wave")), {"a": 5.0, "square": 3.0, "wave": 4.0}, 0.0)
    of = Search(world, SearchSettings(), np.random.default_rng(0), str)
    assert of.near_fit(quick, fitted, "bend") == ("bend", quick.effects, {"a": 1.0, "square": 3.0, "wave": 4.0}, "near")
    assert of.near_fit(quick, fitted, None) == ("line", quick.effects, quick.values, "near")


@pytest.mark.parametrize(("in_space", "chosen"), [(True, "law"), (False, "slow")])
def test_in_space_a_law_is_tried_even_if_a_base_of_the_reserve_has_the_better_quick_fit(in_space, chosen):
    quick, near = {"law": 1.0, "other": 2.0}, {"law": 50.0, "other": 5.0, "slow": 10.0}

    def fitted(base: str, scores: dict[str, float]) -> Fitted:
        return Fitted(base, (Curve("wave"),), {}, scores[base])

    world = SimpleNamespace(
        bases=("law",),
        reserve=("slow", "other"),
        asks_reserve_first=in_space,
        fits=lambda asked: [fitted("law", quick)],
        reserve_fits=lambda of: [fitted("other", quick)],
        fit=lambda base, *_: fitted(base, near),
        errs_more=lambda *_: False,
    )
    judge = lambda fit: SimpleNamespace(total=fit.score)  # noqa: E731
    evidence = SimpleNamespace(world=world, settings=SearchSettings(), judge=judge)
    slow = fitted("slow", near)
    step = Step(Curve("wave"), (), None, 0.0, (1.0, 1.0, 1.0), slow, judge(slow), None)
    assert Bases(evidence).with_best_base(step).fitted.base == chosen


class WithReserve(Line):
    """A line that may be a bend."""

    reserve = ("bend",)

    def leaves_an_error(self, judged):
        return True

    def reserve_fits(self, fitted, refine=False):
        return [self.fit("bend", fitted.effects)]


def test_a_base_of_the_reserve_is_taken_where_it_beats_the_next_effect(monkeypatch):
    monkeypatch.setitem(SHAPES, "fast", lambda x: np.sin(40.0 * x))  # not worth a fit
    discovery = found(line(0, WithReserve, bend=3.0, wave=SIZE))
    assert discovery.base == "bend" and discovery.fitted.base == "bend"
    # the few candidates that are worth a fit are told from those that are not
    (step,) = discovery.steps
    assert step.effect.name in ("wave", "twin_of_wave") and set(step.alternatives) == {"wave", "twin_of_wave"} - {
        step.effect.name
    }


class Asking(WithReserve):
    asks_reserve_first = True

    def leaves_an_error(self, judged):
        return judged.z @ judged.z > 1.3 * len(judged.z)


def test_a_base_of_the_reserve_that_leaves_no_error_is_taken_before_any_effect_is_tried():
    for bend, first in ((3.0, "another base, bend"), (0.0, "step 1: trying 4 effects")):
        said = []
        discovery = found(line(0, Asking, bend), say=said.append)
        assert said[0] == first and discovery.steps == ()


class Together(Asking):
    """A wave that shows on one base of the reserve alone, which is of no use without it."""

    shows = "bend"

    def columns(self, effects, base="line"):
        plain = super().columns(effects, "line" if base == "line" else "bend")
        shown = [float(base == self.shows or e.name != "wave") for e in effects]
        return plain * np.array([1.0] * (plain.shape[1] - len(effects)) + shown)

    def reserve_fits(self, fitted, refine=False):
        return [self.fit(base, fitted.effects) for base in self.reserve]


class OnAnother(Together):
    """The same, where another base is as good without the wave."""

    reserve, shows = ("bend", "hinge"), "hinge"


class OnLine(Together):
    asks_reserve_first = False


@pytest.mark.parametrize(
    ("kind", "bend", "size", "expected"),
    [
        (Together, 0.0, 3.0 * SIZE, (["wave"], "bend")),
        (Together, 0.0, 0.0, ([], "line")),
        (OnAnother, 0.1, 3.0 * SIZE, (["wave"], "hinge")),
        (OnLine, 0.0, 3.0 * SIZE, ([], "line")),
    ],
)
def test_a_base_of_the_reserve_and_an_effect_that_only_help_together_are_found(monkeypatch, kind, bend, size, expected):
    monkeypatch.delitem(SHAPES, "twin_of_wave")
    monkeypatch.setitem(SHAPES, "wave", lambda x: np.sin(40.0 * x))  # a bend looks like none of it
    discovery = found(line(0, kind, bend, wave=size))
    assert ([step.effect.name for step in discovery.steps], discovery.fitted.base) == expected


def test_an_effect_that_stood_in_for_a_base_leaves_when_the_base_is_taken():
    class Late(WithReserve):
        def reserve_fits(self, fitted, refine=False):
            return super().reserve_fits(fitted) if fitted.effects and not refine else []

    said = []
    discovery = found(line(0, Late, bend=3.0), say=said.append)
    assert discovery.base == discovery.fitted.base == "bend" and discovery.steps == ()
    assert any(line.startswith("step 1: square") for line in said) and "not needed any more: square" in said


def test_an_effect_found_on_a_simpler_base_is_fitted_once_more_on_the_reserve():
    class Refined(WithReserve):
        def leaves_an_error(self, judged):
            return False

        def reserve_fits(self, fitted, refine=False):
            return super().reserve_fits(fitted) if refine else []

    # a bend that is too small to be looked for, and bends the effect
    for fixed in (None, ["wave"]):
        discovery = found(line(0, Refined, bend=0.3, wave=3.0 * SIZE), fixed=fixed)
        assert discovery.base == "line" and discovery.fitted.base == "bend"
        assert [effect.name for effect in discovery.fitted.effects] == ["wave"]


def test_a_base_of_the_reserve_that_errs_more_is_left_whatever_its_score():
    class Erring(WithReserve):
        def errs_more(self, judged, than, settings):
            return judged.total > than.total

    assert found(line(0, Erring, bend=3.0, wave=SIZE)).fitted.base == "line"


@pytest.mark.parametrize(("acts", "spoils"), [("wave", False), ("step", True), (None, True)])
def test_a_base_spoils_nothing_if_an_effect_that_acts_on_that_error_alone_is_missing(acts, spoils):
    class Waving(Line):
        """Whatever lacks the wave errs more."""

        def errs_more(self, judged, than, settings):
            return judged.total < than.total - SIZE

        def acting_on(self, judged, than, settings):
            return [self.candidates[acts]] if acts else []

    world = line(0, Waving, wave=SIZE)
    bases = Bases(Evidence(world, SearchSettings(), np.random.default_rng(1)))
    plain, waving = world.fit("line", ()), world.fit("line", (world.candidates["wave"],))
    judged, than = bases.evidence.judge(plain), bases.evidence.judge(waving)
    assert bases.spoils(plain, judged, than) == spoils
    assert not bases.spoils(waving, than, judged)


def test_a_base_of_the_reserve_that_ends_worse_is_left_again():
    class DeadEnd(WithReserve):
        """On the bend no effect enters, although it predicts better than the line with one effect."""

        def reserve_fits(self, fitted, refine=False):
            return [] if refine else super().reserve_fits(fitted)

        def is_material(self, better, worse, candidate, settings):
            return worse.base == "line" and super().is_material(better, worse, candidate, settings)

    said = []
    discovery = found(line(0, DeadEnd, bend=0.5, wave=SIZE, step=SIZE), say=said.append)
    assert "another base, bend" in said and "on line once more, with other effects" in said
    assert discovery.base == discovery.fitted.base == "line"
    assert len(discovery.steps) == 2
    # where enough effects were found on it, the base stood in for none of them; here there is none
    path, copy = Path("bend", None, None), Path("line", None, None)
    assert path.simpler_within(1) is None
    path.simpler = copy
    assert path.simpler_within(1) is copy
    path.steps = [*discovery.steps]
    assert path.simpler_within(2) is None and path.simpler_within(3) is copy


def test_after_a_return_to_a_law_the_next_effect_is_judged_beside_that_law():
    class Worse(WithReserve):
        """The reserve predicts worse than the line and leaves an error, as the line does."""

        reserve, asks_reserve_first = ("worse",), True

        def reserve_fits(self, fitted, refine=False):
            return [] if refine else [self.fit("worse", fitted.effects)]

        def columns(self, effects, base="line"):
            columns = super().columns(effects, base)
            return np.column_stack([columns[:, :1], np.abs(self.x), columns[:, 2:]]) if base == "worse" else columns

    world, said = line(0, Worse, wave=SIZE, square=0.7), []
    world.candidates = {name: world.candidates[name] for name in ("wave", "square")}
    steps = found(world, say=said.append).steps
    assert "on worse once more, with other effects" in said
    assert [step.effect.name for step in steps] == ["wave"]  # a square of this size does not matter


def test_the_path_before_a_base_of_the_reserve_ends_with_the_step_that_would_have_entered(monkeypatch):
    world, kept = line(0, WithReserve, wave=3.0 * SIZE), []

    def with_a_rival(bases, step, *_):
        rival = world.candidates["step"]
        fitted = world.fit("bend", (*step.fitted.effects[:-1], rival))
        return replace(step, effect=rival, fitted=fitted, judged=bases.evidence.judge(fitted))

    monkeypatch.setattr(Bases, "with_other_base", with_a_rival)
    monkeypatch.setattr(Path, "simpler_within", lambda path, _: kept.append(path.simpler))
    found(world, SearchSettings(max_effects=1))
    (simpler,) = kept
    assert [step.effect for step in simpler.steps] == list(simpler.fitted.effects)


def test_on_a_base_of_the_reserve_slopes_name_a_finalist_that_quick_fits_misjudge(monkeypatch):
    class FarLimit(WithReserve):
        """Quick fits on the bend take the square for the wave, and the wave for nothing."""

        def fit(self, base, effects, start=None, effort="full"):
            fit = super().fit(base, effects, start, effort)
            if base != "bend" or effort != "quick" or not effects:
                return fit
            plain, wave = (super(FarLimit, self).fit(base, curves).score for curves in ((), (Curve("wave"),)))
            return replace(fit, score=wave if effects[-1].name == "square" else plain)

    for twin in ("twin_of_wave", "step"):
        monkeypatch.delitem(SHAPES, twin)
    discovery = found(line(0, FarLimit, bend=3.0, wave=3.0 * SIZE), SearchSettings(finalists=1))
    assert discovery.base == "bend" and [step.effect.name for step in discovery.steps] == ["wave"]


@pytest.mark.parametrize("known", [True, False])
def test_on_a_base_of_the_reserve_what_slopes_and_quick_fits_misjudge_is_a_finalist(monkeypatch, known):
    class Flat(WithReserve):
        """On the bend the wave has no slope, and quick fits of it gain nothing."""

        def fit(self, base, effects, start=None, effort="full"):
            fit = super().fit(base, effects, start, effort)
            blind = base == "bend" and effort == "quick" and any(e.name == "wave" for e in effects)
            return replace(fit, score=super().fit(base, ()).score) if blind else fit

        def slopes(self, fitted, candidates):
            found = super().slopes(fitted, candidates)
            flat = {name: 0.0 * columns if name == "wave" else columns for name, columns in found.candidates.items()}
            return replace(found, candidates=flat)

        def misjudged(self, candidate):
            return known and candidate.name == "wave"

        def leaves_little(self, fitted, judged, candidate):
            return not self.misjudged(candidate)

    for twin in ("twin_of_wave", "step"):
        monkeypatch.delitem(SHAPES, twin)
    said = []
    discovery = found(line(0, Flat, bend=3.0, wave=3.0 * SIZE), SearchSettings(finalists=1), say=said.append)
    assert discovery.fitted.base == "bend" and [step.effect.name for step in discovery.steps] == ["wave"]
    # else it is only found on the line
    assert any(line.startswith("step 1: wave") for line in said) == known


def test_a_base_of_the_reserve_is_left_where_an_effect_says_the_same():
    discovery = found(line(0, WithReserve, square=3.0 * SIZE))
    assert discovery.base == "line" and [step.effect.name for step in discovery.steps] == ["square"]
    assert found(line(1, WithReserve)).base == "line"


@pytest.mark.parametrize("seed", range(3))
def test_nothing_injected_is_adequate(seed):
    discovery = found(line(seed))
    assert discovery.steps == () and discovery.verdict(is_structured=False) == "adequate"
    assert discovery.verdict(is_structured=True) == "unexplained"
    assert set(discovery.last_scan.gain) == set(SHAPES)


def test_collinear_candidates_are_not_told_apart():
    (step,) = found(line(2, wave=SIZE)).steps
    assert {step.effect.name, *step.alternatives} == {"wave", "twin_of_wave"}
    assert step.scan.cosine("wave", "twin_of_wave") == pytest.approx(1.0)
    assert step.scan.expected_loss("wave", "twin_of_wave") < 1e-6 < 3.0 < step.scan.expected_loss("wave", "square")


def test_two_effects_are_both_found_and_each_is_worth_its_gain_on_unseen_trials():
    training, unseen = halves(line(3, square=4.0 * SIZE, wave=2.0 * SIZE))
    discovery = found(training)
    names = {step.effect.name for step in discovery.steps}
    assert len(names) == 2 and "square" in names and names & {"wave", "twin_of_wave"}
    first, second = discovery.steps
    # what was an alternative when the first was found, and is needed beside it in the end, is none any more
    discovery = replace(discovery, steps=(replace(first, alternatives=(second.effect.name, "bundle")), second))
    kept, ladder, without = judge_held_out(training, unseen, discovery, SearchSettings())
    assert kept.fitted is discovery.fitted
    assert [step.alternatives for step in kept.steps] == [("bundle",), second.alternatives]
    totals = [judgement.total for _, _, judgement in ladder]
    assert len(totals) == 3 and totals == sorted(totals)
    assert set(without) == names and all(judged.total < totals[-1] for judged in without.values())


@pytest.mark.parametrize(("size", "asked"), [(4.0, 0), (0.35, 1)])
def test_k_fold_is_asked_whether_an_effect_is_needed_only_where_fits_leave_it_open(size, asked):
    world = line(3, square=4.0 * SIZE, wave=size)
    discovery = found(world, fixed=["square", "wave"])
    evidence, judged = Evidence(world, SearchSettings(), np.random.default_rng(1)), []
    world.cross_validate = lambda fitted, folds: judged.append(fitted) or Line.cross_validate(world, fitted, folds)
    square, wave = discovery.steps
    assert evidence.superfluous([square, wave], [square, wave]) == (None if size > 1.0 else "wave")
    assert [len(fitted.effects) for fitted in judged] == [1] * asked


def test_an_effect_that_is_significant_but_does_not_matter_is_told():
    discovery = found(line(4, wave=SIZE), SearchSettings(material_share=0.9))
    assert discovery.steps == () and discovery.below.effects[0].name in ("wave", "twin_of_wave")


def test_a_further_candidate_shifts_no_draw_of_another(monkeypatch):
    few, many = line(0, square=3.0 * SIZE), line(0, square=3.0 * SIZE)
    monkeypatch.setattr(few, "candidates", {name: Curve(name) for name in ("square", "wave")})
    one, other = found(few).steps[0], found(many).steps[0]
    assert one.effect == other.effect and one.gain == other.gain


class Counted(Line):
    """Each nat of the linear fit counts `times`, and so refits gain as many times what the score test predicts."""

    times = 1.0

    def fit(self, base, effects, start=None, effort="full") -> Fitted:
        fitted = super().fit(base, effects, start, effort)
        return replace(fitted, score=self.times * fitted.score)

    def drawn(self, fitted: Fitted, rng: np.random.Generator) -> "Counted":
        drawn = Counted(self.trial, self.x, self.y - self.residual(fitted) + rng.standard_normal(len(self.x)))
        drawn.times = self.times
        return drawn


@pytest.mark.parametrize(("name", "columns"), [("square", 1), ("bundle", 1 + IDLE)])
@pytest.mark.parametrize(("times", "stretch"), [(2.0, 2.0), (0.5, 1.0)])
def test_the_null_is_stretched_as_refits_gain_more_than_the_score_test_predicts(name, columns, times, stretch):
    world = line(5, Counted)
    world.times = times
    fitted, effect, rng = world.fit("line", ()), Curve(name), np.random.default_rng(0)
    evidence = Evidence(world, SearchSettings(), rng)
    found = evidence.stretch_of_null(fitted, effect, scan(world.slopes(fitted, [effect]), 99, rng), "refits")
    # a gain is half of chi² with a degree of freedom for each column, and its mean that of as many refits
    assert found == pytest.approx(stretch, rel=SIGMAS * np.sqrt(2.0 / (columns * world.refits)))


def test_the_split_keeps_two_trials_on_either_side():
    for n, share in ((4, 0.3), (4, 0.9), (16, 0.3), (10, 0.01)):
        training, held_out = split(np.arange(n), share, np.random.default_rng(0))
        assert min(len(training), len(held_out)) >= 2
        assert sorted([*training, *held_out]) == list(range(n))


def test_a_basis_leaves_out_columns_that_are_sums_of_others():
    x = np.linspace(-1.0, 1.0, 9)
    columns = np.stack([x, x**2, 2.0 * x - x**2, 0.0 * x], axis=1)
    basis = orthonormal(columns)
    assert basis.shape == (9, 2)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-12)


@dataclass(frozen=True)
class TwoErrors(Scores):
    other: float


class Spoilt(Line):
    """Some curves predict better, but another error rises with each."""

    spoil: tuple[str, ...] = ("square",)

    def judge(self, fitted: Fitted) -> TwoErrors:
        return TwoErrors(
            self.trial, self.residual(fitted), fitted.base, 1.0 + sum(e.name in self.spoil for e in fitted.effects)
        )

    def cross_validate(self, fitted: Fitted, folds: np.ndarray) -> TwoErrors:
        judged = super().cross_validate(fitted, folds)
        return TwoErrors(judged.trial, judged.z, judged.base, self.judge(fitted).other)

    def errs_more(self, judged: TwoErrors, than: TwoErrors, settings: SearchSettings) -> bool:
        return settings.matters(judged.other, than.other, 1.0)


def test_an_effect_that_spoils_another_error_does_not_enter_and_the_next_is_judged():
    world, said = line(3, Spoilt, square=4.0 * SIZE, wave=2.0 * SIZE), []
    names = {step.effect.name for step in found(world, say=said.append).steps}
    assert "square" not in names and names & {"wave", "twin_of_wave"}
    assert "square predicts better, but spoils another error" in said
    (step,) = found(world, fixed=["square"]).steps
    assert step.fails == "spoils" and not step.clears


def test_held_out_trials_reject_what_makes_an_error_larger_and_what_was_found_after_it_is_fitted_again():
    hidden = {"square": 12.0 * SIZE, "wave": 3.0 * SIZE}
    (training, _), (_, unseen) = halves(line(3, **hidden)), halves(line(3, Spoilt, **hidden))
    discovery = found(training)
    names = [step.effect.name for step in discovery.steps]
    at = names.index("square")
    kept, ladder, without = judge_held_out(training, unseen, discovery, SearchSettings())
    others = [name for name in names if name != "square"]
    assert [step.effect.name for step in kept.steps] == others == list(without) and at < len(others) == len(ladder) - 1
    assert [[e.name for e in fitted.effects] for _, fitted, _ in ladder] == [others[:i] for i in range(len(ladder))]
    assert kept.fitted is ladder[-1][1] and kept.fitted.score == training.fit(kept.base, kept.fitted.effects).score
    (rejected,) = kept.rejected
    assert rejected.step.effect.name == "square"
    assert rejected.judged.other > rejected.than.other and "square" in kept.last_scan.gain
    by_hand, ladder, _ = judge_held_out(training, unseen, discovery, SearchSettings(), by_hand=True)
    assert [step.fails for step in by_hand.steps] == ["spoils" if i == at else None for i in range(2)]
    assert len(ladder) == 3 and by_hand.rejected == ()


@pytest.mark.parametrize("forgives", [True, False])
def test_an_error_that_a_rung_raises_and_a_later_one_lowers_rejects_an_effect_where_all_rungs_count(forgives):
    class Mended(Spoilt):
        forgives_rungs = forgives

        def judge(self, fitted):
            last = len(fitted.effects) > 1  # the other effect lowers the error again
            other = 1.0 + ("square" in {effect.name for effect in fitted.effects} and not last)
            return TwoErrors(self.trial, self.residual(fitted), fitted.base, other)

    hidden = {"square": 12.0 * SIZE, "wave": 3.0 * SIZE}
    (training, _), (_, unseen) = halves(line(3, **hidden)), halves(line(3, Mended, **hidden))
    discovery = found(training)
    assert [step.effect.name for step in discovery.steps].index("square") == 0
    kept, _, _ = judge_held_out(training, unseen, discovery, SearchSettings())
    assert ("square" in {step.effect.name for step in kept.steps}) == forgives


def test_of_two_effects_that_spoil_an_error_held_out_trials_strike_the_later_first_and_each_by_itself():
    hidden = {"square": 12.0 * SIZE, "step": 6.0 * SIZE, "wave": 3.0 * SIZE}
    (training, _), (_, of_two) = halves(line(3, **hidden)), halves(line(3, Spoilt, **hidden))
    discovery = found(training)
    names = [step.effect.name for step in discovery.steps]
    assert len(names) == 3 and {"square", "step"} < set(names)
    of_two.spoil = ("square", "step")
    kept, ladder, _ = judge_held_out(training, of_two, discovery, SearchSettings())
    (stays,) = kept.steps
    assert stays.effect.name not in of_two.spoil and len(ladder) == 2
    assert [each.step.effect.name for each in kept.rejected] == [name for name in names if name in of_two.spoil]
    # the later one is judged beside the earlier one, which is judged alone
    assert [(each.judged.other, each.than.other) for each in kept.rejected] == [(2.0, 1.0), (3.0, 2.0)]


class Nested(Line):
    """The bundle may be the square at some of its parameters; quick fits of the square alone fail."""

    is_nested: bool

    def includes(self, candidate: str, other: str) -> bool:
        return self.is_nested and (candidate, other) == ("bundle", "square")

    def fit(self, base, effects, start=None, effort="full") -> Fitted:
        fitted = super().fit(base, effects, start, effort)
        lost = effort == "quick" and effects == (Curve("square"),)
        return replace(fitted, score=super().fit(base, ()).score) if lost else fitted


@pytest.mark.parametrize(("is_nested", "named"), [(True, "square"), (False, "bundle")])
def test_where_the_best_effect_includes_a_simpler_one_that_is_asked_though_it_is_no_finalist(is_nested, named):
    world = line(0, Nested, square=3.0 * SIZE)
    world.is_nested = is_nested
    world.candidates = {name: Curve(name) for name in ("square", "bundle")}
    (step,) = found(world, SearchSettings(finalists=1)).steps
    assert step.effect.name == named


def test_held_out_trials_reject_what_lowers_none_of_their_errors():
    """The square is in the training trials alone."""
    training, with_both = halves(line(3, square=4.0 * SIZE, wave=2.0 * SIZE))
    _, unseen = halves(line(3, wave=2.0 * SIZE))
    discovery = found(training)
    kept, _, without = judge_held_out(training, unseen, discovery, SearchSettings())
    (rejected,) = kept.rejected
    assert rejected.step.effect.name == "square" and "square" not in without
    by_hand, _, _ = judge_held_out(training, unseen, discovery, SearchSettings(), by_hand=True)
    assert by_hand.steps == discovery.steps
    all_of, _, _ = judge_held_out(training, with_both, discovery, SearchSettings())
    assert all_of.fitted is discovery.fitted


def test_a_search_knows_at_which_limit_it_ended():
    world = line(3, square=4.0 * SIZE, wave=2.0 * SIZE)
    assert found(world).limit is None
    assert found(world, SearchSettings(max_effects=1)).limit == 1
    assert found(world, fixed=["square"]).limit is None
    # the first finalist spoils, and the next one is asked
    world = line(3, Spoilt, square=4.0 * SIZE, step=1.5 * SIZE)
    assert found(world, SearchSettings(finalists=1)).limit is None and found(world, SearchSettings(finalists=1)).steps
    unwanted = found(line(0), SearchSettings(max_effects=0))
    assert unwanted.limit is None and unwanted.steps == ()  # nothing is left, and nothing is tried
    assert found(world, SearchSettings(max_effects=0)).steps == found(world, fixed=[]).steps == ()


def test_a_change_of_an_error_is_said_as_what_it_is():
    change = SearchSettings(material_share=0.05, material_floor=0.25).change
    assert change(0.2, 0.1, 0.1) == "falls from 0.200 to 0.100"
    assert change(0.149, 0.189, 0.1) == "rises from 0.149 to 0.189"
    assert change(0.00683, 0.006831, 0.005) == "stays at 0.00683"
    for floor in (0.1, float("nan"), None):  # with an unknown floor the share alone counts
        assert change(0.149, 0.1485, floor) == "hardly changes, from 0.149 to 0.148"


def test_an_effect_that_has_left_may_come_back_once_when_another_one_has_entered():
    path = Path("flat", None, None)
    path.entered = 1
    path.drop("square")
    assert path.barred == {"square"}
    path.entered = 2
    assert path.barred == set()
    path.drop("square")
    path.entered = 3
    assert path.barred == {"square"}
