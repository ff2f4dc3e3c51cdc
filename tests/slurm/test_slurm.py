"""The quick pipeline on a real Slurm of two nodes, one of which dies on the way: the results are those of a local run.

Opt-in, because it starts daemons as root and takes half an hour: make test-slurm.  SLURM_TARGETS=chapter3 runs a part.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from two_nodes import seconds_of, two_nodes, why_not

from tests.workflow.pipeline_copy import ROOT, bytes_in, copy_pipeline
from thesis_lib.thesis.config import read_config

TARGETS = os.environ.get("SLURM_TARGETS", "all").split()
KILLED = "node2"
BEFORE_THE_KILL = 3  # jobs that are complete by then
IN_THE_MIDST_S = 4.0  # so long the victim has run
POLL_S = 1.0
LONGEST_S = 3600.0

REASON = "opt-in: make test-slurm" if os.environ.get("TEST_SLURM") != "1" else why_not()
pytestmark = [pytest.mark.slow, pytest.mark.skipif(REASON is not None, reason=str(REASON))]


def start(folder: Path, *arguments: str) -> subprocess.Popen:
    """Snakemake at the quick scale in a fresh copy of the pipeline; its output goes into snakemake.log."""
    measured = [str((ROOT / path).resolve()) for path in read_config(ROOT / "config/config.yaml").measured]
    copy_pipeline(folder)
    (folder / "here.yaml").write_text(yaml.safe_dump({"measured": measured}))
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHONPATH", "SNAKEMAKE", "SLURM"))}
    command = [sys.executable, "-m", "snakemake", *arguments, "--nocolor"]
    with (folder / "snakemake.log").open("w") as log:
        return subprocess.Popen(
            [*command, "--configfile", "config/quick.yaml", "here.yaml", "--", *TARGETS],
            cwd=folder,
            env=environment,
            stdout=log,
            stderr=subprocess.STDOUT,
        )


def files(folder: Path) -> dict[str, bytes]:
    """Everything that a run made, logs and times apart."""
    found = {
        f"{part}/{name}": content for part in ("results", "data") for name, content in bytes_in(folder / part).items()
    }
    return {name: content for name, content in found.items() if "logs" not in Path(name).parts}


def said(folder: Path) -> str:
    return (folder / "snakemake.log").read_text()


def test_a_node_dies_and_the_results_are_those_of_a_local_run(tmp_path):
    local, spread = tmp_path / "local", tmp_path / "slurm"
    begin = time.monotonic()
    done = start(local, "--cores", "2").wait(LONGEST_S)
    assert done == 0, said(local)
    local_s = time.monotonic() - begin

    with two_nodes(tmp_path / "cluster") as cluster:
        begin, killed_at, killed = time.time(), None, []
        options = ["--profile", "profiles/slurm", "--slurm-status-command", "squeue", "--latency-wait", "10"]
        options += ["--slurm-init-seconds-before-status-checks", "2", "--seconds-between-status-checks", "2"]
        process = start(spread, *options)
        try:
            while process.poll() is None:
                assert time.time() - begin < LONGEST_S, said(spread)
                time.sleep(POLL_S)
                if killed_at is not None or cluster.completed().total() < BEFORE_THE_KILL:
                    continue
                if any(seconds > IN_THE_MIDST_S for seconds in cluster.running(KILLED).values()):
                    killed, killed_at = cluster.kill(KILLED), time.time()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        wall_s = time.time() - begin
        finished, completed = cluster.finished(), cluster.completed()

    assert process.returncode == 0, said(spread)
    assert killed, "the pipeline ended before a node could be killed"
    lost = [job for job in finished if job["JobId"] in killed]
    assert {job["JobId"]: job["JobState"] for job in lost} == dict.fromkeys(killed, "NODE_FAIL")
    noticed_s = max(seconds_of(job["EndTime"]) for job in lost) - killed_at
    wasted_s = sum(killed_at - seconds_of(job["StartTime"]) for job in lost)
    assert set(completed) == {"node1", "node2"}  # both worked
    ours, theirs = files(spread), files(local)
    print(
        f"\n{' '.join(TARGETS)}: local {local_s:.0f} s on 2 cores, Slurm {wall_s:.0f} s; completed {dict(completed)};",
        f"{KILLED} died after {killed_at - begin:.0f} s with {len(killed)} job(s) of {wasted_s:.0f} s,",
        f"which Slurm noticed {noticed_s:.0f} s later; {len(theirs)} files to compare",
    )
    assert set(ours) == set(theirs) and len(ours) > 10
    assert [name for name in ours if ours[name] != theirs[name]] == []
