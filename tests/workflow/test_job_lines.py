"""Lines for jobs that end, as a log of `make reproduce` has them."""

import re
import subprocess
import sys

import pytest

from tests.workflow.pipeline_copy import ROOT
from thesis_lib.job_lines import TRUST, UNMEASURED, job_lines

HEAD = """\
Provided cores: 2
Job stats:
job         count
--------  -------
all             1
fit             2
total           3

Job 1: Fitting the block
rule draw:
    output: a.png
    jobid: 2
    wildcards: shape=wheel
"""


def test_each_job_that_ends_has_a_line_with_what_is_done_and_what_is_left():
    (begin,) = job_lines(HEAD, {"fit": 100.0}, cpu=0.0, wall=1.0)
    assert begin == "3 jobs, about 3 min of CPU on this machine: about 2 min on 2 cores"
    # took half as long as expected; what is left shares two cores
    pace = (50.0 + TRUST) / (100.0 + TRUST)
    left = pace * (100.0 + UNMEASURED) / 2
    first = HEAD + "Finished jobid: 1 (Rule: fit)\n1 of 3 steps (33%) done\n"
    assert job_lines(first, {"fit": 100.0}, cpu=50.0, wall=60.0) == [
        begin,
        f"[1/3] fit: Fitting the block; 50 s of CPU in 60 s, about {left:.0f} s left",
    ]
    whole = first + "Finished jobid: 2 (Rule: fit)\nFinished jobid: 0 (Rule: all)\n"
    second, last = job_lines(whole, {"fit": 100.0}, cpu=100.0, wall=120.0)[2:]
    assert second.startswith("[2/3] fit: shape=wheel; 2 min of CPU in 2 min, about 0 s left")
    assert last == "[3/3] all; 2 min of CPU in 2 min"


SNAKEFILE = """
rule all:
    input: "a.txt", "b.txt"

rule write:
    output: "{name}.txt"
    message: "Writing {wildcards.name}"
    shell: "echo {wildcards.name} > {output}"
"""


@pytest.mark.slow
@pytest.mark.parametrize("logger", ["plain", "rich"])
def test_without_a_terminal_the_runner_prints_them(tmp_path, logger):
    (tmp_path / "Snakefile").write_text(SNAKEFILE)
    profile = tmp_path / "profiles/default/config.yaml"
    profile.parent.mkdir(parents=True)
    profile.write_text("cores: 1\nquiet: [host, reason]\n" + ("logger: [rich]\n" if logger == "rich" else ""))
    command = [sys.executable, "-m", "thesis_lib.pipeline", "all"]
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = re.findall(r"^\[(\d)/3\] (write: Writing [ab]|all); \d+ s of CPU in \d+ s", done.stdout, re.M)
    assert [number for number, _ in said] == ["1", "2", "3"]
    assert done.stdout.index("3 jobs, about ") < done.stdout.index("[1/3]")
    assert {name for _, name in said} == {"all", "write: Writing a", "write: Writing b"}
