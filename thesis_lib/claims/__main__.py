"""Command line of the claims ledger: check, update, page.  `python -m thesis_lib.claims --help` teaches it."""

import argparse
import sys
from pathlib import Path

from thesis_lib.errors import UserError

EPILOG = """\
What each command does
  check   compares the results with the thesis (config/claims.yaml), the statuses found with the committed ones
          (config/claims_expected.yaml), and each figure's numbers with its stored copy (config/figures/<scale>/).
          Exit status: 0 all as committed; 1 something changed or could not be compared; 2 a mistake in the input.
          A claim that deviates from the thesis, and is committed as deviating, is no failure.
  update  commits this run's statuses and figure copies. Look at the difference (git diff) before you commit it.
  page    writes claims.csv and claims.html into the results folder.

Examples
  python -m thesis_lib.claims check --scale quick
  python -m thesis_lib.claims update --scale default
  python -m thesis_lib.claims page --results results

Which datasets a run had is read from <results>/datasets/present.json; claims and figures that need an absent one
are shown as "data not present" and never fail.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    if options.present is None:
        options.present = options.results / "datasets" / "present.json"
    try:
        return {"check": _check, "update": _update, "page": _page}[options.command](options)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m thesis_lib.claims",
        description="What the thesis states, what this program finds, and whether that has changed.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="check | update | page")
    for name, text in (
        (
            "check",
            "compare a run with the thesis and with what is committed; exit status 1 if anything changed",
        ),
        ("update", "commit this run's statuses and figure copies"),
        ("page", "write claims.csv and claims.html"),
    ):
        command = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        command.add_argument("--results", type=Path, default=Path("results"), help="folder of the results")
        command.add_argument("--ledger", type=Path, default=Path("config/claims.yaml"), help="the claims")
        command.add_argument("--present", type=Path, help="default: <results>/datasets/present.json")
        command.add_argument(
            "--scale",
            choices=("quick", "default", "full"),
            required=name != "page",
            default="" if name == "page" else None,
            help="scale at which the pipeline ran" + (" (shown on the page)" if name == "page" else ""),
        )
        if name != "page":
            command.add_argument(
                "--expected",
                type=Path,
                default=Path("config/claims_expected.yaml"),
                help="committed statuses",
            )
            command.add_argument(
                "--figures", type=Path, default=Path("config/figures.yaml"), help="tolerances of the figures"
            )
            command.add_argument(
                "--stored", type=Path, default=Path("config/figures"), help="folder of the stored copies"
            )
    return parser


def _evaluate(options: argparse.Namespace) -> tuple[list, dict[str, bool]]:
    from thesis_lib.claims.evaluate import evaluate
    from thesis_lib.claims.ledger import read_ledger
    from thesis_lib.claims.reading import read_present

    present = read_present(options.present)
    return evaluate(read_ledger(options.ledger), options.results, present), present


def _check(options: argparse.Namespace) -> int:
    from thesis_lib.claims.expected import compare_with_expected, read_expected
    from thesis_lib.claims.page import SIGNS
    from thesis_lib.claims.result import Status, summary_line

    results, present = _evaluate(options)
    print(f"Claims at scale {options.scale}\n{summary_line(results)}")
    for result in results:
        if result.status in (Status.DEVIATES, Status.ERROR):
            print(f"  {SIGNS[result.status]} {result.claim.id} ({result.claim.location})")
            print(f"      published {result.published}, ours {result.ours or '–'}: {result.reason}")
    changes = compare_with_expected(results, read_expected(options.expected), options.scale)
    print(f"\nAgainst {options.expected}: " + (f"{len(changes)} changed" if changes else "no change"))
    for change in changes:
        print(f"  {change.id}: {change.text}")
    differing = _check_figures(options, present)
    if changes or differing:
        print(
            f"\nLook into it; if it is intended: python -m thesis_lib.claims update --scale {options.scale}"
        )
    return 1 if changes or differing else 0


def _check_figures(options: argparse.Namespace, present: dict[str, bool]) -> bool:
    """Print how the figures compare with their stored copies; whether any does not agree."""
    from thesis_lib.claims.figure_check import AGREES, NO_DATA, check_figures
    from thesis_lib.claims.figure_format import read_figure_spec

    spec = read_figure_spec(options.figures)
    if options.scale not in spec.scales:
        print(f"\nFigures: {options.figures} keeps no copies at scale {options.scale}, so none is compared.")
        return False
    table = check_figures(options.results, options.stored / options.scale, spec, present)
    counts = table["status"].value_counts()
    words = ", ".join(f"{count} {status}" for status, count in sorted(counts.items())) or "none"
    print(f"\nFigures against {options.stored / options.scale}: {words}")
    bad = table[~table["status"].isin([AGREES, NO_DATA])]
    for row in bad.itertuples():
        print(f"  {row.figure} ({row.dataset}): {row.finding}")
    return len(bad) > 0


def _update(options: argparse.Namespace) -> int:
    from thesis_lib.claims.expected import update_expected
    from thesis_lib.claims.figure_check import update_figures
    from thesis_lib.claims.figure_format import read_figure_spec
    from thesis_lib.claims.result import refuse_errors

    results, present = _evaluate(options)
    refuse_errors(results)  # before the figures are written: an update happens whole or not at all
    spec = read_figure_spec(options.figures)
    lines = []
    if options.scale in spec.scales:
        lines += update_figures(options.results, options.stored / options.scale, spec, present)
    lines += update_expected(options.expected, results, options.scale)
    print("\n".join(lines) if lines else "Nothing to update.")
    return 0


def _page(options: argparse.Namespace) -> int:
    from thesis_lib.claims.page import write_page
    from thesis_lib.claims.result import refuse_errors, write_results

    results, _ = _evaluate(options)
    csv, html = options.results / "claims.csv", options.results / "claims.html"
    write_results(results, csv)
    write_page(results, html, options.scale)
    print(f"{csv}\n{html}")
    refuse_errors(results)  # last, so that the page shows what is wrong
    return 0


if __name__ == "__main__":
    sys.exit(main())
