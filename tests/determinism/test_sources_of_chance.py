"""No module uses what differs between two runs: clocks, unseeded generators, hashes of text, names of machines."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from tests.imported_names import ImportedNames

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(path for name in ("thesis_lib", "workflow") for path in (ROOT / name).rglob("*.py"))
TIMES = re.compile(r"(^|_)(cpu|wall_time|elapsed|runtime|walltime|seconds|timestamp|date|datetime|clock)(_|$)")

CLOCKS = {
    *(f"time.{name}{ns}" for name in ("time", "perf_counter", "process_time", "monotonic") for ns in ("", "_ns")),
    *("time.thread_time", "time.localtime", "time.gmtime", "time.strftime", "time.ctime", "os.times"),
    *("datetime.datetime.now", "datetime.datetime.utcnow", "datetime.datetime.today", "datetime.date.today"),
    *("pandas.Timestamp.now", "pandas.Timestamp.today", "resource.getrusage"),
}
CHANCE = {
    *("os.urandom", "uuid.uuid1", "uuid.uuid4", "os.getpid", "socket.gethostname", "platform.node", "getpass.getuser"),
    *("hash", "id"),
}
MODULES = {"random", "secrets"}
SEEDED = {"Generator", "SeedSequence", "BitGenerator", "PCG64", "default_rng"}

# where a clock is read, and what becomes of it
ALLOWED = {
    "thesis_lib/thesis/identify/programs/study.py": "CPU seconds for benchmarks.programs; programs_table drops them",
    "thesis_lib/studies/proof/proposals.py": "CPU seconds of a proposal, for the proof's table; no run writes it",
    "thesis_lib/studies/proof/space.py": "CPU seconds of a critique, for the proof's table; no run writes it",
    "thesis_lib/foundation/forked.py": "which process does the work; the result is the same in all",
    "thesis_lib/foundation/rows.py": "the day of a row of the proof; no run writes it",
    "thesis_lib/foundation/provenance.py": "a name for a file until it is whole, which it then loses",
}
# runs other programs and waits for them; no result passes through
WAITING = {"thesis_lib/thesis/pipeline.py", "thesis_lib/commands/batch.py", "thesis_lib/foundation/isolated.py"}


def chances(source: str) -> Iterator[tuple[int, str]]:
    """Line and name of each clock, unseeded draw and name of a machine."""
    tree = ast.parse(source)
    full_name = ImportedNames(tree).full
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield node.lineno, node.module
        if not isinstance(node, ast.Call):
            continue
        name = full_name(node.func)
        if name in CLOCKS | CHANCE:
            yield node.lineno, name
        elif name.startswith("numpy.random."):
            last = name.rpartition(".")[2]
            if last not in SEEDED or (last in ("default_rng", "SeedSequence") and not (node.args or node.keywords)):
                yield node.lineno, name


def test_clocks_and_chance_are_used_only_where_it_is_known():
    found = {}
    for path in FILES:
        name = path.relative_to(ROOT).as_posix()
        if seen := list(chances(path.read_text(encoding="utf-8"))):
            found[name] = seen
    assert len(FILES) > 250
    assert {name: seen for name, seen in found.items() if name not in {*ALLOWED, *WAITING}} == {}
    assert set(ALLOWED) <= set(found), "not needed any more"


@pytest.mark.parametrize(
    "source",
    [
        "import time\ntime.time()",
        "from time import perf_counter as p\np()",
        "import datetime\ndatetime.datetime.now()",
        "from datetime import datetime\ndatetime.now()",
        "import numpy as np\nnp.random.default_rng()",
        "import numpy as np\nnp.random.normal()",
        "import numpy as np\nnp.random.seed(1)",
        "import random",
        "from random import choice",
        "seed = hash('a')",
        "import os\nos.urandom(3)",
    ],
)
def test_a_source_of_chance_is_found(source):
    assert list(chances(source))


def test_seeded_draws_are_let_through():
    assert not list(chances("import numpy as np\nrng = np.random.default_rng(0)\nrng.normal()\nrng.random()"))


def keys(value: object) -> set[str]:
    if isinstance(value, dict):
        return set(value).union(*map(keys, value.values()))
    return set().union(*map(keys, value)) if isinstance(value, list) else set()


def test_no_column_holds_a_time_of_the_run():
    """Every column of every table is explained in columns.yaml, or the table is not written."""
    names = keys(yaml.safe_load((ROOT / "thesis_lib/foundation/columns.yaml").read_text(encoding="utf-8")))
    assert {"mu", "epsilon", "trial"} <= names
    assert [name for name in names if TIMES.search(name)] == []
