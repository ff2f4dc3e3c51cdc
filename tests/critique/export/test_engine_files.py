"""New files: the engine that reads them does what the planar engine does, and every effect is accounted for."""

import re

import mujoco
import numpy as np
import pytest
from engine_runs import (
    BODIES,
    LEAD,
    MASS,
    SPAN,
    TRUE,
    by_drake,
    by_mujoco,
    errors,
    in_plane,
    in_space,
    inertia_in_mujoco,
    model_of,
    predicted,
    require_told,
    steep,
)
from hidden_effects import sizes

from tests.critique.simulation import saved_models
from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Disk
from thesis_lib.critique.export.export import exported, patched
from thesis_lib.critique.export.solid import FORMATS
from thesis_lib.effects import effects_in
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import PLANE

ALL = BODIES | {"disk": Body(shape=Disk(radius=0.03), mass=MASS, radius_of_gyration=0.021)}
# m/s, median and most; Drake finds the contact of an ellipsoid with a box (URDF) by iteration
CLOSE = {"mjcf": (2e-3, 8e-3), "sdf": (5e-4, 5e-3), "urdf": (8e-3, 0.04)}
ENGINES = {"mjcf": "mujoco", "sdf": "drake", "urdf": "drake"}
FINE = 400  # steps in a contact time, with which MuJoCo's files are compared; the touch falls anywhere in a step
AS_WRITTEN = 2.5e-3  # m/s, median, with the steps that are written
HIDDEN = {"tilt": 0.1, "inertia_error": 0.1, "size_error": 0.03, "gravity_error": 0.5}
EXTRA = {"wrong_inertia.d_I": 0.1, "wrong_size.s": 0.03, "wrong_gravity.dg": 0.5, "surface_height.h": 0.002}
NUMBERS = TRUE | {"c_x": 0.0015, "c_y": -0.001}


def states(body, n, seed=5):
    """Poses and velocities (n, 3) of bodies `LEAD` before they touch."""
    rng = np.random.default_rng(seed)
    theta = rng.uniform(-np.pi, np.pi, 20 * n)
    theta = theta[steep(body, theta)][:n]
    v = np.column_stack([rng.uniform(-1.2, 1.2, n), rng.uniform(-3.0, -1.5, n), rng.uniform(-8.0, 8.0, n)])
    r = body.shape.contact_point(theta)
    q = np.column_stack([rng.uniform(-0.1, 0.1, n), -r[:, 1], theta])
    return q - LEAD * v, v


def of_mine(target, body):
    """A user's file: another name and layout, and wrong numbers."""
    believed = {"mu": 0.45, "epsilon": 0.35, "contact_time": 1e-3}
    model = model_of(ENGINES[target], body, believed, extra={"wrong_inertia.d_I": 0.4})
    text = exported(model, target, mass=MASS).content.decode()
    for link in ("body name", "link name"):
        text = text.replace(f'<{link}="body"', f"<{link}  = 'block'")
    return text.replace("\n    <", "\r\n\t <").encode()


def off(name, target, tmp_path, hidden=None, extra=None, depth=None, fine=True, impedance=0.01, patch=False):
    """Distances (n,) in m/s between what the file makes of states, new or `of_mine` patched, and the planar engine."""
    body, hidden, height = ALL[name], hidden or {}, 0.0 if patch else 0.05
    engine, tilt = ENGINES[target], hidden.get("tilt", 0.0)
    model = model_of(engine, body, NUMBERS, tilt=tilt, height=height, extra=extra, impedance=impedance)
    q, v = states(body, 12)
    # the planar engine has its surface at 0; what is hidden may be under it
    q[:, 1] += 0.002 + 0.04 * 0.03
    own = predicted(engine, body, q, v, **NUMBERS, **hidden, impedance=impedance)
    file = tmp_path / f"body.{target}"
    file.write_bytes(of_mine(target, body))
    if patch:
        made = patched(model, target, file, "block", surface="" if target == "mjcf" else "surface")
    else:
        made = exported(model, target, mass=MASS, depth=depth)
    file.write_bytes(made.content)
    starts = in_space(q, v, tilt, height + (extra or {}).get("surface_height.h", 0.0))
    return errors(body, in_plane(ended(file, starts, "block" if patch else "body", fine), tilt), own)


def ended(file, starts, link, fine=True):
    """Places, quaternions, velocities and spins at the end, by the engine that reads the file."""
    if file.suffix != ".mjcf":
        return by_drake(file, zip(*starts), SPAN, link)
    text = file.read_text(encoding="utf-8")
    if fine:
        text = re.sub('timestep="[^"]+"', f'timestep="{TRUE["contact_time"] / FINE:.6g}"', text)
    return by_mujoco(text, zip(*starts), SPAN, link)


ROUND = {"hidden": {"corner_radius": 0.004}, "extra": {"rounded_corners.rho": 0.004}}
FILES = [
    *((name, target, {}) for name in ALL for target in FORMATS),
    *((name, target, {"patch": True}) for name in BODIES for target in FORMATS),
    # one of a box's edges touches in two points, which share what the planar corner asks for
    ("square", "mjcf", {"impedance": 0.9}),
    *(("square", target, ROUND) for target in ("mjcf", "sdf")),
    *(("triangle", "mjcf", {"depth": depth}) for depth in (0.002, 0.2)),
]


@pytest.mark.parametrize(("name", "target", "options"), FILES)
def test_a_file_does_what_the_engine_does(name, target, options, tmp_path):
    apart = off(name, target, tmp_path, **options)
    assert np.median(apart) < CLOSE[target][0] and apart.max() < CLOSE[target][1], apart


@pytest.mark.parametrize("target", ["mjcf", "sdf"])
def test_also_with_tilt_size_inertia_and_height(target, tmp_path):
    """Gravity is the engine's: Drake ignores that of a file, so it stays as believed there."""
    hidden = dict(HIDDEN, gravity_error=0.0) if target == "sdf" else HIDDEN
    extra = {key: value for key, value in EXTRA.items() if target == "mjcf" or key != "wrong_gravity.dg"}
    apart = off("square", target, tmp_path, hidden=hidden, extra=extra)
    assert np.median(apart) < CLOSE[target][0] and apart.max() < CLOSE[target][1], apart
    without = off("square", target, tmp_path, hidden=hidden)
    assert np.median(without) > 5 * CLOSE[target][0]


def test_the_steps_that_are_written_suffice(tmp_path):
    assert np.median(off("triangle", "mjcf", tmp_path, fine=False)) < AS_WRITTEN


@pytest.mark.parametrize("name", ALL)
def test_the_inertia_of_a_uniform_body_is_that_of_its_solid(name):
    """MuJoCo's own integral over the same geometry, where k is that of a uniform solid."""
    shape = ALL[name].shape
    k = shape.radius_of_gyration if name != "ellipse" else np.sqrt(np.square(shape.semi_axes).sum() / 5.0)
    body = Body(shape=shape, mass=MASS, radius_of_gyration=k)
    model = model_of("mujoco", body, TRUE)
    text = exported(model, "mjcf", mass=MASS, depth=0.08).content.decode()
    geom = text.replace("<inertial", "<!-- <inertial").replace('fullinertia="', 'x="', 1)
    geom = geom.replace("/>\n      <geom", "/> -->\n      <geom", 1)
    own, by_geom = (mujoco.MjModel.from_xml_string(one).body("body") for one in (text, geom))
    expected = MASS / by_geom.mass * inertia_in_mujoco(by_geom)
    np.testing.assert_allclose(inertia_in_mujoco(own), expected, atol=1e-4 * expected.max())
    assert name != "triangle" or abs(expected[0, 2]) > 0.02 * expected[1, 1]  # products, which turn the axes


@pytest.mark.parametrize("target", FORMATS)
def test_every_effect_is_in_the_file_or_named_as_left_out(target):
    def made(extra=None):
        return exported(model_of("mujoco", BODIES["square"], TRUE, extra=extra), target, mass=MASS)

    none = made()
    for name, effect in effects_in(PLANE).items():
        require_told(made(sizes(effect, 0.5)), none, name)


def test_what_a_name_says_cannot_end_the_comment():
    model = model_of("mujoco", BODIES["ellipse"], TRUE).model_copy(update={"dataset": "x --><geom/>\x1b[31m\n-->-"})
    for target in FORMATS:
        text = exported(model, target).content.decode()
        assert "--><geom" not in text and "\x1b" not in text and text.count("-->") == 1
        text.encode("utf-8")
    mujoco.MjModel.from_xml_string(exported(model, "mjcf").content.decode())


def test_what_is_assumed_is_said():
    model = model_of("mujoco", BODIES["ellipse"], TRUE)
    made = exported(model, "mjcf")
    assert any(line.startswith("mass: not part of a model; 1 kg") for line in made.left_out)
    assert 'mass="1"' in made.content.decode()
    short = model.model_copy(update={"law": "mirtich", "effects": ()})
    parameters = {name: value for name, value in model.parameters.items() if name in ("mu", "epsilon")}
    short = short.model_copy(update={"parameters": parameters})
    said = exported(short, "mjcf", mass=MASS)
    assert any(line.startswith("contact time: ") for line in said.left_out)
    assert "mirtich, differs from MuJoCo's contact" in said.content.decode()


@pytest.mark.parametrize("target", FORMATS)
def test_what_was_fitted_beyond_what_an_engine_can_hold_is_said(target):
    fitted = {"mu": -0.2, "epsilon": -0.1}
    made = exported(saved_models.model_of(body=BODIES["ellipse"], **fitted), target, mass=MASS)
    text = made.content.decode()
    for name, value, held in (("mu", -0.2, 0), ("epsilon", -0.1, 0.01)):
        said = f"{name}: fitted as {value}, less than engines can have; {held} was written"
        assert said in made.left_out and said in text
    assert "friction: mu = 0, not as fitted" in text and "restitution: 0.01, not as fitted" in text
    assert "-0.2" not in text[text.index("-->") :]
    within = exported(saved_models.model_of(body=BODIES["ellipse"], mu=0.2, epsilon=1.0), target, mass=MASS)
    assert not any("engines can have" in line for line in within.left_out)


def test_sizes_that_cannot_be_are_refused():
    model = model_of("mujoco", BODIES["triangle"], TRUE)
    with pytest.raises(UserError, match="--mass must be a positive number"):
        exported(model, "mjcf", mass=0.0)
    with pytest.raises(UserError, match="--depth must be a positive number in m; got nan"):
        exported(model, "sdf", depth=float("nan"))
    with pytest.raises(UserError, match="too thin for corners"):
        exported(model_of("mujoco", BODIES["square"], TRUE, extra={"rounded_corners.rho": 0.01}), "mjcf", depth=0.01)
    with pytest.raises(UserError, match="no format 'usd'"):
        exported(model, "usd")
