"""`python -m thesis_lib figures`: which figures there are, where they lie, what they show, what makes them.

Read from the files that the pipeline itself goes by: config/figures.yaml has every figure's file, workflow/report its
caption.
"""

import json
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from thesis_lib.foundation.command_line import Parser, command, near
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import is_file, read_bytes

SPEC, CAPTIONS = Path("config/figures.yaml"), Path("workflow/report")
DESCRIPTION = """\
List the figures with their files; with a number or a name: its files, its caption, and the command that makes it.
Run it in the root folder of the repository.
"""
EXAMPLES = """\
examples:
  python -m thesis_lib figures
  python -m thesis_lib figures 3-8
  python -m thesis_lib figures 3-8 --dataset planar_dice
  python -m thesis_lib figures named_physics
  python -m thesis_lib figures --json | jq -r '.[].files[].path'
"""
WIDTH = 100
LONGEST = 10_000  # bytes of a finding
FOUND_HERE = "Found in this run: "
FOUND = re.compile(r"\*\*Found in this run:\*\*\s+\.\. include:: results/(\S+)")


@dataclass(frozen=True)
class ListedFigure:
    """A figure of the pipeline.

    Attributes:
        name: as asked for: number in the thesis (3-8, 5-5a), or a name where the thesis has none.
        chapter: its number.
        files: dataset -> picture below the results folder; the key is "" where it is of no dataset.
        caption: its file in workflow/report.
    """

    name: str
    chapter: int
    files: dict[str, str]
    caption: Path

    @property
    def title(self) -> str:
        """What it shows, in one line: the beginning of its caption."""
        text = self.caption_text(next(iter(self.files)))
        text = re.sub(r"^Figure \S+ of the thesis( \(\w+\))?(, for the impact of [^:.]*)?[.:] ", "", text)
        text = re.split(r"[.;:](?:\s|$)", re.sub(r"^\(a\) ", "", text))[0]
        text = re.sub(r" \(figure[^)]*\)", "", text)
        return textwrap.shorten(text[:1].upper() + text[1:], 90, placeholder=" …")

    def caption_text(self, dataset: str, results: Path | None = None) -> str:
        """`caption_text` of the figure for one of its datasets."""
        return caption_text(self.caption, dataset, results)


def listed_figures() -> list[ListedFigure]:
    """All figures in the order of the thesis, those without a number last in their chapter.

    Raises:
        UserError: this is not the root folder of the repository, or a figure has no caption.
    """
    from thesis_lib.ledger.figure_format import COMMON, read_figure_spec

    if not SPEC.is_file() or not CAPTIONS.is_dir():
        raise UserError(
            f"There is no {SPEC} with {CAPTIONS} here; run this in the root folder of the repository."
        )
    spec = read_figure_spec(SPEC)
    files = {
        name: {dataset.replace(COMMON, ""): csv for dataset, csv in figure.sources().items()}
        for name, figure in spec.figures.items()
    }
    files |= {Path(path).stem: {"": path} for path in spec.ignore if "*" not in path}
    figures = [
        ListedFigure(
            _short(name),
            int(next(iter(where.values())).split("/")[0].removeprefix("chapter")),
            {dataset: str(Path(path).with_suffix(".png")) for dataset, path in where.items()},
            _caption(name),
        )
        for name, where in files.items()
    ]
    return sorted(figures, key=_order)


def caption_text(caption: Path, dataset: str, results: Path | None = None) -> str:
    """A caption as plain text, a paragraph a line, with what a run found if it is in `results`."""
    import jinja2

    class Unknown(jinja2.ChainableUndefined):
        def __str__(self) -> str:
            return "…"

    source = caption.read_text(encoding="utf-8")
    told = {"snakemake": {"wildcards": {"dataset": dataset}}}
    text = jinja2.Environment(undefined=Unknown).from_string(source).render(told)
    text = FOUND.sub(lambda include: _found(results, include[1]), text)
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text) if part.strip()]
    return "\n\n".join(re.sub(r"(\*\*?|``?)(\S(?:.*?\S)?)\1", r"\2", part) for part in paragraphs)


def _short(name: str) -> str:
    """figure_3_8 -> 3-8, figure_named_physics -> named_physics"""
    short = name.removeprefix("figure_")
    return short.replace("_", "-") if short[0].isdigit() else short


def _caption(name: str) -> Path:
    short = name.removeprefix("figure_")
    paths = [CAPTIONS / f"{name}.rst", *sorted(CAPTIONS.glob(f"*{short}*.rst"))]
    for path in paths:
        if path.is_file():
            return path
    raise UserError(f"{CAPTIONS} has no caption for {name}; write {paths[0]}.")


def _found(results: Path | None, file: str) -> str:
    """The finding that a caption includes; nothing where no run has made it."""
    if results is None or not is_file(results / file):
        return ""
    return f"{FOUND_HERE}{read_bytes(results / file, LONGEST).decode('utf-8', 'replace')}"


def _order(figure: ListedFigure) -> tuple:
    found = re.match(r"\d+-(\d+)(\w?)$", figure.name)
    return (figure.chapter, not found, int(found[1]) if found else 0, found[2] if found else figure.name)


def find_figure(asked: str, figures: Sequence[ListedFigure]) -> ListedFigure:
    """The figure of that number or name: 3-8, 3.8, "Figure 3-8" and figure_3_8.png are the same.

    Raises:
        UserError: there is none, with those that are alike.
    """
    key = re.sub(r"^fig(ure|\.)?[\s_]*", "", asked.strip().lower().removesuffix(".png"))
    key = re.sub(r"[._\s-]+", "-", key)
    for figure in figures:
        if figure.name.replace("_", "-") == key:
            return figure
    names = [figure.name for figure in figures]
    raise UserError(
        f"There is no figure {asked!r}{near(key, names)}\npython -m thesis_lib figures lists them."
    )


def as_dictionary(figure: ListedFigure, results: Path) -> dict:
    """What --json prints of a figure."""
    return {
        "figure": figure.name,
        "chapter": figure.chapter,
        "title": figure.title,
        "files": [
            {"dataset": dataset or None, "path": str(results / path), "made": (results / path).is_file()}
            for dataset, path in figure.files.items()
        ],
        "caption": {dataset or "": figure.caption_text(dataset, results) for dataset in figure.files},
        "command": f"snakemake --cores 2 {' '.join(f'results/{path}' for path in figure.files.values())}",
    }


def list_text(figures: Sequence[ListedFigure], results: Path) -> str:
    """Two lines a figure, by chapter; {a,b} in a path stands for either, as in a shell."""
    lines, chapter = [], None
    for figure in figures:
        if figure.chapter != chapter:
            lines += ["", f"chapter {figure.chapter}"] if lines else [f"chapter {figure.chapter}"]
            chapter = figure.chapter
        dataset, path = next(iter(figure.files.items()))
        if len(figure.files) > 1:
            path = path.replace(f"/{dataset}/", f"/{{{','.join(figure.files)}}}/")
        missing = [name for name, file in figure.files.items() if not (results / file).is_file()]
        note = f"   not made yet{': ' * bool(missing[0])}{', '.join(missing)}" if missing else ""
        lines += [f"  {figure.name:<16}{figure.title}", f"  {'':<16}{results / path}{note}"]
    return "\n".join([*lines, "\npython -m thesis_lib figures NUMBER shows the caption and what makes it."])


def figure_text(figure: ListedFigure, results: Path, dataset: str) -> str:
    """Files and commands of one figure, and its caption for one dataset."""
    lines = []
    for path in figure.files.values():
        lines.append(f"{results / path}{'' if (results / path).is_file() else '   not made yet'}")
        lines.append(f"    snakemake --cores 2 results/{path}")
    lines.append("beside each picture: the same as .pdf, its numbers as .csv")
    for text in figure.caption_text(dataset, results).split("\n\n"):
        lines += ["", *textwrap.wrap(text, WIDTH)]
    return "\n".join(lines)


def _shown_dataset(figure: ListedFigure, results: Path, asked: str | None) -> str:
    if asked and asked not in figure.files:
        known = ", ".join(filter(None, figure.files)) or "none: it is of no dataset"
        raise UserError(f"Figure {figure.name} has no dataset {asked!r}; it has {known}.")
    made = [name for name, path in figure.files.items() if (results / path).is_file()]
    return asked or (made or list(figure.files))[0]


@command
def main(argv: Sequence[str] | None = None) -> int:
    parser = Parser(prog="python -m thesis_lib figures", description=DESCRIPTION, epilog=EXAMPLES)
    parser.add_argument("figure", nargs="?", metavar="NUMBER", help="such as 3-8; default: list all")
    parser.add_argument("--results", type=Path, default=Path("results"), help="default: %(default)s")
    parser.add_argument(
        "--dataset", metavar="NAME", help="whose caption; default: the first whose picture is there"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")
    args = parser.parse_args(argv)
    figures = listed_figures()
    figure = find_figure(args.figure, figures) if args.figure else None
    if args.json:
        told = [as_dictionary(each, args.results) for each in figures]
        content = as_dictionary(figure, args.results) if figure else told
        print(json.dumps(content, indent=1, ensure_ascii=False))
    elif figure:
        print(figure_text(figure, args.results, _shown_dataset(figure, args.results, args.dataset)))
    else:
        print(list_text(figures, args.results))
    return 0
