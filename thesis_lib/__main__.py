"""`python -m thesis_lib COMMAND`: each command is a module that is imported when it is called."""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from thesis_lib import __version__
from thesis_lib.foundation.command_line import command, near
from thesis_lib.foundation.errors import UserError

COMMANDS = {  # name -> module, function, what it does; in groups
    "your own drops": {
        "datasets": ("commands.datasets", "main", "make a dataset from a rig's logs, check it, fetch one"),
        "critique": ("commands.critique", "critique", "where the models fail in one dataset or in many, and why"),
        "predict": ("commands.model", "predict", "velocities after impact, by the model of a critique"),
        "simulate": ("commands.model", "simulate", "drops simulated with such a model"),
        "rollout": ("commands.rollout", "rollout", "predicted tosses in space compared with measured ones"),
        "export": ("commands.model", "export", "write such a model as a MuJoCo or Drake file, or into yours"),
        "effects": ("commands.effects", "effects", "the physical effects that are looked for; add your own"),
    },
    "the thesis": {
        "claims": ("thesis.commands.claims", "main", "what the thesis states compared with what this program finds"),
        "tables": ("thesis.commands.tables", "tables", "a chapter's tables with the meaning of their columns"),
        "figures": ("thesis.commands.tables", "list_figures", "file, caption and command of every figure"),
    },
}
HELP = """\
How far are contact models from your measurements, where do they fail, and which physics is missing?

usage: python -m thesis_lib COMMAND ...

{commands}

examples:
  python -m thesis_lib datasets example -o data/example      drops of a rig that is not quite what it seems
  python -m thesis_lib critique data/example                 what is it? open results/critique/example/report.html

Results go to the folder given by -o; without it a critique goes to results/critique/<name of the dataset>.
{of_thesis}
Exit codes: 0 done; 1 a check failed; 2 wrong use or bad input, with advice on stderr; 130 interrupted.
python -m thesis_lib COMMAND --help explains a command, with examples; --version says which version this is.
"""
OF_THESIS = """\
The pipeline that reproduces the thesis (make reproduce, or snakemake --cores 2 chapter3) writes into results/; start
with results/report.html. python -m thesis_lib figures 3-8 says where a figure is, and what makes it.
"""  # where the thesis is


@command
def main(argv: Sequence[str] | None = None) -> int:
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = arguments[0] if arguments else ""
    if name in ("-h", "--help"):
        print(help_text(), end="")
        return 0
    if name == "--version":
        print(f"thesis_lib {__version__}")
        return 0
    known = {name: where for group in _groups().values() for name, where in group.items()}
    if name in COMMANDS["the thesis"] and name not in known:
        raise UserError(
            f"{name} is about the thesis's results, which an installed library does not make\n"
            f"run python -m thesis_lib {name} in a clone of the repository, after make reproduce"
        )
    if name not in known:
        what = f"there is no command {name}{near(name, known)}" if name else "a command is missing"
        raise UserError(f"{what}\npython -m thesis_lib --help lists them: {', '.join(known)}")
    module, function, _ = known[name]
    return getattr(importlib.import_module(f"thesis_lib.{module}"), function)(arguments[1:])


def help_text() -> str:
    """Text that --help prints."""
    groups = [
        "\n".join([f"{title}:", *(f"  {name:<10} {what}" for name, (_, _, what) in group.items())])
        for title, group in _groups().items()
    ]
    of_thesis = OF_THESIS if "the thesis" in _groups() else ""
    return HELP.format(commands="\n\n".join(groups), of_thesis=of_thesis)


def _groups() -> dict[str, dict[str, tuple[str, str, str]]]:
    """The groups of commands that are here: a library that pip installed holds nothing of the thesis."""
    held = (Path(__file__).parent / "thesis" / "__init__.py").is_file()
    return {title: group for title, group in COMMANDS.items() if held or title != "the thesis"}


if __name__ == "__main__":
    sys.exit(main())
