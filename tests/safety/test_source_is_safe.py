"""No module of this project runs what it reads; and the scanner that says so finds each kind of slip."""

from pathlib import Path

import pytest
from scanner import python_files, scan, scan_rules

ROOT = Path(__file__).resolve().parents[2]
PYTHON = [
    path
    for path in python_files(ROOT, "thesis_lib", "workflow", "benchmarks", "tests")
    if path != Path(__file__)  # the bad snippets below
]
RULES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]

# where a rule is broken, and why it is right there; one that is not needed any more fails the test
ALLOWED = {
    # the one download; no byte is parsed before its SHA-256 matches (tests/datasets/test_published.py)
    ("thesis_lib/datasets/sources/fetch.py", "network"),
    # the text of effects that it writes itself, of fixed words and numbers (tests/critique/proposal/)
    ("thesis_lib/critique/proposal/effect_file.py", "eval"),
    # a user's own effects, from the path that was given (tests/extensions/test_loading.py)
    ("thesis_lib/extensions/loading.py", "code"),
    ("thesis_lib/critique/export/drake_files.py", "xml"),  # writes XML, reads none
    # a user's model of a robot; entities unfold a little at most, and a document type is refused (test_patch.py)
    ("thesis_lib/critique/export/patch.py", "xml"),
    # where tags stand in a text that lxml has read already, without a document type (test_patch.py)
    ("thesis_lib/critique/export/splice.py", "xml"),
    ("tests/workflow/test_held_out_scripts.py", "code"),  # runs our own scripts as Snakemake does
    ("tests/datasets/test_published.py", "network"),  # serves files to the download, on this machine
    ("tests/fuzz/hostile.py", "network"),  # makes a socket file, which a reader must refuse
    ("tests/fuzz/test_mutation.py", "shell"),  # misbehaves on purpose, to be caught
    ("tests/slurm/two_nodes.py", "network"),  # the name of this machine, for a cluster of its own
    ("tests/test_readme.py", "eval"),  # runs the examples of our own README
    ("tests/test_readme.py", "shell"),  # runs the commands of our own README as a reader would
}


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_the_project_breaks_no_rule_but_where_it_is_allowed():
    found = [one for path in PYTHON for one in scan(path.read_text(encoding="utf-8"), relative(path))]
    found += [one for path in RULES for one in scan_rules(path.read_text(encoding="utf-8"), relative(path))]
    assert [one for one in found if (one.path, one.rule) not in ALLOWED] == []
    unused = ALLOWED - {(one.path, one.rule) for one in found}
    assert not unused, f"not needed any more: {unused}"


def test_everything_was_looked_at():
    assert len(PYTHON) > 300 and len(RULES) >= 9
    assert ROOT / "thesis_lib" / "jenga" / "play" / "ppo.py" in PYTHON


BAD = {
    "pickle": [
        "import pickle",
        "import dill as d",
        "from joblib import load",
        "from marshal import loads as read",
        "def f():\n    import shelve",
        "import importlib\nimportlib.import_module('cloudpickle')",
        "__import__('pickle')",
        "import pandas as pd\npd.read_pickle(path)",
        "table.to_pickle(path)",
    ],
    "yaml": [
        "import yaml\nyaml.load(text)",
        "import yaml\nyaml.load(text, yaml.Loader)",
        "import yaml\nyaml.load(text, Loader=yaml.FullLoader)",
        "import yaml as y\ny.load_all(text, Loader=y.UnsafeLoader)",
        "from yaml import load\nload(text)",
        "from yaml import unsafe_load",
        "import yaml\nyaml.unsafe_load(text)",
        "import yaml\nLOADER = yaml.Loader\nyaml.parse(text, Loader=LOADER)",
        "import yaml\nyaml.load(text, Loader=getattr(yaml, 'CLoader', yaml.SafeLoader))",
    ],
    "torch": [
        "import torch\ntorch.load(path)",
        "import torch\ntorch.load(path, weights_only=False)",
        "import torch\ntorch.load(path, weights_only=flag)",
        "from torch import load\nload(path)",
        "import torch\ntorch.hub.load('a/b', 'c')",
    ],
    "numpy": [
        "import numpy as np\nnp.load(path, allow_pickle=True)",
        "import numpy as np\nnp.load(path, None, True)",
        "np.savez(path, allow_pickle=flag)",
    ],
    "eval": [
        "eval(text)",
        "exec(text, {})",
        "compile(text, 'a', 'exec')",
        "import builtins\nbuiltins.eval(text)",
        "import pandas as pd\npd.eval(text)",
        "table.query('trial < ' + n)",
        "table.query(f'trial < {n}')",
        "from sympy import sympify\nsympify(text)",
    ],
    "code": [
        "import runpy\nrunpy.run_path(path)",
        "from importlib.util import spec_from_file_location as s\ns(name, path)",
        "spec.loader.exec_module(module)",
    ],
    "shell": [
        "import os\nos.system('ls')",
        "from os import system as s\ns(command)",
        "import os\nos.popen(command)",
        "import os\nos.execvp(a, b)",
        "import subprocess\nsubprocess.run(command, shell=True)",
        "import subprocess\nsubprocess.run(command, shell=flag)",
        "import subprocess\nsubprocess.run(f'ls {name}')",
        "import subprocess as sp\nsp.check_output('ls ' + name)",
        "from subprocess import Popen\nPopen('ls {}'.format(name))",
        "import subprocess\nsubprocess.run(' '.join(parts))",
        "import subprocess\nsubprocess.getoutput(command)",
    ],
    "mktemp": ["import tempfile\ntempfile.mktemp()", "from tempfile import mktemp\nmktemp()"],
    "archive": [
        "import tarfile\ntarfile.open(path).extractall(folder)",
        "import shutil\nshutil.unpack_archive(path)",
        "zipped.extract(member, folder)",
    ],
    "network": [
        "import urllib.request",
        "from urllib import request",
        "from urllib.request import urlopen",
        "import requests",
        "import http.client",
        "import socket",
    ],
    "xml": ["import xml.etree.ElementTree as ET", "from lxml import etree"],
}


@pytest.mark.parametrize(("rule", "source"), [(rule, source) for rule in BAD for source in BAD[rule]])
def test_a_slip_is_found(rule, source):
    found = scan(source)
    assert {one.rule for one in found} == {rule}
    assert found[-1].line == source.count("\n") + 1


GOOD = [
    "import yaml\nyaml.safe_load(text)",
    "import yaml\nyaml.parse(text, Loader=yaml.SafeLoader)",
    "import yaml\nLOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)\nyaml.parse(text, Loader=LOADER)",
    "import torch\ntorch.load(path, map_location='cpu', weights_only=True)",
    "import numpy as np\nnp.load(path)\nnp.load(path, allow_pickle=False)",
    "import re\nre.compile('a')",
    "model.eval()",
    "table.query('trial < 20')",
    "tree.query(points)",
    "import subprocess\nsubprocess.run(['git', name], check=True)\nsubprocess.run(command)",
    "import tempfile\ntempfile.mkdtemp()",
    "from urllib.parse import quote",
    "zipped.open(info).read(9)",
]


@pytest.mark.parametrize("source", GOOD)
def test_what_is_safe_is_let_through(source):
    assert scan(source) == []


RULE = "rule a:\n    input:\n        lambda w: w.x,\n    output:\n        'b.csv',\n    {}\n"


@pytest.mark.parametrize(
    ("body", "rule", "line"),
    [
        ("shell:\n        'cp {input} {output}'", "shell", 6),
        ("shell: 'cp {wildcards.x} b.csv'", "shell", 6),
        ("run:\n        open(output[0], 'w')", "shell", 6),
        ("params:\n        a=__import__('os').popen('ls'),\n        b=eval('1'),", "eval", 8),
        ("script:\n        'a.py'\n\nimport subprocess\nsubprocess.run('ls', shell=True)", "shell", 10),
        ("script:\n        'a.py'\n\nimport pickle", "pickle", 9),
    ],
)
def test_a_slip_in_rules_is_found(body, rule, line):
    found = scan_rules(RULE.format(body), "a.smk")
    assert (rule, line) in {(one.rule, one.line) for one in found}


def test_rules_that_only_call_scripts_are_let_through():
    assert scan_rules(RULE.format("script:\n        '../scripts/a.py'"), "a.smk") == []
