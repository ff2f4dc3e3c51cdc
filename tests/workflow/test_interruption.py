"""The runner of the pipeline: one at a time, clears away what a killed run left, and says what went wrong."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.workflow.interruption import study
from tests.workflow.pipeline_copy import ROOT
from tests.workflow.ways_to_stop import WAYS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text
from thesis_lib.thesis import pipeline

SLOW_JOB = "import time; print('up', flush=True); time.sleep(60)"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """The current folder, with a Snakefile and a lock that Snakemake has left."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pipeline, "PATIENCE", 2.0)
    (tmp_path / "Snakefile").touch()
    (tmp_path / ".snakemake/locks").mkdir(parents=True)
    (tmp_path / ".snakemake/locks/0.output.lock").touch()
    return tmp_path


@pytest.fixture
def start():
    """(words, folder) -> process that has written its first line; ended after the test."""
    started = []

    def run(words: list[str], cwd: Path) -> subprocess.Popen:
        command = [sys.executable, *words]
        process = subprocess.Popen(command, cwd=cwd, stdout=subprocess.PIPE, text=True, start_new_session=True)
        started.append(process)
        started[-1].said = started[-1].stdout.readline().strip()
        return started[-1]

    yield run
    for process in started:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # with its jobs, which would hold its output open
        process.communicate()


def job(folder: Path) -> list[str]:
    path = folder / ".snakemake/scripts/tmpabc.slow.py"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(SLOW_JOB)
    return [str(path)]


UNLOCK = [sys.executable, "-c", "import shutil; shutil.rmtree('.snakemake/locks')"]


class TestWhatAKilledRunLeft:
    def test_orphans_are_ended_and_the_lock_released(self, folder, start, capsys):
        orphan = start(job(folder), folder)
        pipeline.recover(UNLOCK)
        with pytest.raises(ProcessLookupError):
            os.kill(orphan.pid, 0)
        assert not (folder / ".snakemake/locks").exists()
        assert "An earlier run was killed; 1 of its processes" in capsys.readouterr().err

    def test_jobs_of_other_folders_are_left_alone(self, folder, start, tmp_path_factory):
        elsewhere = tmp_path_factory.mktemp("elsewhere")
        stranger = start(job(elsewhere), elsewhere)
        pipeline.recover(UNLOCK)
        with pytest.raises(subprocess.TimeoutExpired):
            stranger.wait(timeout=0.5)

    def test_living_snakemake_keeps_its_lock_and_its_jobs(self, folder, start):
        (folder / "snakemake").write_text(f"import subprocess, sys; subprocess.run([sys.executable, *{job(folder)}])")
        living = start(["snakemake"], folder)  # its job has said that it is up
        with pytest.raises(UserError, match=rf"at work in {folder} \(process {living.pid}\)"):
            pipeline.recover(UNLOCK)
        shutil.rmtree(folder / ".snakemake/locks")  # as of a dry run, which takes none
        pipeline.recover(["false"])
        assert living.poll() is None

    def test_a_clean_folder_is_left_alone_without_a_word(self, folder, capsys):
        shutil.rmtree(folder / ".snakemake/locks")
        pipeline.recover(["false"])
        assert capsys.readouterr().err == ""

    def test_a_lock_that_stays_is_an_error_with_the_reason(self, folder):
        with pytest.raises(UserError, match="wrong key"):
            pipeline.recover([sys.executable, "-c", "import sys; sys.exit('wrong key')"])


class TestOneAtATime:
    def test_a_second_run_is_refused_until_the_first_has_ended(self, folder):
        first = pipeline.hold_lock()
        with pytest.raises(UserError, match=rf"process {os.getpid()}\)"):
            pipeline.hold_lock()
        os.close(first)
        os.close(pipeline.hold_lock())

    def test_snakemake_holds_the_lock_when_its_runner_is_killed(self, folder, start):
        child = "import os, time; print(os.getpid(), flush=True); time.sleep(60)"
        code = (
            f"import sys; sys.path.insert(0, {str(ROOT)!r}); from thesis_lib.thesis import pipeline as p; "
            f"p._snakemake([sys.executable, '-c', {child!r}], p.hold_lock())"
        )
        runner = start(["-c", code], folder)
        runner.kill()
        runner.wait()
        with pytest.raises(UserError, match="Another run is at work"):
            pipeline.hold_lock()
        os.kill(int(runner.said), 9)
        end = time.monotonic() + 60
        while time.monotonic() < end:  # the kernel releases it some time after the kill
            try:
                os.close(pipeline.hold_lock())
                return
            except UserError:
                continue
        pytest.fail("the lock of a killed run is still held")


class TestChecksBeforeTheStart:
    def test_nearly_full_disk(self, folder, monkeypatch):
        monkeypatch.setattr(
            shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10**9, 10**9 - 7_000_000, 7_000_000)
        )
        with pytest.raises(UserError, match="7 MB are free, this run may need 250 MB"):
            pipeline.run()
        pipeline.check_folder(5)

    def test_folder_of_somebody_else(self, folder, monkeypatch):
        (folder / "results").mkdir()
        monkeypatch.setattr(os, "access", lambda path, mode: path.name != "results")
        with pytest.raises(UserError, match="results cannot be written"):
            pipeline.check_folder(0)

    def test_not_in_the_repository(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(UserError, match="no Snakefile"):
            pipeline.check_folder(0)


def failure(rule: str, before: str = "") -> str:
    log = f"results/logs/{rule}.log (check log file(s) for error details)"
    return f"{before}\nError in rule {rule}:\n    message: None\n    jobid: 3\n    log: {log}\nLogfile follows\n"


GO_ON, THEN, MENDED = "To go on:", "would fail there again", "Once it is fixed:"


@pytest.mark.parametrize(
    ("code", "log", "job_log", "told"),
    [
        (1, failure("a", "died with <Signals.SIGKILL: 9>."), "", ["failed: a, log: results/logs", "memory", GO_ON]),
        (1, failure("a"), "OSError: [Errno 28] No space left on device", ["failed: a", "disk is full", GO_ON]),
        (1, failure("a"), "numpy._core.MemoryError: Unable to allocate", ["ran out of memory", "--cores 1", GO_ON]),
        (1, failure("a") + failure("b"), "ValueError: x", ["failed: a", "    ValueError: x", "failed: b", THEN]),
        (1, failure("a"), "thesis_lib.foundation.errors.UserError: Give x.", ["failed: a", "\n    Give x.", THEN]),
        (-9, "", "", ["Snakemake itself was killed", GO_ON]),
        (1, "", "", ["No job has failed", MENDED]),
    ],
)  # fmt: skip
def test_failures_are_explained(folder, code, log, job_log, told):
    """What the same command would meet again is not advised; what may be gone by then is."""
    write_text(job_log, folder / "results/logs/a.log")
    text = pipeline.explain(code, log)
    for words in [*told, "Nothing that was finished is lost."]:
        assert words in text
    assert sum(words in text for words in (GO_ON, THEN, MENDED)) == 1
    assert ("cause:" in text) == (GO_ON in told)


def test_exit_code_is_that_of_snakemake(folder, capsys):
    lock = pipeline.hold_lock()
    assert pipeline._snakemake([sys.executable, "-c", "raise SystemExit(3)"], lock) == 3
    killed = "import os; os.kill(os.getpid(), 9)"
    assert pipeline._snakemake([sys.executable, "-c", killed], lock) == 128 + 9
    os.close(lock)


@pytest.mark.slow
def test_pipeline_survives_interruptions():
    ways = [way for way in WAYS if way.name in ("kill -9 of Snakemake", "full disk")]
    done = study(2, 0, ("ch4_schematics", "results/impacts/drops/summary.json"), ways=ways)
    assert len(done.kills) == 2 and {kill.way for kill in done.kills} == {way.name for way in ways}
    assert done.faults == []
