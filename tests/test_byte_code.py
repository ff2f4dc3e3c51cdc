"""Jobs of a run keep byte code, also where the environment says not to."""

import os
import subprocess
import sys
from pathlib import Path

from thesis_lib.foundation.byte_code import keep_byte_code

ROOT = Path(__file__).resolve().parent.parent
JOB = "import subprocess, sys; {}; subprocess.run([sys.executable, '-c', 'import studied'], check=True)"
KEEP = "from thesis_lib.foundation.byte_code import keep_byte_code; keep_byte_code()"


def written(folder: Path, first: str) -> list[Path]:
    """Byte code that a child of a process writes, which does `first` in an environment without byte code."""
    (folder / "studied.py").write_text("x = 1\n")
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPYCACHEPREFIX"}
    environment |= {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": f"{folder}:{ROOT}"}
    subprocess.run([sys.executable, "-c", JOB.format(first)], env=environment, check=True)
    return list(folder.rglob("*.pyc"))


def test_children_write_byte_code_and_would_not_otherwise(tmp_path):
    assert not written(tmp_path, "pass") and written(tmp_path, KEEP)


def test_this_process_writes_too(monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    keep_byte_code()
    assert not sys.dont_write_bytecode and "PYTHONDONTWRITEBYTECODE" not in os.environ
