"""Critique of many datasets: what one of them does is of no consequence to the others, and a batch goes on."""

import contextlib
import fcntl
import json
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from unruly_work import unruly

from thesis_lib.__main__ import main
from thesis_lib.commands.batch import Batch, find_datasets, run_batch
from thesis_lib.critique import criticise
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.report.batch_index import COLUMNS, INDEX_FILES, row_of_failure, write_index

PATIENCE = 60.0  # s that a busy machine may take for what takes no time
REASONS = {
    "crash": "crashed: RuntimeError: a defect",
    "killed": "was killed (SIGKILL); most likely the machine ran out of memory: use fewer --jobs",
    "nothing": "does not exist",
    "refused": r"The table is \x1b[31mempty",
    "segfault": "crashed (SIGSEGV)",
    "silent": "ended without an answer (exit code 3)",
}


@pytest.fixture
def folders(tmp_path: Path) -> Callable[..., list[Path]]:
    """Makes dataset folders by name; only the work decides what is in them."""

    def make(*names: str) -> list[Path]:
        for name in names:
            (tmp_path / "data" / name).mkdir(parents=True)
            (tmp_path / "data" / name / "dataset.yaml").write_text(name)
        return [tmp_path / "data" / name for name in names]

    return make


def statuses(batch: Batch) -> dict[str, str]:
    return {row["dataset"]: row["status"] for row in batch.rows}


def is_alive(pid: int) -> bool:
    with contextlib.suppress(FileNotFoundError):  # a zombie has ended, too
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    return False


def wait_for(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + PATIENCE
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


@pytest.mark.slow
def test_each_bad_dataset_is_listed_with_its_reason_and_stops_no_other(folders, tmp_path):
    out, said = tmp_path / "out", []
    paths = folders("good_a", *REASONS, "good_b", "good_c")
    batch = run_batch(paths, out, 0, jobs=3, work=unruly, say=said.append)
    assert statuses(batch) == {p.name: "done" if "good" in p.name else "failed" for p in paths}
    for row in batch.failed:
        assert REASONS[row["dataset"]] in row["reason"]
        log = (out / f"{row['dataset']}.log").read_text()
        assert "at work on" in log and "\x1b" not in log
    assert "RuntimeError: a defect" in (out / "crash.log").read_text()
    assert "Segmentation fault" in (out / "segfault.log").read_text()
    pids = [(out / f"{path.name}.pid").read_text() for path in paths]
    assert len(set(pids)) == len(paths) and str(os.getpid()) not in pids
    assert len(said) == len(paths) and said[-1].startswith("[9/9] ") and "left" not in said[-1]
    assert " left" in said[0]


@pytest.mark.parametrize(
    ("work", "limit", "reason"),
    [
        ("greedy", {"memory_limit": 1e9}, "took more memory than the limit of 1 GB"),
        ("hang", {"time_limit": 1.0}, "took longer than the time limit of 1 s"),
    ],
)
def test_one_that_passes_a_limit_is_ended(work, limit, reason, folders, tmp_path):
    batch = run_batch(folders(work, "good"), tmp_path / "out", 0, work=unruly, **limit)
    assert statuses(batch) == {work: "failed", "good": "done"} and batch.failed[0]["reason"] == reason
    assert not multiprocessing.active_children()


def test_the_index_holds_what_the_critiques_say(folders, tmp_path):
    batch = run_batch(folders("good", "crash"), tmp_path, 5, effects=("com_offset",), work=unruly)
    table = pd.read_csv(tmp_path / "batch.csv")
    assert tuple(table.columns) == COLUMNS
    good = table.iloc[0]
    assert good["effects"] == "com_offset/tilt + drift" and good["final_law"] == "whittaker"
    assert (good["n_impacts"], good["base"], good["augmented"]) == (7, 0.5, 0.25)
    content = json.loads((tmp_path / "batch.json").read_text())
    assert content["datasets"] == batch.rows
    assert (content["seed"], content["switched_on"], content["n_datasets"]) == (5, ["com_offset"], 2)
    page = (tmp_path / "index.html").read_text()
    assert "2 datasets: 1 effects, 1 failed." in page
    assert 'href="./good/report.html"' in page and 'href="./crash.log"' in page


def test_names_and_reasons_of_strangers_do_no_harm(tmp_path):
    name = '<script>"x"&:'
    write_index([row_of_failure(name, "<b>\x1b[2J\n" + "x" * 9999)], tmp_path, total=1, seed=0, effects=None)
    page = (tmp_path / "index.html").read_text()
    assert "<script>" not in page and "<b>" not in page and "\x1b" not in page and len(page) < 20_000
    assert 'href="./%3Cscript%3E%22x%22%26%3A.log"' in page


def test_what_is_done_is_skipped_unless_something_changed(folders, tmp_path):
    out, paths = tmp_path / "out", folders("good_a", "good_b", "good_c", "refused")

    def done_now(**changes) -> list[str]:
        told = {"seed": 0, "work": unruly} | changes
        batch = run_batch(paths, out, told.pop("seed"), **told)
        assert sorted(batch.skipped + [one.name for one in batch.finished]) == [p.name for p in paths]
        return sorted(one.name for one in batch.finished)

    everything = [path.name for path in paths]
    assert done_now() == everything
    index = {name: (out / name).read_bytes() for name in INDEX_FILES}
    assert done_now() == ["refused"]  # what failed is tried again
    assert {name: (out / name).read_bytes() for name in INDEX_FILES} == index
    (paths[0] / "trajectories.csv").write_text("trial")
    (out / "good_b" / "report.html").unlink()
    (out / "good_c" / "diagnosis.json").write_text("{")
    assert done_now() == everything
    assert json.loads((out / "good_c" / "diagnosis.json").read_text())
    (out / ".batch" / "good_a.json").write_text('{"key": ')
    assert done_now() == ["good_a", "refused"]
    assert done_now(seed=1) == everything
    assert done_now(seed=1, effects=("com_offset",)) == everything


def test_a_failure_takes_the_place_of_an_earlier_verdict_in_the_index(folders, tmp_path):
    (path,) = folders("good")
    run_batch([path], tmp_path, 0, work=unruly)
    (path / "dataset.yaml").write_text("changed")
    (tmp_path / "good" / "model.json").unlink()
    (tmp_path / "good" / "model.json").mkdir()  # cannot be written
    batch = run_batch([path], tmp_path, 0, work=unruly)
    assert statuses(batch) == {"good": "failed"} and "IsADirectoryError" in batch.failed[0]["reason"]
    assert pd.read_csv(tmp_path / "batch.csv")["verdict"].isna().all()


def test_ctrl_c_ends_the_processes_and_the_batch_goes_on_to_the_same_index(folders, tmp_path):
    out, paths = tmp_path / "out", folders("good_a", "hang", "good_b")

    def interrupted(text: str) -> None:
        assert wait_for((out / "hang.pid").is_file)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_batch(paths, out, 0, jobs=2, work=unruly, say=interrupted)
    pid = int((out / "hang.pid").read_text())
    assert wait_for(lambda: not is_alive(pid))
    assert "3 datasets: 1 effects, 2 not reached." in (out / "index.html").read_text()
    del paths[1]
    again = run_batch(paths, out, 0, work=unruly)
    assert again.skipped == ["good_a"] and statuses(again) == {"good_a": "done", "good_b": "done"}
    run_batch(paths, tmp_path / "uninterrupted", 0, work=unruly)
    for name in INDEX_FILES:
        assert (out / name).read_bytes() == (tmp_path / "uninterrupted" / name).read_bytes()


@pytest.mark.slow
def test_no_process_outlives_a_parent_that_is_killed(folders, tmp_path):
    out, paths = tmp_path / "out", folders("hang_a", "hang_b")
    script = Path(__file__).with_name("unruly_work.py")
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}
    parent = subprocess.Popen([sys.executable, str(script), str(out), *map(str, paths)], env=environment)
    files = [out / f"{path.name}.pid" for path in paths]
    try:
        assert wait_for(lambda: all(file.is_file() and file.read_text() for file in files))
    finally:
        parent.kill()
        parent.wait()
    assert wait_for(lambda: not any(is_alive(int(file.read_text())) for file in files))
    with (out / ".batch" / "lock").open() as lock:  # and the folder is free
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_two_batches_do_not_write_into_one_folder(folders, tmp_path):
    paths = folders("good")
    run_batch(paths, tmp_path / "out", 0, work=unruly)
    with (tmp_path / "out" / ".batch" / "lock").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(UserError, match="Another batch"):
            run_batch(paths, tmp_path / "out", 0, work=unruly)


def test_results_never_go_where_the_data_are_and_names_that_a_batch_cannot_use_are_refused(folders, tmp_path):
    (path,) = folders("good")
    for name in ("index.html", "good.log", "line\nbreak"):
        with pytest.raises(UserError, match="rename"):
            run_batch([path, *folders(name)], tmp_path / "out", 0, work=unruly)
        assert not (tmp_path / "out").exists()
    other = tmp_path / "elsewhere" / "good"
    with pytest.raises(UserError, match="Two datasets are called good"):
        run_batch([path, other], tmp_path / "out", 0, work=unruly)
    with pytest.raises(UserError, match="choose another"):
        run_batch([path], tmp_path / "data", 0, work=unruly)
    with pytest.raises(UserError, match="There is no effect 'magic'"):
        run_batch([path], tmp_path / "out", 0, effects=("magic",), work=unruly)


def test_datasets_are_found_in_folders(folders, tmp_path):
    paths = folders("b", "a", ".hidden")
    (tmp_path / "data" / "notes").mkdir()
    (tmp_path / "data" / "no_header").mkdir()
    (tmp_path / "data" / "no_header" / "impacts.csv").write_text("")  # a dataset, if a bad one
    found, others = find_datasets([tmp_path / "data", paths[0]])
    assert [path.name for path in found] == ["a", "b", "no_header"]
    assert [path.name for path in others] == ["notes"]
    missing = tmp_path / "missing"
    assert find_datasets([missing, tmp_path / "data" / "notes"]) == ([missing, tmp_path / "data" / "notes"], [])


def test_the_command_lists_failures_and_has_the_exit_codes_that_it_says(folders, tmp_path, capsys):
    folders("one", "two")
    command = ["critique", "--batch", str(tmp_path / "data"), "-o", str(tmp_path / "out")]
    assert main(command) == 1
    shown = capsys.readouterr()
    assert "2 datasets: 2 failed" in shown.out and str(tmp_path / "out" / "one.log") in shown.out
    assert "The dataset one has" in shown.out and "[2/2]" in shown.err
    assert main([*command, "--json", "-q"]) == 1
    shown = capsys.readouterr()
    assert len(json.loads(shown.out)["datasets"]) == 2 and shown.err == ""


@pytest.mark.slow
def test_a_dataset_of_a_batch_has_the_bytes_of_its_own_critique(impacts_dataset, tmp_path):
    write_dataset(impacts_dataset, tmp_path / "data" / "drops", float_format=None)
    (tmp_path / "data" / "bad").mkdir()
    (tmp_path / "data" / "bad" / "impacts.csv").write_text("trial")
    out = tmp_path / "out"
    assert main(["critique", "--batch", str(tmp_path / "data"), "-o", str(out), "-q", "--seed", "3"]) == 1
    assert pd.read_csv(out / "batch.csv")["verdict"].fillna("").tolist() == ["", "effects"]
    criticise(tmp_path / "data" / "drops", seed=3).save(tmp_path / "alone")
    one, two = (
        {path.name: path.read_bytes() for path in (folder).iterdir()} for folder in (out / "drops", tmp_path / "alone")
    )
    assert set(one) == set(two) and {"report.html", "ladder.png", "where.png"} <= set(one)
    assert [name for name in one if one[name] != two[name]] == []
