"""A copy of the pipeline in an empty folder, and Snakemake run in it."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pipeline_copy import copy_pipeline


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    return copy_pipeline(tmp_path / "checkout")


@pytest.fixture(scope="session")
def snakemake() -> Callable[..., subprocess.CompletedProcess]:
    """(checkout, *arguments) -> finished process; output holds stdout and stderr together, without colours."""

    def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
        environment = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHONPATH", "SNAKEMAKE"))}
        command = [sys.executable, "-m", "snakemake", "--workflow-profile", "none", "--nocolor", *arguments]
        return subprocess.run(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    return run
