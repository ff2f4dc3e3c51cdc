"""The pipeline and the command write the same critique, byte for byte (every file, pictures and page included)."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pipeline_copy import ROOT, bytes_in

NAME = "my_drops"


def command(folder: Path, *arguments: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "thesis_lib", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_command_and_pipeline_write_the_same_bytes(checkout, snakemake):
    command(checkout, "datasets", "example", "-o", f"data/measured/{NAME}", "--drops", "20")
    (checkout / "overlay.yaml").write_text(f"critique: {{datasets: [{NAME}]}}\n")
    done = snakemake(
        checkout, "--cores", "1", "--configfile", "overlay.yaml", "--", f"results/critique/{NAME}/report.html"
    )
    assert done.returncode == 0, done.stdout
    command(checkout, "critique", f"data/measured/{NAME}", "-o", "by_command", "-q")
    piped, commanded = bytes_in(checkout / "results/critique" / NAME), bytes_in(checkout / "by_command")
    assert set(piped) == set(commanded)
    assert {"report.html", "diagnosis.json", "comparison.csv", "ladder.png", "model.json"} <= set(piped)
    assert [name for name in piped if piped[name] != commanded[name]] == []
