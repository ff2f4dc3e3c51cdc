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

import thesis_lib
from thesis_lib.bodies.shapes import Ellipse
from thesis_lib.contact import LAWS

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# pinned for the pipeline, its chapters and the checks: a critique must do without
EXTRA = {"pydrake", "torch", "gpytorch", "mujoco", "pybullet", "gymnasium", "jax", "numpyro", "snakemake", "pytest"}
HEADER = """\
schema: 1
body: {shape: {kind: ellipse, semi_axes: [0.035, 0.025]}, mass: 0.0364, radius_of_gyration: 0.0192}
noise: {position: 3.0e-4, angle: 3.0e-3, velocity: 0.01, angular_velocity: 0.5}
"""
USE = """\
import json, sys
import thesis_lib
from thesis_lib.critique import criticise
found = criticise("my_drops", effects=[])
said = {"from": thesis_lib.__file__, "version": thesis_lib.__version__, "shown": repr(found), "verdict": found.verdict}
said |= {"laws": list(found.to_dict()["laws"]), "loaded": [name for name in sys.modules if "." not in name]}
print(json.dumps(said))
"""


def test_dependencies_are_those_that_the_tests_run_with():
    texts = ((ROOT / name).read_text(encoding="utf-8") for name in ("environment.txt", "benchmarks/requirements.txt"))
    pinned = dict(re.findall(r"^([\w-]+)==(\S+)$", "\n".join(texts), re.M))
    optional = [text for texts in PROJECT.get("optional-dependencies", {}).values() for text in texts]
    for text in [*PROJECT["dependencies"], *optional]:
        name, least = re.split(">=|~=", text)
        assert pinned[name] == least, f"pyproject.toml asks for {text}, but pinned is {pinned[name]}"


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
def test_the_wheel_holds_every_file_of_the_library_and_no_other_wing(wheel):
    held = {path for path in zipfile.ZipFile(wheel).namelist() if path.startswith("thesis_lib/")}
    paths = [path.relative_to(ROOT) for path in (ROOT / "thesis_lib").rglob("*") if path.is_file()]
    library = {path for path in paths if not {"__pycache__", "thesis", "jenga", "studies"} & set(path.parts)}
    assert held == {path.as_posix() for path in library}


def write_impacts(folder: Path, n: int = 120, h: float = 0.0) -> None:
    """Impacts of an ellipse that obey one of the six laws, with the noise that the header states.

    `h` in s/m is the relative change of ε for each m/s of slip.
    """
    rng = np.random.default_rng(0)
    v, theta = rng.normal([0.0, -1.8, 0.0], [0.6, 0.3, 5.0], (n, 3)), rng.uniform(-np.pi, np.pi, n)
    r = Ellipse(semi_axes=(0.035, 0.025)).contact_point(theta)
    epsilon = 0.55 * (1.0 + h * np.abs(v[:, 0] - r[:, 1] * v[:, 2]))
    after = LAWS["mirtich"](v, r, mass=0.0364, k_g=0.0192, mu=0.15, epsilon=epsilon)
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
    assert answer["shown"].startswith("<Critique of my_drops: adequate, held-out error")
    assert answer["version"] == thesis_lib.__version__
    assert not EXTRA & set(answer["loaded"])


@pytest.mark.slow
def test_the_installed_library_has_no_command_of_the_thesis_and_says_where_there_is_one(installed, tmp_path):
    program = (sys.executable, "-m", "thesis_lib")
    printed = run(*program, "--help", folder=tmp_path, path=installed)
    assert "rollout" in printed and "claims" not in printed and "the thesis" not in printed
    with pytest.raises(AssertionError, match="run thesis-lib claims in a clone of the repository"):
        run(*program, "claims", "check", folder=tmp_path, path=installed)
    listed = run(*program, "effects", folder=tmp_path, path=installed)
    assert "com_offset" in listed


@pytest.mark.slow
def test_an_effect_in_a_file_of_the_users_is_found_with_the_installed_package_alone(installed, tmp_path):
    """The drops obey the equation of the effect, but are made without its code and not by the library's simulator."""
    write_impacts(tmp_path / "my_drops", 150, h=-0.2)
    name = "slip_dependent_restitution"
    shutil.copy(ROOT / "tests" / "extensions" / "own_files.py", tmp_path / "texts.py")
    save = "import texts, pathlib; pathlib.Path('my_effects.py').write_text(texts.EFFECT, encoding='utf-8')"
    run(sys.executable, "-c", save, folder=tmp_path, path=installed)
    program = (sys.executable, "-m", "thesis_lib")
    printed = run(*program, "effects", "--check", "my_effects.py", folder=tmp_path, path=installed)
    assert "FAIL" not in printed and "checks pass" in printed

    critique = (*program, "critique", "my_drops", "-q", "--json")
    by_library = "import json, thesis_lib.critique as c; print(json.dumps(c.criticise('my_drops').to_dict()))"
    alone = json.loads(run(sys.executable, "-c", by_library, folder=tmp_path, path=installed))
    own = json.loads(run(*critique, "-o", "own", "--effects", "my_effects.py", folder=tmp_path, path=installed))
    assert name not in json.dumps(alone)
    assert [effect["name"] for effect in own["effects"]] == [name] and own["verdict"] == "effects"
    found = own["effects"][0]["parameters"]["h"]
    assert abs(found["value"] + 0.2) < 4.0 * found["std"] < 0.1
    assert own["error"]["augmented"] < alone["error"]["augmented"] < alone["error"]["base"] * (1.0 + 1e-9)
    assert "is not part of the library but from my_effects.py." in " ".join(own["summary"])
    assert "from my_effects.py" in (tmp_path / "own" / "report.html").read_text(encoding="utf-8")

    states = "x,y,theta,vx,vy,omega\n0.00,0.031,0.30,0.8,-2.1,5.0\n"
    (tmp_path / "states.csv").write_text(states)
    predict = (*program, "predict", "own/model.json", "states.csv")
    assert ",ok" in run(*predict, "--effects", "my_effects.py", folder=tmp_path, path=installed)
    with pytest.raises(AssertionError, match=r"came from my_effects\.py and is not loaded"):
        run(*predict, folder=tmp_path, path=installed)

    # the same from a package that is installed beside it
    info = installed / "drop_effects-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: drop-effects\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text("[thesis_lib.effects]\nslip = drop_effects\n")
    shutil.copy(tmp_path / "my_effects.py", installed / "drop_effects.py")
    listed = " ".join(run(*program, "effects", folder=tmp_path, path=installed).split())
    assert "not part of the library; from" in listed and "drop-effects" in listed
    switched_on = (*critique, "-o", "packaged", "--effect", name)  # which looks for no other
    packaged = json.loads(run(*switched_on, folder=tmp_path, path=installed))
    assert packaged["additions"][0]["package"] == "drop-effects"
    assert packaged["effects"][0]["parameters"] == own["effects"][0]["parameters"]
    shutil.rmtree(info)


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


@pytest.mark.parametrize("words", [["thesis_lib", "critique", "x"], ["thesis_lib.thesis.pipeline"]], ids=" ".join)
def test_outside_the_environment_one_sentence_says_how_to_come_in(words):
    bare = [sys.executable, "-S", "-m", *words]  # without packages
    done = subprocess.run(bare, cwd=ROOT, env={}, capture_output=True, text=True)
    (sentence,) = done.stderr.strip().splitlines()
    assert done.returncode == 2 and f". {ROOT}/.venv/bin/activate" in sentence, done.stderr
    assert "is not installed in this Python" in sentence
