"""Tosses in an MJCF file are those of the model that it was written from; what cannot be tossed is said."""

import json
import re

import numpy as np
import pytest
from saved_models import BOX, space_model

from thesis_lib.__main__ import main
from thesis_lib.critique.export.export import exported
from thesis_lib.critique.simulation.in_mujoco import TossesInFile
from thesis_lib.critique.simulation.simulate_in_space import simulate_in_space
from thesis_lib.critique.simulation.tosses import toss
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State

MODEL = {"law": "convex_contact", "tau": 1e-3, "damping_ratio": 10.0, "impedance": 0.9, "com_offset.c_x": 3e-3}
MODEL |= {"com_offset.c_y": 0.0, "com_offset.c_z": -2e-3, "surface_height.h": 0.02, "inertia_ratios.a_y": 0.2}
MODEL |= {"inertia_ratios.a_z": 0.1, "surface_tilt.phi_x": 0.1, "surface_tilt.phi_y": 0.0}
BODY = {"shape": BOX, "mass": 0.25, "radii_of_gyration": (0.03, 0.035, 0.04), "center_of_mass": (0.004, 0.0, 0.006)}
FILMED = {"body": BODY, "gravity": (0.0, -9.0, -3.9), "surface": {"point": (0.1, 0.2, 0.3)}}
FEW = 6  # frames after the first hit: from then on a next one may have begun, and small errors grow
CLOSE = (1e-4, 3e-3, 2e-3)  # m, rad, m: until the hit, and after it
COARSE = 'timestep="2e-5"'


@pytest.fixture
def file(tmp_path):
    def made(model):
        path = tmp_path / "mine.xml"
        path.write_text(re.sub('timestep="[^"]+"', COARSE, exported(model, "mjcf").content.decode()))
        return path

    return made


def test_a_toss_in_the_file_is_that_of_the_model(file):
    """In axes of a camera, over a table that leans and lies higher than believed, about a centre of mass aside."""
    model, n = space_model(rig=FILMED, **MODEL), 2
    rng, dynamics = np.random.default_rng(3), model.dynamics
    pose = np.concatenate([rng.uniform(-0.1, 0.1, (2, n)), np.full((1, n), 0.12), np.zeros((4, n))])
    pose[3:] = of_rotation_vector(rng.standard_normal((3, n)))
    motion = rng.uniform(-1, 1, (6, n)) * np.r_[[0.5] * 3, [8.0] * 3][:, None]
    start = State(pose, motion, np.arange(n), np.zeros(n), None, SPACE)
    times = np.arange(50)[:, None] / 250.0 + np.zeros(n)
    own = toss(dynamics, start, times)
    found = TossesInFile(file(model), "body", model).toss(dynamics, start, times)
    off = SPACE.difference(found.true.pose, own.true.pose).reshape(6, len(times), n)
    place, turn = np.linalg.norm(off[:3], axis=0), np.linalg.norm(off[3:], axis=0)
    for i in range(n):
        hit, there = (int((hits[:, i] > 0).argmax()) for hits in (own.hits, found.hits))
        assert 10 < hit < len(times) - FEW and abs(there - hit) <= 1
        assert place[: hit - 1, i].max() < CLOSE[0] and turn[: hit - 1, i].max() < CLOSE[1]
        assert place[hit : hit + FEW, i].max() < CLOSE[2]


@pytest.mark.slow  # 15 s
def test_the_command_compares_files(file, tmp_path, capsys):
    """The file of the true body errs less than one that believes in another centre of mass."""
    numbers = {name: value for name, value in MODEL.items() if name not in ("damping_ratio", "impedance")}
    model = space_model(**numbers | {"law": "mirtich"})
    write_dataset(simulate_in_space(model, 4, duration=0.3, rng=np.random.default_rng(2)), tmp_path / "data")
    model.save(tmp_path / "model.json")
    better = file(model)
    other = tmp_path / "other.xml"
    other.write_text(better.read_text().replace('<inertial pos="0.003 0 -0.002"', '<inertial pos="-0.003 0 0.002"'))
    command = ["rollout", f"{tmp_path}/model.json", f"{tmp_path}/data", "--all", "--json", "-q"]
    command += ["--mjcf", str(other), str(better)]
    assert main([*command, "--body", "body"]) == 0
    content = json.loads(capsys.readouterr().out)
    errors = {name: of["benchmark"]["position_m"] for name, of in content["files"].items()}
    assert errors["mine.xml"] < 0.6 * errors["other.xml"]
    assert errors["mine.xml"] < 2.0 * content["floor"]["benchmark"]["position_m"] + 1e-3
    assert main(command) == 2 and "belong together" in capsys.readouterr().err


def test_a_file_that_cannot_be_tossed_says_why(file):
    model = space_model(**MODEL)
    path = file(model)
    text = path.read_text()
    boxed = text.replace('type="plane"', 'type="box"').replace('size="0 0 1"', 'size="1 1 1"')
    for written, body, said in (
        (text, "box", "no body 'box' with a free joint"),
        (boxed, "body", "has 0 planes; it needs one"),
        (text.replace("<freejoint/>", ""), "body", "no body 'body' with a free joint"),
        ("<mujoco><worldbody/></mujoc>", "body", "MuJoCo cannot read it"),
    ):
        path.write_text(written)
        with pytest.raises(UserError, match=said):
            TossesInFile(path, body, model)
