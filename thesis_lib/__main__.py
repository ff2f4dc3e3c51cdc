"""Entry point `thesis-lib COMMAND`; the module of a command is imported only when the command is called."""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from thesis_lib import __version__
from thesis_lib.foundation.command_line import command, near
from thesis_lib.foundation.errors import UserError

COMMANDS = {  # group -> name -> module, function, help text
    "your own drops": {
        "datasets": ("commands.datasets", "main", "make a dataset from a rig's logs, check it, fetch one"),
        "critique": ("commands.critique", "critique", "where the models fail in one dataset or in many, and why"),
        "predict": ("commands.model", "predict", "velocities after impact, by the model of a critique"),
        "simulate": ("commands.model", "simulate", "drops simulated with such a model"),
        "rollout": ("commands.rollout", "rollout", "predicted tosses in space compared with measured ones"),
        "export": ("commands.model", "export", "write such a model as a MuJoCo or Drake file, or into yours"),
        "effects": ("commands.effects", "effects", "the physical effects that a critique tests; add your own"),
    },
    "the thesis": {
        "claims": ("thesis.commands.claims", "main", "statements of the thesis compared with our results"),
        "tables": ("thesis.commands.tables", "tables", "tables of a chapter with the meaning of their columns"),
        "figures": ("thesis.commands.tables", "list_figures", "file, caption and command of every figure"),
    },
}
HELP = """\
How far are contact models from your measurements, where do they fail, and which physics is missing?

usage: thesis-lib COMMAND ...

{commands}

examples:
  thesis-lib datasets example -o data/example      simulated drops of a rig with a hidden flaw
  thesis-lib critique data/example                 find it: open results/critique/example/report.html

Results go to the folder given by -o; without it a critique goes to results/critique/<name of the dataset>.
{of_thesis}
Exit codes: 0 done; 1 a check failed; 2 wrong usage or bad input, with advice on stderr; 130 interrupted.
thesis-lib COMMAND --help explains a command, with examples; --version prints the version.
"""
OF_THESIS = """\
The pipeline that reproduces the thesis (make reproduce, or snakemake --cores 2 chapter3) writes into results/; start
with results/report.html. thesis-lib figures 3-8 shows the file of a figure and the command that makes it.
"""  # in a clone of the repository, which contains the thesis


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
            f"{name} needs the results of the thesis, which are not part of an installed library\n"
            f"run thesis-lib {name} in a clone of the repository, after make reproduce"
        )
    if name not in known:
        what = f"there is no command {name}{near(name, known)}" if name else "a command is missing"
        raise UserError(f"{what}\nthesis-lib --help lists them: {', '.join(known)}")
    module, function, _ = known[name]
    return getattr(importlib.import_module(f"thesis_lib.{module}"), function)(arguments[1:])


def help_text() -> str:
    """Text printed by --help."""
    groups = [
        "\n".join([f"{title}:", *(f"  {name:<10} {what}" for name, (_, _, what) in group.items())])
        for title, group in _groups().items()
    ]
    of_thesis = OF_THESIS if "the thesis" in _groups() else ""
    return HELP.format(commands="\n\n".join(groups), of_thesis=of_thesis)


def _groups() -> dict[str, dict[str, tuple[str, str, str]]]:
    """Groups of available commands; a library installed by pip lacks the commands on the thesis."""
    held = (Path(__file__).parent / "thesis" / "__init__.py").is_file()
    return {title: group for title, group in COMMANDS.items() if held or title != "the thesis"}


if __name__ == "__main__":
    sys.exit(main())
