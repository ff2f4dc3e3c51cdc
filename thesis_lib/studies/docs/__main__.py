"""`python -m thesis_lib.studies.docs`: write the reference pages in docs/ from the code, or list the outdated ones."""

import sys
from collections.abc import Sequence
from pathlib import Path

from thesis_lib.foundation.command_line import FAILED, Parser, command

EPILOG = """\
examples:
  python -m thesis_lib.studies.docs               after a change of a setting, an effect, a law or a column
  python -m thesis_lib.studies.docs --check       lists outdated pages (exit code 1 if there are any); writes nothing
  python -m thesis_lib.studies.docs --results results
                                          after a run at the default scale: also copies the tables that templates use
  python -m thesis_lib.studies.docs --pictures    also redraws the pictures of effects and laws (half a minute)
"""


@command
def main(argv: Sequence[str] | None = None) -> int:
    description = "Write the parts of the pages in docs/ that come from the code."
    parser = Parser(prog="python -m thesis_lib.studies.docs", description=description, epilog=EPILOG)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if a page is outdated")
    parser.add_argument("--pictures", action="store_true", help="also redraw the pictures")
    parser.add_argument("--docs", type=Path, default=Path("docs"), help="folder of the pages; default: %(default)s")
    parser.add_argument("--results", type=Path, help="folder of a run at the default scale; its numbers are used")
    args = parser.parse_args(argv)
    if args.check and args.results:
        parser.error("--check writes nothing, but --results copies tables: give only one of them")
    from thesis_lib.studies.docs.pages import stale_pages

    if args.results:
        from thesis_lib.studies.docs.templates import keep_results

        for path in keep_results(args.results):
            print(f"kept {path}")
    stale = stale_pages(args.docs)
    if args.check:
        for path in stale:
            print(
                f"{path} is outdated; run python -m thesis_lib.studies.docs to rewrite it (template: docs/templates/)"
            )
        return FAILED if stale else 0
    from thesis_lib.foundation.files import write_text

    for path, text in stale.items():
        write_text(text, path)
        print(f"wrote {path}")
    if args.pictures:
        from thesis_lib.studies.docs.pictures import draw_pictures

        for path in draw_pictures(args.docs / "pictures"):
            print(f"drew {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
