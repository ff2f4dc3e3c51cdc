"""`pip install .` gives a library that criticises a dataset anywhere, with what pyproject.toml declares and no more."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.contact import LAWS

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# pinned for the pipeline, its chapters and the checks: a critique must do without
EXTRA = {"pydrake", "torch", "gpytorch", "mujoco", "gymnasium", "jax", "numpyro", "snakemake", "pytest"}
HEADER = """\
schema: 1
body: {shape: {kind: ellipse, semi_axes: [0.035, 0.025]}, mass: 0.0364, radius_of_gyration: 0.0192}
noise: {position: 3.0e-4, angle: 3.0e-3, velocity: 0.01, angular_velocity: 0.5}
"""
USE = """\
import json, sys
import numpy as np
import thesis_lib
from thesis_lib.critique import criticise
from thesis_lib.datasets import read_dataset
found = criticise(read_dataset("my_drops"), rng=np.random.default_rng(0), effects=[])
loaded = [name for name in sys.modules if "." not in name]
print(json.dumps({"from": thesis_lib.__file__, "verdict": found.verdict, "laws": list(found.laws), "loaded": loaded}))
"""


def test_dependencies_are_those_that_the_tests_run_with():
    pinned = dict(re.findall(r"^([\w-]+)==(\S+)$", (ROOT / "environment.txt").read_text(encoding="utf-8"), re.M))
    optional = [text for texts in PROJECT.get("optional-dependencies", {}).values() for text in texts]
    for text in [*PROJECT["dependencies"], *optional]:
        name, least = text.split(">=")
        assert pinned[name] == least, f"pyproject.toml asks for {text}, environment.txt has {pinned[name]}"


def run(*command: str | Path, folder: Path, path: Path | None = None) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"OMP_NUM_THREADS": "1"} | ({"PYTHONPATH": str(path)} if path else {})
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> Path:
    """A copy to build from, because setuptools leaves its traces where it builds."""
    folder = tmp_path_factory.mktemp("build") / "source"
    shutil.copytree(ROOT / "thesis_lib", folder / "thesis_lib", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE", "Makefile", "environment.txt"):
        shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def wheel(source) -> Path:
    """Built without network."""
    folder = source.parent
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index")
    run(*pip, "--wheel-dir", folder, source, folder=folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel) -> Path:
    target = wheel.parent / "site"
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-compile")
    run(*pip, "--target", target, wheel, folder=wheel.parent)
    return target


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_the_package(wheel):
    held = set(zipfile.ZipFile(wheel).namelist())
    ours = {p.relative_to(ROOT).as_posix() for p in (ROOT / "thesis_lib").rglob("*") if p.is_file()}
    assert {path for path in ours if "__pycache__" not in path} <= held


def write_impacts(folder: Path, n: int = 120) -> None:
    """Impacts of an ellipse that obey one of the six laws, with the noise that the header states."""
    rng = np.random.default_rng(0)
    v, theta = rng.normal([0.0, -1.8, 0.0], [0.6, 0.3, 5.0], (n, 3)), rng.uniform(-np.pi, np.pi, n)
    r = Ellipse(semi_axes=(0.035, 0.025)).contact_point(theta)
    after = LAWS["mirtich"](v, r, mass=0.0364, k_g=0.0192, mu=0.15, epsilon=0.55)
    kept = after.status == 0
    noise = [0.01, 0.01, 0.5] * rng.normal(size=(2, n, 3))
    columns = ["x", "y", "theta", "vx_pre", "vy_pre", "omega_pre", "vx_post", "vy_post", "omega_post"]
    values = np.column_stack([np.zeros(n), -r[:, 1], theta, v + noise[0], after.v_post + noise[1]])[kept]
    table = pd.DataFrame(values, columns=columns)
    table.insert(0, "trial", np.arange(len(table)))
    table.insert(1, "impact", 0)
    folder.mkdir()
    table.to_csv(folder / "impacts.csv", index=False)
    (folder / "dataset.yaml").write_text(HEADER, encoding="utf-8")


@pytest.mark.slow
def test_the_installed_library_criticises_a_dataset_elsewhere(installed, tmp_path):
    write_impacts(tmp_path / "my_drops")
    script = tmp_path / "use.py"
    script.write_text(USE, encoding="utf-8")
    answer = json.loads(run(sys.executable, script, folder=tmp_path, path=installed))
    assert Path(answer["from"]).is_relative_to(installed)
    assert answer["verdict"] == "adequate" and len(answer["laws"]) >= 6
    assert not EXTRA & set(answer["loaded"])


@pytest.mark.slow
def test_after_make_setup_a_short_command_runs_the_code_of_the_checkout_from_any_folder(source, tmp_path):
    """A second environment that sees the packages of this one; `make setup` has only its command to add."""
    environment = source / ".venv"
    venv.create(environment, symlinks=True)
    (packages,) = environment.glob("lib/python*/site-packages")
    (packages / "those_of_the_tests.pth").write_text(sysconfig.get_path("purelib"))
    pip = environment / "bin" / "pip"
    pip.write_text(f'#!/bin/sh\nexec {environment}/bin/python -m pip "$@"\n')
    pip.chmod(0o755)
    (environment / ".installed").touch()
    run("make", "setup", folder=source)

    command = environment / "bin" / "thesis-lib"
    assert "com_offset" in run(command, "effects", folder=tmp_path)
    with (source / "thesis_lib" / "__main__.py").open("a", encoding="utf-8") as stream:
        stream.write('\nHELP = "edited"\n')
    assert run(command, "--help", folder=tmp_path) == "edited"


@pytest.mark.parametrize("words", [["thesis_lib", "critique", "x"], ["thesis_lib.pipeline"]], ids=" ".join)
def test_outside_the_environment_one_sentence_says_how_to_come_in(words):
    bare = [sys.executable, "-S", "-m", *words]  # without packages
    done = subprocess.run(bare, cwd=ROOT, env={}, capture_output=True, text=True)
    (sentence,) = done.stderr.strip().splitlines()
    assert done.returncode == 2 and f". {ROOT}/.venv/bin/activate" in sentence, done.stderr
    assert "is not installed in this Python" in sentence
