"""The proof of proposals: drops with a hidden law that no effect describes, and drops with nothing hidden.

A dataset is 150 drops of the ellipse with contacts of 1 ms, integrated under forces without any impact law or proposed
term (`thesis_lib/simulate/compliant/hidden_laws.py`).  It is analysed by the critique and, if the verdict is
`unexplained`, by the search for a term.  If nothing is hidden, a term is searched for with any verdict.  The questions:

    variable   the first term acts on the same quantity, by variables of the same kind
    sign       and in the same direction, on random contacts of the ellipse
    form       and it is exactly the hidden term
    enough     the held-out error is at most `ENOUGH` times the noise floor
    best       it is at most `NEAR` times the error of the energetic law with the hidden term itself, added by hand
    typical    the median held-out error is at most `ENOUGH` times that of noise (few slow impacts dominate the mean)
    none       with nothing hidden, no term is proposed

config/proof/proposals.csv holds a row per dataset:

| column                    | unit | meaning                                                               |
|---------------------------|------|-----------------------------------------------------------------------|
| truth, seed               |      | the dataset                                                           |
| verdict, named            |      | of the critique; effects joined by +                                  |
| proposed, law             |      | terms joined by +, "" if none; the law with them                      |
| alternatives              |      | terms indistinguishable from the first, joined by +                   |
| a, a_std                  | 1    | of the first term                                                     |
| before, after, floor      | m/s  | held-out error of the critique's model, with the proposal; noise      |
| attainable                | m/s  | held-out error of the energetic law with the hidden term itself       |
| excess                    | 1    | median held-out error over that of noise alone, with the proposal     |
| seconds                   | s    | of CPU for the proposal                                               |
| code, made                |      | hash of the code that made the row, empty: unknown; date              |
"""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.proposal.effect_file import effect_of, phi
from thesis_lib.critique.proposal.propose import ENERGETIC, propose
from thesis_lib.critique.proposal.terms import TARGETS, Term, all_terms
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import Rows
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.compliant.hidden_laws import HIDDEN_LAWS, hiding
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, CompliantContact
from thesis_lib.statistics.wording import count
from thesis_lib.studies.proof.store import NOTHING, stored, with_effects

SEEDS = 1000  # first seed of the table; seeds below served to choose sizes and terms
DROPS = 150
MU, EPSILON, CONTACT_TIME = 0.15, 0.55, 1e-3
ENOUGH, NEAR = 1.5, 1.1
CONTACTS = 2000  # random contacts on which the signs of two terms are compared
FOUND = (
    *("verdict", "named", "proposed", "law", "alternatives"),
    *("a", "a_std", "before", "after", "floor", "attainable", "excess", "seconds"),
)
ROWS = stored("proposals", ("truth", "seed"), FOUND, "proposals run", digits=4)
# the term that equals each hidden law, or acts on the same variable
OWN = {
    "restitution_by_obliquity": "restitution_by_obliquity",
    "restitution_by_spin": "restitution_by_spin",
    "restitution_by_fourth_harmonic": "restitution_by_quarters",
    "friction_by_place_on_body": "friction_by_ends_and_sides",
    "friction_by_release": "friction_by_release",
    "friction_by_spin": "friction_by_spin",
    "couple_by_spin": "couple_by_turning",
    "direction_by_lever": "sideways_impulse_by_lever",
    "restitution_by_threshold": "restitution_by_obliquity",
    "friction_by_root_of_spin": "friction_by_spin",
}
FORMLESS = ("restitution_by_threshold", "friction_by_root_of_spin")  # no term equals them; their terms approximate


@dataclass(frozen=True)
class ProposalCase:
    """One dataset: a law of `HIDDEN_LAWS`, or nothing."""

    truth: str
    seed: int


def cases(seeds: int = 3, nothing: int = 20, first: int = SEEDS) -> list[ProposalCase]:
    """`seeds` datasets of each hidden law, mixed evenly with `nothing` datasets in which no law is hidden."""
    hidden = [ProposalCase(truth, first + i) for i in range(seeds) for truth in HIDDEN_LAWS]
    plain = [ProposalCase(NOTHING, first + i) for i in range(nothing)]
    total = len(hidden) + len(plain)
    places = {round((i + 0.5) * total / len(plain)) for i in range(len(plain))} if plain else set()
    one, other = iter(hidden), iter(plain)
    mixed = [next(other if i in places else one, None) for i in range(total + 1)]
    return [*filter(None, mixed), *one, *other]


def make(case: ProposalCase, drops: int = DROPS) -> Dataset:
    """Simulate the drops of a case as a rig would record them."""
    made = simulate_compliant_drops(
        ELLIPSE_BODY,
        PROOF_RELEASE,
        drops,
        contact=CompliantContact(mu=MU, epsilon=EPSILON, contact_time=CONTACT_TIME),
        noise=RIG_NOISE,
        rng=generator(case.seed, "proposal proof", case.truth),
        engine=None if case.truth == NOTHING else hiding(case.truth),
    )
    return Dataset("proof", made.header, made.trajectories)


def compute(case: ProposalCase, drops: int = DROPS) -> dict[str, object]:
    """Criticise the dataset of a case and search for terms; return a row of the table."""
    judged = criticise_drops(make(case, drops), rng=generator(case.seed, "proposal proof critique", case.truth))
    row: dict[str, object] = {**dict.fromkeys(FOUND, ""), **vars(case)}
    row |= {"verdict": judged.verdict, "named": with_effects(judged)}
    last, found, began = judged.ladder[-1][2], None, time.process_time()
    if case.truth == NOTHING or (judged.verdict == "unexplained" and judged.is_structured):
        found = propose(judged, generator(case.seed, "proposal proof search", case.truth))
    numbers = {
        "before": float(last.error.mean()),
        "floor": last.floor,
        "excess": last.excess,
        "seconds": time.process_time() - began,
    }
    if case.truth != NOTHING:
        numbers["attainable"] = attainable(judged, case.truth)
    if found is not None:
        first, after = found.terms[0], found.after
        row["proposed"] = "+".join(one.term.name for one in found.terms)
        row |= {"law": found.fitted.base, "alternatives": "+".join(first.step.alternatives)}
        a = f"{first.term.name}.a"
        numbers |= {"a": found.fitted.values[a], "a_std": found.fitted.std[a]}
        numbers |= {"after": float(after.error.mean()), "floor": after.floor, "excess": after.excess}
    return row | numbers


def attainable(judged: DropsCritique, truth: str) -> float:
    """Held-out error in m/s of the energetic law with the hidden term, on which hardly any other term could improve.

    Few slow impacts, whose velocities are measured least precisely, dominate it.
    """

    hidden = next(term for term in all_terms() if term.name == OWN[truth])
    world = Drops(judged.training, judged.settings)
    fitted = world.fit(ENERGETIC, (effect_of(hidden),), effort="near")
    return float(Drops(judged.held_out).judge(fitted).error.mean())


def told(row: Mapping[str, Any]) -> str:
    """A row in words."""
    where = f"{row['before']:.4g} -> {row.get('after') or math.nan:.4g} m/s, floor {row['floor']:.4g}"
    return f"{row['verdict']}, {row['proposed'] or 'no term'} ({where})"


# --- what is right ---


def right(row: Mapping[Any, Any]) -> dict[str, bool]:
    """Answers to the questions of the module's docstring for a row with a hidden law."""
    terms = {term.name: term for term in all_terms()}
    hidden, first = terms[OWN[row["truth"]]], terms.get(str(row["proposed"]).partition("+")[0])
    after = row["after"] if first else row["before"]
    answers: dict[str, bool] = dict.fromkeys(("proposed", "variable", "sign", "form"), False)
    answers["enough"] = bool(float(after) <= ENOUGH * float(row["floor"]))
    answers["best"] = bool(float(after) <= NEAR * float(row["attainable"]))
    answers["typical"] = bool(float(row["excess"]) <= ENOUGH)
    if first is None:
        return answers
    kinds = [{factor.group for factor in term.factors} for term in (hidden, first)]
    variable = hidden.target == first.target and kinds[0] == kinds[1]
    wanted, got = HIDDEN_LAWS[row["truth"]].size * phi_of(hidden), float(row["a"]) * phi_of(first)
    along = bool(np.corrcoef(wanted, got)[0, 1] > 0.0)
    form = first is hidden and along and row["truth"] not in FORMLESS
    return answers | {"proposed": True, "variable": variable, "sign": variable and along, "form": form}


def phi_of(term: Term) -> np.ndarray:
    """Values (n,) of a term's φ on random contacts of the proof's ellipse."""
    rng = np.random.default_rng(0)
    theta, omega = rng.uniform(-np.pi, np.pi, CONTACTS), rng.uniform(-15.0, 15.0, CONTACTS)
    r_x, r_y = ELLIPSE_BODY.shape.contact_point(theta).T
    v_t, v_n = rng.uniform(-1.5, 1.5, CONTACTS), -rng.uniform(0.8, 3.3, CONTACTS)
    values = {"v_t": v_t, "v_n": v_n, "v": np.hypot(v_t, v_n), "omega": omega, "k": ELLIPSE_BODY.radius_of_gyration}
    values |= {"r_x": r_x, "beta": np.arctan2(r_y, r_x) - theta, "x": rng.uniform(-0.3, 0.3, CONTACTS)}
    return phi(term, values | {"trial": (np.arange(CONTACTS) / CONTACTS - 0.5) * DROPS})


def as_markdown(store: Rows = ROWS) -> str:
    """Counts by hidden law as a Markdown table, totals with 95 % intervals, and the result with nothing hidden.

    UserError if no rows are stored.
    """
    rows = store.table()
    asked = ("proposed", "variable", "sign", "form", "enough", "best", "typical")
    head = ("hidden", "changes", "proposed", "right variable", "and sign", "very form", "mean", "attainable", "median")
    hidden, plain = rows[rows["truth"] != NOTHING], rows[rows["truth"] == NOTHING]
    lines, total = [], dict.fromkeys(asked, 0)
    for truth, part in hidden.groupby("truth", sort=False):
        answers = [right(row) for row in part.to_dict("records")]
        counts = {name: sum(answer[name] for answer in answers) for name in asked}
        total = {name: total[name] + counts[name] for name in asked}
        what = TARGETS[HIDDEN_LAWS[str(truth)].acts_on]
        lines.append((str(truth).replace("_", " "), what, *(f"{counts[name]} of {len(part)}" for name in asked)))
    if len(hidden):
        lines.append(("all", "", *(count(total[name], len(hidden)) for name in asked)))
    text = table(head, lines)
    if len(plain):
        none = count((plain["proposed"] == "").sum(), len(plain))
        text += f"\n\nWith nothing hidden, no term is proposed in {none} datasets."
    return text
