"""Datasets of a stranger who means harm: valid ones with a hostile name and text, and broken ones."""

from pathlib import Path

import numpy as np
import yaml

from thesis_lib.bodies.body import Noise
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY
from thesis_lib.simulate.rig.release import Release, Spread
from thesis_lib.simulate.stepping.drops import simulate_drops

# HTML, a template, mathtext that does not parse, commands of a shell, a format, LaTeX, reStructuredText, quotes
NAME = "<img src=x onerror=alert(1)>&$\\frac{1}{$`touch pwned`$(touch pwned);{{7*7}}%s%n'\"\\input{x}|.. raw:: html"
DESCRIPTION = (
    "</title></style><script>alert(1)</script>\n\n.. raw:: html\n\n   <script>alert(2)</script>\n\n"
    ":math:`x` $\\frac{1}{$ \\write18{touch pwned} {{ cycler.__init__.__globals__ }} \x1b[31mred\x1b]0;title\x07\u202e"
)
ESCAPES = "\x1b[31mred\x1b]0;title\x07\x9b2J\u202e"
# nothing of this may reach a terminal as it stands
ORDERS = ("\x1b", "\x07", "\x9b", "\u202e", "\x00", "\r", "\x08")

RELEASE = Release(height=Spread(low=0.06, high=0.6), vx=Spread(low=-1.2, high=1.2), omega=Spread(low=-15, high=15))


def valid_folder(parent: Path, name: str = NAME) -> Path:
    """A dataset that can be criticised, whose folder and description are hostile."""
    noise, rng = Noise(position=3e-4, angle=3e-3), np.random.default_rng(1)
    made = simulate_drops(ELLIPSE_BODY, RELEASE, 24, mu=0.12, epsilon=0.6, noise=noise, rng=rng)
    folder = write_dataset(Dataset("plain", made.header, made.trajectories), parent / "plain", float_format=None)
    head = yaml.safe_load((folder / "dataset.yaml").read_text(encoding="utf-8"))
    text = yaml.safe_dump(head | {"description": DESCRIPTION}, allow_unicode=False)
    (folder / "dataset.yaml").write_text(text, encoding="utf-8")
    # files beside the dataset's are not looked at
    (folder / "report.html").write_text("<script>alert(3)</script>")
    (folder / "conftest.py").write_text("open('pwned', 'w')")
    return folder.rename(parent / name)


def _header(change) -> bytes:
    head = {"schema": 1, "body": {"shape": {"kind": "disk", "radius": 0.03}, "radius_of_gyration": 0.02}, "rate": 250.0}
    change(head)
    return yaml.safe_dump(head).encode()


GOOD = _header(lambda head: None)
ROWS = b"trial,t,x,y,theta\n" + b"".join(b"0,%.3f,0,1,0\n" % (i / 250) for i in range(12))
_escapes = ESCAPES.encode()

# what is written: dataset.yaml, trajectories.csv
BROKEN = {
    "key": (_header(lambda h: h.update({ESCAPES: 1})), ROWS),
    "kind of object": (_header(lambda h: h["body"]["shape"].update(kind=ESCAPES)), ROWS),
    "value": (_header(lambda h: h.update(rate=ESCAPES)), ROWS),
    "nested key": (_header(lambda h: h["body"].update({ESCAPES: {ESCAPES: ESCAPES}})), ROWS),
    "tag": (b"!!python/object/apply:os.system ['touch pwned']\n", ROWS),
    "tag in a value": (GOOD + b"description: !!python/object/apply:os.system ['touch pwned']\n", ROWS),
    "tag with escapes": (GOOD + b'description: !<%1B[31m> "x"\n', ROWS),
    "trial name": (GOOD, ROWS + _escapes + b",0.1,0,1,0\n"),
    "column": (GOOD, ROWS.replace(b"theta", _escapes)),
    "two columns": (GOOD, ROWS.replace(b"trial,t,x,y,theta", b",".join([_escapes] * 5))),
    "number": (GOOD, ROWS + b"1,0.0," + _escapes + b",1,0\n"),
    "expression": (GOOD, ROWS + b"=cmd|'/c calc'!A1,__import__('os').system('touch pwned'),0,1,0\n"),
}


def broken_folder(parent: Path, which: str) -> Path:
    """A dataset that must be refused."""
    folder = parent / "broken"
    folder.mkdir()
    head, rows = BROKEN[which]
    (folder / "dataset.yaml").write_bytes(head)
    (folder / "trajectories.csv").write_bytes(rows)
    return folder
