"""How many drops the proposed states save: shares over the stored questions, in Markdown."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thesis_lib.critique.proof.next_drops import FIRST, STEPS, Answer, read_answers
from thesis_lib.foundation.markdown import table
from thesis_lib.statistics.intervals import wilson

ASKED = 0.5  # chosen drops over random ones, at most


class Saved(NamedTuple):
    """Of n open questions: how many need at most half as many drops, sums of drops, median ratio, all looked at."""

    n: int
    halved: int
    random: float
    chosen: float
    median: float
    looked_at: int


def saved(answers: Sequence[Answer]) -> Saved:
    """Shares over the open questions among `answers`; ValueError if there is none."""
    opened = [answer for answer in answers if answer.is_open]
    if not opened:
        raise ValueError("no question is open")
    ratio = np.array([answer.chosen / answer.random for answer in opened])
    by_chance, chosen = (float(sum(getattr(answer, name) for answer in opened)) for name in ("random", "chosen"))
    return Saved(len(opened), int(np.sum(ratio <= ASKED)), by_chance, chosen, float(np.median(ratio)), len(answers))


def as_markdown(answers: Sequence[Answer] | None = None) -> str:
    """What the stored questions show, and a table of them."""
    answers = list(read_answers().values()) if answers is None else answers
    of = saved(answers)
    low, high = wilson(of.halved, of.n)
    wrong = [sum(getattr(a, name) for a in answers) for name in ("wrong_random", "wrong_chosen")]
    words = (
        f"Of {of.looked_at} datasets of {FIRST} random drops {of.n} leave two effects that they cannot tell. "
        f"{of.halved} of these {of.n} questions ({100 * of.halved / of.n:.0f} %, 95 %: {100 * low:.0f} to "
        f"{100 * high:.0f} %) are settled with at most half as many chosen drops as random ones. The median question "
        f"takes {of.median:.2g} times as many; all together take {of.chosen:.0f} instead of {of.random:.0f}, where one "
        f"that is settled wrongly (random: {wrong[0]}, chosen: {wrong[1]}) counts as {STEPS[-1]}. Chosen drops take "
        f"more than random ones in {sum(a.chosen > a.random for a in answers if a.is_open)}."
    )
    head = (
        "hidden",
        "of its size in the proof",
        "seed",
        "which effect?",
        "apart, nats",
        "random drops",
        "chosen drops",
    )
    lines = []
    for answer in sorted((a for a in answers if a.is_open), key=lambda a: (-a.random, a.chosen)):
        q, counts = answer.question, []
        for n, wrong in ((answer.random, answer.wrong_random), (answer.chosen, answer.wrong_chosen)):
            counts.append("wrongly settled" if wrong else f"{n:.0f}{' or more' if n >= STEPS[-1] else ''}")
        which = f"{answer.effect}, {answer.rival}"
        lines.append((q.cause, f"{q.size:g}", f"{q.seed}", which, f"{answer.apart:.1f}", *counts))
    return f"{words}\n\n{table(head, lines)}"
