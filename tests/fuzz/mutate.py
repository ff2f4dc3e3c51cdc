"""Mutation fuzzing of everything that reads a file.

    python -m tests.fuzz.mutate --inputs 10000 --seed 0 [--reader NAME] [--jobs N]

Each input is a small valid folder of files, spoilt (see mutations.py, hostile.py) and read in a bounded, watched
process (see sandbox.py).  The only outcomes allowed: it is read and can be worked with, or a `UserError` that names
the file.
Input i of a seed is always the same: `--only I` reads it again, and `--keep DIR` leaves it there to look at.
"""

import argparse
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from tests.fuzz.hostile import BOMBS, TRAPS, place_trap
from tests.fuzz.motions import BAG_BOMBS
from tests.fuzz.mutations import Sample, mutate
from tests.fuzz.readers import READERS
from tests.fuzz.sandbox import ACCEPTED, FAILED, REFUSED, Outcome, Pool, Task

SHOWN = 25  # failures spelled out
BOMBS |= BAG_BOMBS


def _cases(name: str) -> list[tuple[str, int, str, int]]:
    """The inputs that every run starts with: (kind, sample, file, which) for valid samples, bombs and traps."""
    cases: list[tuple[str, int, str, int]] = []
    for s, sample in enumerate(READERS[name].samples()):
        cases.append(("valid", s, "", 0))
        for file in sorted(sample)[:4]:
            cases += [("bomb", s, file, i) for i in range(len(BOMBS.get(Path(file).suffix, ())))]
            cases += [("trap", s, file, i) for i in range(TRAPS)]
    return cases


def plan(inputs: int, readers: list[str]) -> list[str]:
    """Reader of each input; every reader gets its share."""
    weights = np.array([READERS[name].share for name in readers])
    edges = np.rint(np.cumsum(weights) / weights.sum() * inputs).astype(int)
    return [name for name, n in zip(readers, np.diff(edges, prepend=0)) for _ in range(n)]


def make_input(readers: list[str], seed: int, index: int, thin: int = 1) -> tuple[Task, tuple[str, ...]]:
    """Input `index`: how to place and to read it, and the names of which a refusal must hold one.

    thin: of the fixed cases only each thin-th is taken, from an offset given by the seed.
    """
    name = readers[index]
    reader, position = READERS[name], index - readers.index(name)
    samples, cases = reader.samples(), _cases(name)[seed % thin :: thin]
    rng = np.random.default_rng([seed, index])
    kind, s, file, which = (
        cases[position] if position < len(cases) else ("mutated", int(rng.integers(len(samples))), "", 0)
    )
    sample = samples[s]

    def place(folder: Path, secret: Path) -> None:
        content: Sample = dict(sample)
        if kind == "bomb":
            content[file] = BOMBS[Path(file).suffix][which](content[file])
        elif kind == "mutated":
            content = mutate(sample, rng)
        for path, data in content.items():
            (folder / path).write_bytes(data)
        if kind == "trap":
            place_trap(folder, file, secret, which)

    return Task(place, reader.read, reader.contained), (*sample, "input", "archive", "samples:")


def fuzz(
    inputs: int, seed: int, names: list[str], root: Path, jobs: int = 1, thin: int = 1, say=None
) -> list[tuple[str, int, Outcome]]:
    """(reader, index, outcome) of each input."""
    readers = plan(inputs, names)
    for name in dict.fromkeys(readers):  # imports and samples are made once, before the processes are forked
        reader = READERS[name]
        for i, sample in enumerate(reader.samples()):
            folder, out = root / f"warm_{name}_{i}" / "input", root / f"warm_{name}_{i}" / "out"
            folder.mkdir(parents=True)
            out.mkdir()
            for path, data in sample.items():
                (folder / path).write_bytes(data)
            try:
                reader.read(folder, out)
            except Exception as error:
                if name != "published":
                    raise RuntimeError(f"{name}: the valid sample {i} is refused") from error
    pool = Pool(lambda index: make_input(readers, seed, index, thin), root, jobs, say)
    try:
        return [(readers[index], index, outcome) for index, outcome in pool.run(range(inputs))]
    finally:
        pool.close()


def table(found: list[tuple[str, int, Outcome]]) -> str:
    """A row per reader: inputs, accepted, refused, failed, worst processor time and memory."""
    groups: dict[str, list[Outcome]] = defaultdict(list)
    for name, _, outcome in found:
        groups[name].append(outcome)
    groups["all"] = [outcome for _, _, outcome in found]
    lines = ["reader       inputs  accepted  refused  failed  worst s  worst MB  total s"]
    for name, some in groups.items():
        counts = [sum(outcome.status == status for outcome in some) for status in (ACCEPTED, REFUSED, FAILED)]
        worst, memory = max(o.seconds for o in some), max(o.memory for o in some) / 1e6
        lines.append(
            f"{name:<12}{len(some):>7}{counts[0]:>10}{counts[1]:>9}{counts[2]:>8}{worst:>9.2f}{memory:>10.0f}"
            f"{sum(o.seconds for o in some):>9.1f}"
        )
    return "\n".join(lines)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.mutate", description=__doc__.splitlines()[0])
    parser.add_argument("--inputs", type=int, default=10_000, help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="default: %(default)s")
    parser.add_argument("--reader", choices=tuple(READERS), action="append", help="default: all")
    parser.add_argument("--jobs", type=int, default=1, help="processes; default: %(default)s")
    parser.add_argument("--only", type=int, metavar="I", help="place and read input I in this process, unbounded")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="with --only: where the input stays")
    args = parser.parse_args()
    names = args.reader or list(READERS)
    if args.only is not None:
        task, _ = make_input(plan(args.inputs, names), args.seed, args.only)
        folder = (args.keep or Path(tempfile.mkdtemp())) / "input"
        folder.mkdir(parents=True)
        (folder.parent / "out").mkdir()
        (folder.parent / "secret.txt").write_text("secret")
        task.place(folder, folder.parent / "secret.txt")
        print(f"input {args.only} lies in {folder}", file=sys.stderr, flush=True)
        task.read(folder, folder.parent / "out")
        return 0
    with tempfile.TemporaryDirectory() as root:
        found = fuzz(args.inputs, args.seed, names, Path(root), args.jobs, say=_say)
    failures = [(name, index, outcome) for name, index, outcome in found if outcome.status == FAILED]
    for name, index, outcome in failures[:SHOWN]:
        print(f"--- {name}, input {index}: {outcome.message[-1500:]}")
    print(table(found))
    if failures:
        print(f"{len(failures)} failed; look at one with the same arguments and --only {failures[0][1]}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
