"""CPU time of one critique on one core: 300 drops, from trajectories to report.

    python -m benchmarks.critique [--drops 300] [--hidden com_offset_x] [--sizes 75 150 300 600] [--quick] [-o FILE.csv]
    python -m benchmarks.critique --against CHECKOUT [--pairs 3] [--drops 300]

- `--hidden`: the example of the command line with a hidden cause, by `thesis-lib critique`;
- an ellipse with single hits only, and a square with all episodes, nothing hidden and contacts of 1 ms: what is asked
  for 300 drops is at most `ASKED` CPU seconds;
- a box tossed in space, nothing hidden: CPU time of a hit over that of either planar body, asked at most `IN_SPACE`;
- how the cost of each grows over `--sizes` drops: cost = a nᵖ by least squares to the logarithms, asked p < `EXPONENT`.
- `--against`: only the ratio to the CPU time of an earlier checkout of this repository, pair by pair in turn, for the
  ellipse, for the square, and for a box in space, all with a displaced centre of mass, by
  `thesis-lib critique`; `--hits` chooses among them.

Counts user and system time of a process as a whole, start-up and pictures included.
"""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.results import Results, benchmark_parser, exponent

ROOT = Path(__file__).resolve().parent.parent
ASKED = {"single": 15.0, "episodes": 60.0}  # CPU s for 300 drops
IN_SPACE, MEMORY = 4.0, 1.5  # times the CPU time in the plane, and GB of the process
EXPONENT = {"single": 1.0, "episodes": 1.0, "space": 1.2}
SHAPES = {"single": "ellipse", "episodes": "square", "space": "box"}
CONTACT_TIME = 1e-3  # s
SEED = 1
# what the command line does, for either setting of episodes
CRITIQUE = """
import sys
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.run import criticise
data, out, episodes = sys.argv[1:]
criticise(data, settings=CritiqueSettings(episodes=episodes == "episodes")).save(out)
"""


def measure(hidden: str, drops: int) -> dict[str, float | str]:
    """CPU seconds of the critique of an example with a hidden cause, and what it says.

    Raises:
        RuntimeError: a command failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        data, out = f"{folder}/example", f"{folder}/critique"
        _run("-m", "thesis_lib", "datasets", "example", "-o", data, "--hidden", hidden, "--drops", str(drops))
        return _critique(out, "-m", "thesis_lib", "critique", data, "-o", out, "-q")


def measure_nothing_hidden(hits: str, drops: int) -> dict[str, float | str]:
    """The same with nothing hidden, for `hits` of `SHAPES`."""
    with tempfile.TemporaryDirectory() as folder:
        data, out = _written(f"{folder}/drops", hits, drops), f"{folder}/critique"
        return _critique(out, "-c", CRITIQUE, data, out, "single" if hits == "single" else "episodes")


def ratios(earlier: Path, hits: str, drops: int, pairs: int) -> list[float]:
    """CPU time here over that of the checkout `earlier`, pair by pair; a first pair compiles and is left out."""
    with tempfile.TemporaryDirectory() as folder:
        data, out, found = f"{folder}/drops", f"{folder}/critique", []
        _written(data, hits, drops, com_offset_x=2e-3)
        command = ("-m", "thesis_lib", "critique", data, "-o", out, "-q")
        for pair in range(pairs + 1):
            then, now = (float(_critique(out, *command, root=root)["cpu_s"]) for root in (earlier, ROOT))
            said = "compiles" if pair == 0 else f"ratio {now / then:.3f}"
            print(f"{SHAPES[hits]}, {hits}: {then:.1f} s then, {now:.1f} s now, {said}", flush=True)
            found.append(now / then)
        return found[1:]


def _written(folder: str, hits: str, drops: int, **hidden: float) -> str:
    """The folder, with drops of a body whose hits are "single" or "episodes", or with tosses in "space"."""
    if hits == "space":
        tosses = ("--space", "--hidden", "com_offset" if hidden else "nothing", "--drops", str(drops))
        _run("-m", "thesis_lib", "datasets", "example", "-o", folder, *tosses)
        return folder
    import numpy as np

    from thesis_lib.datasets.format.dataset import Dataset
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
    from thesis_lib.simulate.rig.hidden_causes import (
        ELLIPSE_BODY,
        PROOF_RELEASE,
        RIG_NOISE,
        SQUARE,
        CompliantContact,
        HiddenCauses,
    )

    body = SQUARE if SHAPES[hits] == "square" else ELLIPSE_BODY
    setup = {"contact": CompliantContact(contact_time=CONTACT_TIME), "hidden": HiddenCauses(**hidden)}
    rng = np.random.default_rng(SEED)
    made = simulate_compliant_drops(body, PROOF_RELEASE, drops, **setup, noise=RIG_NOISE, rng=rng)
    write_dataset(Dataset(SHAPES[hits], made.header, made.trajectories), folder)
    return folder


def _critique(out: str, *command: str, root: Path = ROOT) -> dict[str, float | str]:
    """CPU seconds of a command of Python, run in `root`, that writes a critique to `out`, and what that says."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _run(*command, root=root)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    diagnosis = json.loads(Path(out, "diagnosis.json").read_text(encoding="utf-8"))
    return {
        "cpu_s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1),
        "n_impacts": diagnosis["n_impacts"],
        "verdict": diagnosis["verdict"],
        "effects": ", ".join(effect["name"] for effect in diagnosis["effects"]),
    }


def _run(*arguments: str, root: Path = ROOT) -> None:
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=root, env=os.environ | {"PYTHONPATH": str(root)}, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr[-3000:]}")


def main(arguments: list[str] | None = None) -> None:
    parser = benchmark_parser("critique", "CPU time of one critique on one core.")
    parser.add_argument("--drops", type=int, default=300)
    parser.add_argument("--hidden", nargs="+", default=["com_offset_x"], metavar="CAUSE")
    parser.add_argument("--sizes", type=int, nargs="+", default=[75, 150, 300, 600], metavar="DROPS")
    parser.add_argument("--against", type=Path, metavar="CHECKOUT", help="only compare with an earlier checkout")
    parser.add_argument("--hits", nargs="+", choices=SHAPES, default=list(SHAPES), help="with --against")
    parser.add_argument("--pairs", type=int, default=3, help="with --against; default: %(default)s")
    options = parser.parse_args(arguments)
    shapes, of_hit = tuple(SHAPES), {}
    if options.quick:
        options.hidden, options.drops, options.sizes, shapes = ["nothing"], 20, [], ("episodes",)
        options.hits = shapes
    results = Results("critique")
    if options.against:
        for hits in options.hits:
            found = ratios(options.against.resolve(), hits, options.drops, options.pairs)
            note = f"median of {len(found)} pairs, {min(found):.3f} to {max(found):.3f}"
            results.add(
                f"{SHAPES[hits]}, {hits}: CPU time over that of the earlier", statistics.median(found), "1", note
            )
        return results.write(options.out)
    print(f"{'drops of':24s}{'drops':>6s}{'impacts':>9s}{'CPU s':>8s}  verdict")

    def tell(name: str, drops: int, found: dict) -> str:
        said = f"{found['verdict']} {found['effects']}".strip()
        print(f"{name:24s}{drops:6d}{found['n_impacts']:9d}{found['cpu_s']:8.1f}  {said}", flush=True)
        return f"{drops} drops, from files to report; says: {said}"

    for hidden in options.hidden:
        found = measure(hidden, options.drops)
        results.add(f"{hidden}: CPU time", found["cpu_s"], "s", tell(hidden, options.drops, found))
    for hits in shapes:
        name = f"{SHAPES[hits]}, {hits}"
        found = measure_nothing_hidden(hits, options.drops)
        note = tell(name, options.drops, found)
        results.add(f"{name}: CPU time", found["cpu_s"], "s", note)
        of_hit[hits] = float(found["cpu_s"]) / float(found["n_impacts"])
        if hits == "space":
            peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
            results.add("largest memory of a process", peak, "GB", f"asked: at most {MEMORY:g}")
            print(f"{name}: {peak:.2f} GB at most")
            for planar in ("single", "episodes"):
                over, what = of_hit["space"] / of_hit[planar], f"CPU time of a hit over the {SHAPES[planar]}'s"
                results.add(f"{name}: {what}", over, "1", f"asked: at most {IN_SPACE:g}")
                print(f"{name}: {what} {over:.2f}")
        elif options.drops == 300:
            asked = ASKED[hits]
            results.add(f"{name}: over what is asked", found["cpu_s"] / asked, "1", f"asked: at most {asked:g} CPU s")
        taken = []
        for drops in options.sizes:
            found = measure_nothing_hidden(hits, drops)
            tell(name, drops, found)
            taken.append(found["cpu_s"])
        if len(taken) > 1:
            p, half = exponent(options.sizes, taken)
            sizes, asked = f"{min(options.sizes)} to {max(options.sizes)} drops", EXPONENT[hits]
            said = "yes" if p + half < asked else "no" if p - half > asked else "these sizes do not decide it"
            note = f"± {half:.2f} (95 %), {sizes}; asked: below {asked:g}: {said}"
            results.add(f"{name}: exponent of the CPU time", p, "1", note)
            print(f"{name}: cost ~ n^{p:.2f} {note}")
    results.write(options.out)


if __name__ == "__main__":
    main()
