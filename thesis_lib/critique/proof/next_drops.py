"""Is the next experiment that the critique proposes worth it?  Drops in the states proposed, against random ones.

A question: `FIRST` random drops have a hidden cause, and two effects explain it, the one that describes it (A) and
another (B), each by at least `EXPLAINS` nats beyond the law, and with log scores less than `TELLS` nats apart.  Further
drops, random as the first ones or in the states that the critique proposes, are added one after the other.  The
question is settled with n more when, both models refitted to all drops,

    log score of A − log score of B ≥ TELLS,     and wrongly when it is ≤ −TELLS

The numbers n are those of `STEPS`, about √2 apart; drops that have not settled it with the last one, or settled it
wrongly, count as that many.  Seeds below `SEEDS` were for tuning; the table has none of them.

Drops are integrated in continuous time (source mechanism) and recorded as the published impacts are: one impact a
drop, velocities before and after with noise.  Releases are those of chapter 3's rig.  Nobody sets a state exactly: a
proposed one is met with `SCATTER`.

Causes whose two effects differ in no impact at all (a moving surface, a drifting camera) are no such question: there
the critique proposes no release, which `test_no_release_is_proposed_where_none_would_tell` holds.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.questions.next_experiment import PLACED, tell_apart
from thesis_lib.critique.drops.world import testable_effects
from thesis_lib.critique.likelihood.fit import Fit, fit
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.proof.cases import CORNERED, SEEDS
from thesis_lib.critique.proof.store import STORE
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import Rows, as_cell, stamp
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import CAUSES, ELLIPSE_BODY, SQUARE, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.release import Release, Spread

QUESTIONS = 20
FIRST = 50
EXPLAINS, TELLS = 3.0, 3.0  # nats; TELLS is `tell_apart` of the critique's settings
STEPS = (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256, 362)
SIZES = (0.25, 0.35, 0.5)  # of the proof's sizes: with more, 50 drops leave no question
SCATTER = (0.05, 0.05, 0.5, 0.05, 0.005)  # m/s, m/s, rad/s, rad, m: one sigma of a launcher
NOISE = Noise(position=3e-4, angle=3e-3, velocity=0.02, angular_velocity=0.5)
RELEASE = Release()
CONTACT = CompliantContact(contact_time=2e-5)
LOWEST = 0.08  # m; no release below it
# what impacts show; not wear, which no choice of states tells, and which begins again with each simulated series
ASKED = (
    *("tangential_compliance", "hunt_crossley", "stribeck", "friction_anisotropy", "rolling_lever"),
    *("adhesion_energy", "orientation_restitution", "corner_radius", "com_offset_x", "com_offset_y"),
    *("size_error", "inertia_error", "friction_slope", "restitution_slope", "angle_offset", "time_lag"),
)


@dataclass(frozen=True)
class Question:
    """One dataset: a hidden cause, the factor on its size in the proof, and a seed."""

    cause: str
    size: float
    seed: int


@dataclass(frozen=True)
class Answer:
    """What became of a question; `rival` is "" where 50 drops leave none, and the rest is then empty.

    Attributes:
        effect, rival: A and B.
        apart: log score of A less that of B, with the first drops, nats.
        sigmas: the largest difference that the proposal tells of, in standard deviations; NaN if it proposes nothing.
        random, chosen: drops that settle it; NaN if nothing is proposed.
        wrong_random, wrong_chosen: 1 if they settle it wrongly, else 0.
        code, made: of the code that asked the question, and the date, as `foundation.rows.STAMP`.
    """

    question: Question
    effect: str = ""
    rival: str = ""
    apart: float = math.nan
    sigmas: float = math.nan
    random: float = math.nan
    chosen: float = math.nan
    wrong_random: int = 0
    wrong_chosen: int = 0
    code: str = ""
    made: str = ""

    @property
    def is_open(self) -> bool:
        """Whether 50 drops leave the question open, and a release is proposed that would tell."""
        return bool(self.rival) and not math.isnan(self.chosen)


class Launcher:
    """Releases that meet given states before the first impact, in turn, with `SCATTER`."""

    def __init__(self, states: Sequence[Mapping[str, float]], body: Body, gravity: float = 9.81) -> None:
        self.states = np.array([[state.get(name, np.nan) for name in PLACED] for state in states])
        self.body, self.gravity = body, gravity
        self.height = Spread(low=LOWEST, high=10.0)

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Poses (n, 3) and velocities (n, 3) of releases from rest in y."""
        wanted = self.states[np.arange(n) % len(self.states)] + SCATTER * rng.standard_normal((n, 5))
        vx, vy, omega, theta, x = wanted.T
        fall = -vy / self.gravity
        height = 0.5 * self.gravity * fall**2 - self.body.shape.contact_point(theta)[:, 1]
        start = np.where(np.isnan(x), 0.0, x - vx * fall)  # as the random ones, unless the place is asked for
        pose = np.stack([start, np.maximum(height, LOWEST), theta - omega * fall], axis=1)
        return pose, np.stack([vx, np.zeros(n), omega], axis=1)


def plan() -> list[Question]:
    """All questions in their order, for ever further seeds; kinds of causes are mixed."""
    return [Question(cause, size, seed) for seed in range(SEEDS, SEEDS + 20) for size in SIZES for cause in ASKED]


def ask(question: Question) -> Answer:
    """Make the drops, look whether they leave a question, and count the drops that settle it."""
    cause = CAUSES[question.cause]
    body = SQUARE if question.cause in CORNERED else ELLIPSE_BODY
    hidden = HiddenCauses.model_validate({question.cause: question.size * cause.size})
    rng = generator(question.seed, "next experiment", question.cause, f"{question.size:g}")
    first_rng, critique_rng, proposal_rng, more_rng = rng.spawn(4)
    first = _drops(body, RELEASE, FIRST, hidden, first_rng)
    true = cause.effects[0]
    critique = criticise_drops(first, rng=critique_rng, effects=[true])
    pair = _rival(critique, true, cause.effects)
    if pair is None:
        return Answer(question, true)
    rival, apart = pair
    final = critique.ladder[-1][1]
    proposed = tell_apart(critique, final, EFFECTS[true], EFFECTS[rival], proposal_rng)
    if not proposed["states"]:
        return Answer(question, true, rival, apart)
    models = [replace(final.model, effects=(EFFECTS[name],)) for name in (true, rival)]
    launcher = Launcher(proposed["states"], body)
    (random, random_right), (chosen, chosen_right) = (
        _settled(first, _drops(body, release, STEPS[-1], hidden, stream), models, final)
        for release, stream in zip((RELEASE, launcher), more_rng.spawn(2))
    )
    told = proposed["sigmas"][0]
    return Answer(question, true, rival, apart, told, random, chosen, int(not random_right), int(not chosen_right))


def _drops(body: Body, release: Release | Launcher, n: int, hidden: HiddenCauses, rng: np.random.Generator) -> Dataset:
    """The first impacts of n drops, as they are measured."""
    drops_rng, noise_rng = rng.spawn(2)
    made = simulate_compliant_drops(
        body,
        release,  # pyright: ignore[reportArgumentType]
        n,
        contact=CONTACT,
        hidden=hidden,
        duration=0.8,
        rate=50.0,
        rng=drops_rng,
    )
    table = made.impacts[made.impacts["impact"] == 0].reset_index(drop=True)
    table = table[["trial", "impact", *POSE, *V_PRE, *V_POST]].copy()
    speeds = [NOISE.velocity, NOISE.velocity, NOISE.angular_velocity]
    sigma = np.array([NOISE.position, NOISE.position, NOISE.angle, *speeds, *speeds], float)
    table[[*POSE, *V_PRE, *V_POST]] += sigma * noise_rng.standard_normal((len(table), 9))
    return Dataset("drops", made.header.model_copy(update={"noise": NOISE, "rate": None}), None, table)


def _rival(critique: DropsCritique, true: str, describes: Sequence[str]) -> tuple[str, float] | None:
    """The effect that comes nearest to the true one, and by how many nats it falls short; None if that is told."""
    final = critique.ladder[-1][1]
    law = replace(final.model, effects=())
    observations = critique.observations
    plain = fit(law, observations)

    def score(name: str) -> float:
        return fit(law.with_effect(EFFECTS[name]), observations, plain.values).score

    names = [n for n in testable_effects(observations, law.takes_time)[0] if "impact" in EFFECTS[n].channels]
    best = score(true)
    if best - plain.score < EXPLAINS:
        return None
    others = {name: score(name) for name in names if name not in describes}
    rival = max(others, key=lambda name: others[name])
    is_open = abs(best - others[rival]) < TELLS and others[rival] - plain.score >= EXPLAINS
    return (rival, best - others[rival]) if is_open else None


def _settled(first: Dataset, more: Dataset, models: Sequence[Model], start: Fit) -> tuple[float, bool]:
    """How many more drops settle the question; and False if they settle it for the second model."""
    assert first.impacts is not None and more.impacts is not None
    later = more.impacts.assign(trial=more.impacts["trial"] + FIRST)
    all_of = observe(Dataset("drops", first.header, None, pd.concat([first.impacts, later], ignore_index=True)))
    values = [start.values, start.values]
    for n in STEPS:
        values, apart = _apart(all_of.select(np.arange(FIRST + n)), models, values)
        if apart >= TELLS:
            return float(n), True
        if apart <= -TELLS:
            return float(STEPS[-1]), False
    return float(STEPS[-1]), True


def _apart(observations: Observations, models: Sequence[Model], values: Sequence[Mapping]) -> tuple[list, float]:
    """Values of both models, fitted from those given, and the difference of their log scores in nats."""
    own = [{k: v for k, v in start.items() if k in model.parameters} for model, start in zip(models, values)]
    one, other = (fit(model, observations, start) for model, start in zip(models, own))
    return [one.values, other.values], one.score - other.score


def run(wanted: int, tell: Callable[[str], object], store: Path = STORE) -> list[Answer]:
    """Ask in the order of the plan until `wanted` questions are open; stored answers are kept, new ones stored."""
    answers = read_answers(store)
    for question in plan():
        if sum(answer.is_open for answer in answers.values()) >= wanted:
            break
        if question not in answers:
            answers[question] = answer = replace(ask(question), **stamp(__file__))
            table_of(store).put(cells_of(answer))
            said = f"{answer.effect} or {answer.rival}: random {answer.random:g}, chosen {answer.chosen:g}"
            tell(f"{question.cause} {question.size:g} {question.seed}: {said if answer.rival else 'no question'}")
    return list(answers.values())


KEY = tuple(f.name for f in fields(Question))
COLUMNS = (*KEY, *(f.name for f in fields(Answer)[1:]))


def table_of(store: Path = STORE) -> Rows:
    """The table of the answers, in the order of the plan."""
    place = {as_key(question): i for i, question in enumerate(plan())}
    path, command = Path(store) / "next_experiment.csv", "python -m thesis_lib.critique.proof next"
    return Rows(path, COLUMNS, KEY, command, digits=6, order=lambda row: place[tuple(row[name] for name in KEY)])


def as_key(question: Question) -> tuple[str, ...]:
    """The cells of a question."""
    return tuple(map(as_cell, astuple(question)))


def read_answers(store: Path = STORE) -> dict[Question, Answer]:
    """The stored answers, in order; empty if there is no table.  CorruptFileError if a row is unreadable."""
    answers = table_of(store).parsed(lambda cells: _answer(*cells.values()))
    return {answer.question: answer for answer in answers}


def _answer(cause: str, size: str, seed: str, effect: str, rival: str, *cells: str) -> Answer:
    *numbers, wrong_random, wrong_chosen, code, made = cells
    if cause not in CAUSES or effect not in EFFECTS or (rival and rival not in EFFECTS):
        raise ValueError(f"{cause}, {effect}, {rival}: no answer")
    apart, sigmas, by_chance, chosen = (float(x) if x else math.nan for x in numbers)
    question = Question(cause, float(size), int(seed))
    wrong = int(wrong_random), int(wrong_chosen)
    return Answer(question, effect, rival, apart, sigmas, by_chance, chosen, *wrong, code, made)


def cells_of(answer: Answer) -> dict[str, object]:
    """The answer as it is stored."""
    return dict(zip(COLUMNS, (*astuple(answer.question), *astuple(answer)[1:])))
