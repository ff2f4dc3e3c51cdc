"""The mutation fuzzer in small (python -m tests.fuzz.mutate is the whole), and proof that it finds what is wrong."""

import os
import time
from pathlib import Path

import pytest

from tests.fuzz import sandbox
from tests.fuzz.mutate import fuzz, table
from tests.fuzz.readers import READERS
from tests.fuzz.sandbox import ACCEPTED, FAILED, REFUSED, SECRET, Pool, Task
from thesis_lib.foundation.errors import UserError

INPUTS = 250
SEED = 7
LIMIT = 0.5  # s of processor time in the tests of the sandbox itself


@pytest.mark.slow
def test_spoilt_inputs_are_read_or_refused_with_the_name_of_the_file(tmp_path):
    found = fuzz(INPUTS, SEED, list(READERS), tmp_path, thin=7)
    failures = [f"{name}, input {index}: {one.message}" for name, index, one in found if one.status == FAILED]
    assert not failures, "\n".join(failures)
    assert len(found) == INPUTS
    text = table(found)
    for name in READERS:
        some = [outcome.status for reader, _, outcome in found if reader == name]
        assert REFUSED in some or name == "commands", text
        assert ACCEPTED in some or name == "published", text


def _refuse(text: str) -> None:
    raise UserError(text)


BAD = {
    "an exception": (lambda folder, out: [][0], "IndexError"),
    "an exit": (lambda folder, out: exit(3), "SystemExit"),
    "a message without the file": (lambda folder, out: _refuse("something is wrong"), "names no file"),
    "a leak": (
        lambda folder, out: _refuse(f"a.txt: {(folder.parent / 'secret.txt').read_text()}"),
        "outside the folder",
    ),
    "a stray file": (lambda folder, out: Path("stray").write_text("x"), "stray"),
    "a file that is gone again": (lambda folder, out: _write_and_remove(folder.parent), "forbidden"),
    "a program": (lambda folder, out: os.system("true"), "os.system"),
    "a slow one": (lambda folder, out: _burn(1.2 * LIMIT), "took"),
    "a crash": (lambda folder, out: os.abort(), "crashed: -6"),
    "too much memory": (lambda folder, out: bytearray(2 << 30), "MemoryError"),
    "one that never ends": (lambda folder, out: _burn(1e9), "hangs"),
}


def _write_and_remove(folder: Path) -> None:
    (folder / "x").write_text("x")
    (folder / "x").unlink()


def _burn(seconds: float) -> None:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


@pytest.mark.slow
def test_the_sandbox_finds_bad_readers_and_goes_on(tmp_path, monkeypatch):
    """Each bad reader is told by its fault, and the one after it is read as if nothing had been."""
    monkeypatch.setattr(sandbox, "CPU_LIMIT", LIMIT)
    cases = [*BAD.values(), (lambda folder, out: (out / "fine").write_text("x"), "")]
    names = [*BAD, "a good one"]

    def make(index: int) -> tuple[Task, tuple[str, ...]]:
        return Task(lambda folder, secret: (folder / "a.txt").write_text("x"), cases[index][0]), ("a.txt",)

    pool = Pool(make, tmp_path)
    outcomes = dict(pool.run(range(len(cases))))
    pool.close()
    for index, (_, words) in enumerate(cases):
        outcome = outcomes[index]
        assert outcome.status == (ACCEPTED if names[index] == "a good one" else FAILED), names[index]
        assert words in outcome.message, (names[index], outcome.message)


@pytest.mark.parametrize("read", [lambda folder, out: _refuse(f"a.txt: {SECRET}"), lambda folder, out: None])
def test_readers_of_files_that_the_user_names_may_follow_links(tmp_path, read):
    def make(index: int) -> tuple[Task, tuple[str, ...]]:
        return Task(lambda folder, secret: None, read, contained=False), ("a.txt",)

    pool = Pool(make, tmp_path)
    ((_, outcome),) = pool.run(range(1))
    pool.close()
    assert outcome.status in (ACCEPTED, REFUSED)
