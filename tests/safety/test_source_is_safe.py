"""No module of this project runs what it reads: ruff's rules, imports that are banned, and what ruff lets pass.

| what must not be done with data from others                                | found by                     |
|----------------------------------------------------------------------------|------------------------------|
| run code from a file: pickle and its kin, HDF, Python of others            | banned imports, S301, S302   |
| load YAML with other loaders than the safe ones                            | banned imports, S506         |
| `torch.load` without `weights_only=True`, `np.load` with `allow_pickle`    | `SLIPS`                      |
| evaluate a text                                                            | banned imports, S102, S307   |
| hand a text to a shell                                                     | S602, S604, S605, `SLIPS`    |
| take a file name that another process can take first                       | S306                         |
| unpack to paths that an archive chooses                                    | S202, banned imports         |
| open connections; parse XML with parsers that unfold entities              | banned imports, S31          |

Where a rule is broken and why it is right there stands in pyproject.toml, file by file.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PYTHON = [path for name in ("thesis_lib", "workflow", "benchmarks", "tests") for path in (ROOT / name).rglob("*.py")]
SLIPS = re.compile(
    r"allow_pickle(?!=False)|weights_only=(?!True)|torch\.load\((?!.*weights_only=True)|\.to_pickle\(|\bexec_module\("
    r"|import_module\([^)]*pickle|__import__\([^)]*pickle|(?:subprocess\.\w+|Popen)\(\s*(?:f?[\"']|[\"'] *\.join)"
    r"|\.query\((?:f[\"']|[\"'][^\"']*[\"'] *\+)"
)
# ruff does not read rules: they call scripts, so that no wildcard or name ever reaches a shell
RULES = [ROOT / "Snakefile", *(ROOT / "workflow" / "rules").glob("*.smk")]
IN_RULES = re.compile(r"^\s*(?:shell|run|wrapper|notebook)\s*:|\b(?:eval|exec|system|popen)\(|pickle|subprocess", re.M)

BAD = [
    *("import pickle", "import dill as d", "from joblib import load", "from marshal import loads as read"),
    *(
        "def f():\n    import shelve",
        "import importlib\nimportlib.import_module('cloudpickle')",
        "__import__('pickle')",
    ),
    *("import pandas as pd\npd.read_pickle(path)", "table.to_pickle(path)", "import runpy\nrunpy.run_path(path)"),
    *("from importlib.util import spec_from_file_location as s\ns(name, path)", "spec.loader.exec_module(module)"),
    *("import yaml\nyaml.load(text)", "import yaml\nyaml.load(text, Loader=yaml.FullLoader)"),
    *("import yaml as y\ny.load_all(text, Loader=y.UnsafeLoader)", "from yaml import unsafe_load"),
    *("import yaml\nLOADER = yaml.Loader\nyaml.parse(text, Loader=LOADER)", "import torch\ntorch.load(path)"),
    *("import torch\ntorch.load(path, weights_only=flag)", "import torch\ntorch.hub.load('a/b', 'c')"),
    *("import numpy as np\nnp.load(path, allow_pickle=True)", "np.savez(path, allow_pickle=flag)"),
    *(
        "__import__('pickle')",
        "exec(text, {})",
        "import builtins\nbuiltins.eval(text)",
        "import pandas as pd\npd.eval(text)",
    ),
    *("table.query(f'trial < {n}')", "table.query('trial < ' + n)", "from sympy import sympify\nsympify(text)"),
    *("import os\nos.system('ls')", "from os import system as s\ns(command)", "import os\nos.popen(command)"),
    *("import subprocess\nsubprocess.run(command, shell=True)", "import subprocess\nsubprocess.run(f'ls {name}')"),
    *("import subprocess\nsubprocess.run(' '.join(parts))", "import subprocess\nsubprocess.getoutput(command)"),
    *("import tempfile\ntempfile.mktemp()", "import tarfile\ntarfile.open(path).extractall(folder)"),
    *("import shutil\nshutil.unpack_archive(path)", "from urllib import request", "import requests", "import socket"),
    *("import xml.etree.ElementTree as ET", "from lxml import etree"),
]
GOOD = [
    *("import yaml\nyaml.safe_load(text)", "import yaml\nyaml.parse(text, Loader=yaml.SafeLoader)"),
    *("import torch\ntorch.load(path, map_location='cpu', weights_only=True)", "import re\nre.compile('a')"),
    *("import numpy as np\nnp.load(path)\nnp.load(path, allow_pickle=False)", "model.eval()", "tree.query(points)"),
    *("table.query('trial < 20')", "import subprocess\nsubprocess.run(['git', name], check=True)"),
    *("import tempfile\ntempfile.mkdtemp()", "from urllib.parse import quote", "zipped.open(info).read(9)"),
]


def by_ruff(folder: Path) -> set[str]:
    """Names of the files in which ruff finds what is not safe."""
    command = [sys.executable, "-m", "ruff", "check", str(folder), "--config", str(ROOT / "pyproject.toml")]
    done = subprocess.run([*command, "--output-format", "json"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stderr
    return {Path(one["filename"]).name for one in json.loads(done.stdout) if re.match(r"S\d|TID", one["code"])}


def slips(path: Path) -> set[str]:
    """What ruff lets pass, with the file."""
    text = path.read_text(encoding="utf-8")
    return {f"{path.relative_to(ROOT).as_posix()}: {match[0]}" for match in SLIPS.finditer(text)}


def test_the_project_breaks_no_rule_but_where_it_is_allowed():
    assert len(PYTHON) > 300
    assert by_ruff(ROOT) == set()
    assert len(RULES) >= 9
    for path in RULES:
        text = path.read_text(encoding="utf-8")
        assert not IN_RULES.search(text) and not SLIPS.search(text), path.name
    assert set().union(*(slips(path) for path in PYTHON if path != Path(__file__))) == set()


def test_slips_are_found_and_what_is_safe_is_let_through(tmp_path):
    for kind, sources in (("bad", BAD), ("good", GOOD)):
        for i, source in enumerate(sources):
            (tmp_path / f"{kind}_{i}.py").write_text(f"{source}\n", encoding="utf-8")
    found = by_ruff(tmp_path)
    found |= {path.name for path in tmp_path.iterdir() if SLIPS.search(path.read_text(encoding="utf-8"))}
    assert IN_RULES.search("rule a:\n    shell:\n        'cp {input} {output}'")
    assert found == {f"bad_{i}.py" for i in range(len(BAD))}
