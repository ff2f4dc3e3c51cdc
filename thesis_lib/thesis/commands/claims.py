"""Command line of the claims ledger: check, update, page (see `thesis-lib claims --help`)."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.foundation.command_line import FAILED, Parser, command

EPILOG = """\
What each command does
  check   compares the results with the thesis (config/claims/), the statuses found with the committed statuses
          (config/claims_expected.yaml), and each figure's numbers with its stored copy (config/figures/<scale>/).
          Exit status: 0 if all is as committed; 1 if something changed or could not be compared; 2 for wrong input.
          A claim that deviates from the thesis and is committed as deviating is not a failure.
  update  stores this run's statuses and figure copies. Review the difference (git diff) before you commit it.
  page    writes claims.csv and claims.html into the results folder.

Examples
  thesis-lib claims check --scale quick
  thesis-lib claims update --scale default
  thesis-lib claims page --results results

The datasets of a run are read from <results>/datasets/present.json; claims and figures that need a missing dataset
are shown as "data not present" and never fail.
"""

COMMANDS = {
    "check": "compare a run with the thesis and with the committed statuses; exit status 1 if anything changed",
    "update": "store this run's statuses and figure copies",
    "page": "write claims.csv and claims.html",
}
PATHS = {
    "--results": ("results", "folder of the results"),
    "--ledger": ("config/claims", "the claims: a folder, or a file"),
}
STORED = {
    "--expected": ("config/claims_expected.yaml", "committed statuses"),
    "--stored": ("config/figures", "folder of the stored copies"),
}


@command
def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status."""
    options = _parser().parse_args(argv)
    if options.present is None:
        options.present = options.results / "datasets" / "present.json"
    if options.scale is None:
        options.scale = _scale_of(options.results)
    return {"check": _check, "update": _update, "page": _page}[options.command](options)


def _parser() -> Parser:
    parser = Parser(
        prog="thesis-lib claims",
        description="Compare the statements of the thesis with our results, and report changes.",
        epilog=EPILOG,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="check | update | page")
    for name, text in COMMANDS.items():
        of_page = name == "page"
        example = f"example:\n  thesis-lib claims {name}{'' if of_page else ' --scale quick'}"
        description = text[0].upper() + text[1:] + "."
        subparser = commands.add_parser(name, help=text, description=description, epilog=example)
        for option, (default, meaning) in (PATHS | ({} if of_page else STORED)).items():
            subparser.add_argument(option, type=Path, default=Path(default), help=meaning)
        subparser.add_argument("--present", type=Path, help="default: <results>/datasets/present.json")
        meaning = "scale at which the pipeline ran" + ("; default: as in its provenance.json" if of_page else "")
        subparser.add_argument("--scale", choices=("quick", "default"), required=not of_page, help=meaning)
        if name == "check":
            subparser.add_argument("--json", action="store_true", help="print JSON instead of text")
    return parser


def _scale_of(results: Path) -> str:
    """Scale of a run from its provenance; "" without one, in which case claims are decided as at the default scale."""
    from thesis_lib.foundation.files import read_json

    provenance = results / "provenance.json"
    return str(read_json(provenance).get("scale", "")) if provenance.exists() else ""


def _evaluate(options: argparse.Namespace) -> tuple[list, dict[str, bool]]:
    from thesis_lib.thesis.ledger.evaluate import evaluate
    from thesis_lib.thesis.ledger.format import read_ledger
    from thesis_lib.thesis.ledger.reading import read_present

    present = read_present(options.present)
    return evaluate(read_ledger(options.ledger), options.results, present, options.scale), present


def _check(options: argparse.Namespace) -> int:
    from thesis_lib.thesis.ledger.expected import compare_with_expected, read_expected
    from thesis_lib.thesis.ledger.figure_check import AGREES, NO_DATA, check_figures
    from thesis_lib.thesis.records import catalogue

    results, present = _evaluate(options)
    changes = compare_with_expected(results, read_expected(options.expected), options.scale)
    figures = check_figures(options.results, options.stored / options.scale, catalogue.figures(), present)
    differing = figures[~figures["status"].isin([AGREES, NO_DATA])]
    if options.json:
        _print_json(options, results, changes, figures)
    else:
        _print_text(options, results, changes, figures, differing)
    return FAILED if changes or len(differing) else 0


def _print_text(options: argparse.Namespace, results: list, changes: list, figures, differing) -> None:
    from thesis_lib.thesis.ledger.result import SIGNS, ClaimStatus, decided_line, summary_line

    print(f"Claims at scale {options.scale}\n{summary_line(results)}\n{decided_line(results)}")
    for r in results:
        if r.status in (ClaimStatus.DEVIATES, ClaimStatus.ERROR):
            print(f"  {SIGNS[r.status]} {r.claim.id} ({r.claim.location})")
            print(f"      published {r.published}, ours {r.ours or '–'}: {r.reason}")
    print(f"\nAgainst {options.expected}: " + (f"{len(changes)} changed" if changes else "no change"))
    for change in changes:
        print(f"  {change.id}: {change.text}")
    counts = figures["status"].value_counts()
    words = ", ".join(f"{count} {status}" for status, count in sorted(counts.items())) or "none"
    print(f"\nFigures against {options.stored / options.scale}: {words}")
    for row in differing.itertuples():
        print(f"  {row.figure} ({row.dataset}): {row.finding}")
    if changes or len(differing):
        print(f"\nReview the change; if it is intended: thesis-lib claims update --scale {options.scale}")


def _print_json(options: argparse.Namespace, results: list, changes: list, figures) -> None:
    from thesis_lib.thesis.ledger.result import count_statuses

    content = {
        "scale": options.scale,
        "counts": {str(status): count for status, count in count_statuses(results).items()},
        "claims": [
            {"id": r.claim.id, "location": r.claim.location, "status": str(r.status)}
            | {"published": r.published, "ours": r.ours, "reason": r.reason}
            for r in results
        ],
        "changes": [vars(change) for change in changes],
        "figures": figures.to_dict("records"),
    }
    print(json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False))


def _update(options: argparse.Namespace) -> int:
    from thesis_lib.thesis.ledger.expected import update_expected
    from thesis_lib.thesis.ledger.figure_check import update_figures
    from thesis_lib.thesis.ledger.result import refuse_errors
    from thesis_lib.thesis.records import catalogue

    results, present = _evaluate(options)
    refuse_errors(results)  # before figures are written, so that an update is all or nothing
    lines = update_figures(options.results, options.stored / options.scale, catalogue.figures(), present)
    lines += update_expected(options.expected, results, options.scale)
    print("\n".join(lines) if lines else "Nothing to update.")
    return 0


def _page(options: argparse.Namespace) -> int:
    from thesis_lib.foundation.files import write_table
    from thesis_lib.thesis.ledger.result import refuse_errors, to_table, write_page

    results, _ = _evaluate(options)
    csv, html = options.results / "claims.csv", options.results / "claims.html"
    write_table(to_table(results), csv)
    write_page(results, html, options.scale)
    print(f"{csv}\n{html}")
    refuse_errors(results)  # last, so that the page shows the errors
    return 0
