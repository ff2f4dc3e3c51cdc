"""Test of the next experiment that the critique proposes: drops in the proposed states, compared with random drops.

A question consists of `FIRST` random drops with a hidden cause that two effects can explain: the effect that describes
it (A) and another one (B).  Each gains at least `EXPLAINS` nats over the law, and their log scores differ by less than
`TELLS` nats.  Further drops, either random like the first or in the states that the critique proposes, are added one
after the other.  The question is settled by n further drops if, with both models refitted to all drops,

    log score of A − log score of B ≥ TELLS,     and settled wrongly if it is ≤ −TELLS

The numbers n are those of `STEPS`, about √2 apart.  If no number settles the question, or one settles it wrongly, the
last number counts.  Seeds below `SEEDS` were for tuning and are not in the table.

Drops are integrated in continuous time (source mechanism) and recorded like the published impacts: one impact per
drop, with noisy velocities before and after.  Releases are those of chapter 3's rig.  No launcher sets a state exactly:
the released states scatter about the proposed ones (`SCATTER`).

config/proof/next_experiment.csv has a row per question, in the order of the plan:

| column                     | unit | meaning                                                                          |
|----------------------------|------|----------------------------------------------------------------------------------|
| cause, size, seed          |      | `Question`                                                                       |
| effect, rival              |      | A and B; rival "" if 50 drops leave no question; the rest is then empty          |
| apart                      | nats | log score of A minus that of B, with the first drops                             |
| sigmas                     | 1    | the largest difference that the proposal predicts, in standard deviations; empty |
|                            |      | if it proposes nothing                                                           |
| random, chosen             | 1    | drops that settle the question; empty if nothing is proposed                     |
| wrong_random, wrong_chosen |      | 1 if they settle it wrongly, else 0                                              |
| code, made                 |      | as in `store`                                                                    |

Causes whose two effects predict the same for every impact (a moving surface, a drifting camera) are left out: the
critique proposes no release for them (tested by `test_no_release_is_proposed_where_none_would_tell`).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, Rows, as_cell
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import CAUSES, ELLIPSE_BODY, SQUARE, CompliantContact, HiddenCauses
from thesis_lib.simulate.rig.release import Release, Spread
from thesis_lib.statistics.intervals import wilson
from thesis_lib.studies.proof.cases import CORNERED, SEEDS
from thesis_lib.studies.proof.store import COMMAND, STORE, stamped, value_of

QUESTIONS = 20
FIRST = 50
EXPLAINS, TELLS = 3.0, 3.0  # nats; TELLS is `tell_apart` of the critique's settings
STEPS = (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128, 181, 256, 362)
SIZES = (0.25, 0.35, 0.5)  # factors on the sizes in the proof; with larger ones, 50 drops leave no question
SCATTER = (0.05, 0.05, 0.5, 0.05, 0.005)  # m/s, m/s, rad/s, rad, m: one sigma of a launcher
NOISE = Noise(position=3e-4, angle=3e-3, velocity=0.02, angular_velocity=0.5)
RELEASE = Release()
CONTACT = CompliantContact(contact_time=2e-5)
HALF = 0.5  # largest ratio of chosen to random drops that counts as halved
KEY = ("cause", "size", "seed")
MEASURED = ("size", "apart", "sigmas", "random", "chosen")
COLUMNS = (*KEY, "effect", "rival", *MEASURED[1:], "wrong_random", "wrong_chosen", *STAMP)
LOWEST = 0.08  # m; no release below it
GRAVITY = 9.81  # m/s²
# causes that impacts reveal; without wear, which depends on no state and starts anew in each simulated series
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


class Launcher:
    """Releases that lead to the given states just before the first impact, taken in turn, with random `SCATTER`."""

    def __init__(self, states: Sequence[Mapping[str, float]], body: Body) -> None:
        self.states = np.array([[state.get(name, np.nan) for name in PLACED] for state in states])
        self.body = body
        self.height = Spread(low=LOWEST, high=10.0)

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Poses (n, 3) and velocities (n, 3) of releases from rest in y."""
        wanted = self.states[np.arange(n) % len(self.states)] + SCATTER * rng.standard_normal((n, 5))
        vx, vy, omega, theta, x = wanted.T
        fall = -vy / GRAVITY
        height = 0.5 * GRAVITY * fall**2 - self.body.shape.contact_point(theta)[:, 1]
        start = np.where(np.isnan(x), 0.0, x - vx * fall)  # x = 0 like random releases, unless a place is proposed
        pose = np.stack([start, np.maximum(height, LOWEST), theta - omega * fall], axis=1)
        return pose, np.stack([vx, np.zeros(n), omega], axis=1)


def plan() -> list[Question]:
    """All questions in the order in which they are asked, by increasing seed; kinds of causes are mixed."""
    return [Question(cause, size, seed) for seed in range(SEEDS, SEEDS + 20) for size in SIZES for cause in ASKED]


def ask(question: Question) -> dict[str, object]:
    """Simulate the drops, and if they leave a question, count the drops that settle it; return a row of the table."""
    cause = CAUSES[question.cause]
    body = SQUARE if question.cause in CORNERED else ELLIPSE_BODY
    hidden = HiddenCauses.model_validate({question.cause: question.size * cause.size})
    rng = generator(question.seed, "next experiment", question.cause, f"{question.size:g}")
    first_rng, critique_rng, proposal_rng, more_rng = rng.spawn(4)
    first = _drops(body, RELEASE, FIRST, hidden, first_rng)
    true = cause.effects[0]
    critique = criticise_drops(first, rng=critique_rng, effects=[true])
    row: dict[str, object] = {**vars(question), "effect": true, "rival": "", "wrong_random": 0, "wrong_chosen": 0}
    pair = _rival(critique, true, cause.effects)
    if pair is None:
        return row
    rival, apart = pair
    row |= {"rival": rival, "apart": apart}
    final = critique.ladder[-1][1]
    proposed = tell_apart(critique, final, EFFECTS[true], EFFECTS[rival], proposal_rng)
    if not proposed["states"]:
        return row
    models = [replace(final.model, effects=(EFFECTS[name],)) for name in (true, rival)]
    launcher = Launcher(proposed["states"], body)
    row["sigmas"] = proposed["sigmas"][0]
    for way, release, stream in zip(("random", "chosen"), (RELEASE, launcher), more_rng.spawn(2)):
        row[way], right = _settled(first, _drops(body, release, STEPS[-1], hidden, stream), models, final)
        row[f"wrong_{way}"] = int(not right)
    return row


def _drops(body: Body, release: Release | Launcher, n: int, hidden: HiddenCauses, rng: np.random.Generator) -> Dataset:
    """The first impacts of n simulated drops, with measurement noise."""
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
    """The wrong effect with the best log score, and its deficit to the true one in nats; None without a question."""
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
    """Number of further drops that settle the question, and False if they decide for the second (wrong) model."""
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
    """Fitted values of both models, started from `values`, and the difference of their log scores in nats."""
    own = [{k: v for k, v in start.items() if k in model.parameters} for model, start in zip(models, values)]
    one, other = (fit(model, observations, start) for model, start in zip(models, own))
    return [one.values, other.values], one.score - other.score


def run(wanted: int, tell: Callable[[str], object], store: Path = STORE) -> None:
    """Ask questions in the order of the plan until `wanted` are open; stored answers count, new ones are stored."""
    answers = read_answers(store)
    known, n_open = {Question(*key) for key in answers[list(KEY)].itertuples(index=False)}, int(answers["open"].sum())
    for question in plan():
        if n_open >= wanted:
            break
        if question not in known:
            row = ask(question)
            table_of(store).put(stamped(row, ask))
            n_open += "chosen" in row
            said = f"{row['effect']} or {row['rival']}: random {row.get('random')}, chosen {row.get('chosen')}"
            tell(f"{question.cause} {question.size:g} {question.seed}: {said if row['rival'] else 'no question'}")


def table_of(store: Path = STORE) -> Rows:
    """The table of the answers, in the order of the plan."""
    place = {tuple(map(as_cell, vars(question).values())): i for i, question in enumerate(plan())}

    def order(row: dict[str, str]) -> int:
        return place[tuple(row[name] for name in KEY)]

    return Rows(Path(store) / "next_experiment.csv", COLUMNS, KEY, f"{COMMAND} next", digits=6, order=order)


def read_answers(store: Path = STORE) -> pd.DataFrame:
    """The stored answers in order; a question is `open` if 50 drops do not answer it and a release is proposed.

    CorruptFileError if a row is unreadable.
    """
    table = pd.DataFrame(table_of(store).parsed(_answer), columns=[*COLUMNS, "open"])
    return table.astype({"open": bool})


def _answer(cells: dict[str, str]) -> dict[str, object]:
    if cells["cause"] not in CAUSES or not {cells["effect"], cells["rival"]} <= {*EFFECTS, ""}:
        raise ValueError(f"{cells['cause']}, {cells['effect']}, {cells['rival']}: unknown cause or effect")
    numbers = {name: value_of(cells[name]) for name in MEASURED}
    counts = {name: int(cells[name]) for name in ("seed", "wrong_random", "wrong_chosen")}
    return {**cells, **numbers, **counts, "open": bool(cells["rival"]) and not math.isnan(numbers["chosen"])}


def as_markdown(answers: pd.DataFrame | None = None) -> str:
    """Summary of the stored questions, with a table of the open ones; ValueError if none is open."""
    answers = read_answers() if answers is None else answers
    opened = answers[answers["open"]]
    if not len(opened):
        raise ValueError("no question is open")
    ratio, n = opened["chosen"] / opened["random"], len(opened)
    halved = int((ratio <= HALF).sum())
    low, high = wilson(halved, n)
    random, chosen = (opened[way].sum() for way in ("random", "chosen"))
    wrong = [answers[f"wrong_{way}"].sum() for way in ("random", "chosen")]
    words = (
        f"Of {len(answers)} datasets of {FIRST} random drops, {n} cannot distinguish two effects. "
        f"{halved} of these {n} questions ({100 * halved / n:.0f} %, 95 %: {100 * low:.0f} to "
        f"{100 * high:.0f} %) are settled with at most half as many chosen drops as random ones. The median question "
        f"takes {ratio.median():.2g} times as many; all together take {chosen:.0f} instead of {random:.0f}, where a "
        f"question settled wrongly (random: {wrong[0]}, chosen: {wrong[1]}) counts as {STEPS[-1]}. More chosen than "
        f"random drops are needed in {(opened['chosen'] > opened['random']).sum()}."
    )
    head = ("hidden", "of its size in the proof", "seed", "which effect?", "apart, nats")
    lines = []
    for row in opened.sort_values(["random", "chosen"], ascending=[False, True], kind="stable").to_dict("records"):
        counts = [
            "wrongly settled" if row[f"wrong_{way}"] else f"{row[way]:.0f}{' or more' if row[way] >= STEPS[-1] else ''}"
            for way in ("random", "chosen")
        ]
        which = f"{row['effect']}, {row['rival']}"
        lines.append((row["cause"], f"{row['size']:g}", f"{row['seed']}", which, f"{row['apart']:.1f}", *counts))
    return f"{words}\n\n{table((*head, 'random drops', 'chosen drops'), lines)}"
