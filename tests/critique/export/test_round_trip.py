"""An engine's file, new or patched, predicts held-out impacts as well as the fitted engine that it was written from."""

import functools

import numpy as np
import pytest
from round_trip import BODIES, MASS, TRUE, by_drake, by_mujoco, errors, fitted, made, model_of, predicted

from thesis_lib.critique.export.export import exported, patched

ADDS = 0.05  # share of the held-out error that a file may add to that of the fitted engine
TRAIN = 0.7
# what a user's own file may say before it is patched
BELIEVED = {"mu": 0.45, "epsilon": 0.35, "contact_time": 1e-3}
WRONG_INERTIA = {"wrong_inertia.d_I": 0.4}
FORMATS = {"mujoco": ["mjcf"], "drake": ["sdf", "urdf"]}
CASES = [
    pytest.param(name, body, target, marks=pytest.mark.slow)
    for name, targets in FORMATS.items()
    for body in BODIES
    for target in targets
]


@functools.cache
def fit(name, body):
    """The engine fitted to most impacts, the others, and its error in those."""
    drops = made(name, BODIES[body], 50 if name == "mujoco" else 40)
    cut = int(TRAIN * len(drops.q))
    numbers = fitted(name, drops.select(np.arange(cut)))
    test = drops.select(np.arange(cut, len(drops.q)))
    own = predicted(name, test.body, test.q, test.v, **numbers)
    return numbers, test, errors(test.body, own, test.after).mean()


def error_of(content, target, test, tmp_path, body="body"):
    """Held-out error of a file in its engine, m/s."""
    if target == "mjcf":
        v = by_mujoco(content.decode(), test.q, test.v, body=body)
    else:
        path = tmp_path / f"file.{target}"
        path.write_bytes(content)
        v = by_drake(path, test.q, test.v, body=body)
    return errors(test.body, v, test.after).mean()


def mine(name, body, target):
    """A user's file: another name and layout, and wrong numbers."""
    model = model_of(name, BODIES[body], BELIEVED, extra=WRONG_INERTIA)
    text = exported(model, target, mass=MASS).content.decode()
    for link in ("body name", "link name"):
        text = text.replace(f'<{link}="body"', f"<{link}  = 'block'")
    return text.replace("\n    <", "\r\n\t <").encode()


@pytest.mark.parametrize(("name", "body", "target"), CASES)
def test_a_new_file_adds_next_to_nothing(name, body, target, tmp_path):
    numbers, test, own = fit(name, body)
    assert numbers["mu"] == pytest.approx(TRUE["mu"], abs=0.05)  # the fit is one
    assert numbers["epsilon"] == pytest.approx(TRUE["epsilon"], abs=0.05)
    content = exported(model_of(name, BODIES[body], numbers), target, mass=MASS).content
    assert error_of(content, target, test, tmp_path) < (1.0 + ADDS) * own


@pytest.mark.parametrize(("name", "body", "target"), CASES)
def test_so_does_a_patched_file(name, body, target, tmp_path):
    numbers, test, own = fit(name, body)
    path = tmp_path / "mine.xml"
    content = mine(name, body, target)
    path.write_bytes(content)
    surface = "" if target == "mjcf" else "surface"
    # the file has its own moment of inertia: the fit's is the believed one
    model = model_of(name, BODIES[body], numbers)
    new = patched(model, target, path, "block", surface=surface).content
    assert error_of(new, target, test, tmp_path, "block") < (1.0 + ADDS) * own
    assert error_of(content, target, test, tmp_path, "block") > 2.0 * own
