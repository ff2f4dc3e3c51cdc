"""What rests and slides change in a critique: measured throws, and a square thrown in MuJoCo until it lies still.

    python -m tests.critique.drops.rests_and_slides [--data data/measured/planar_dice] [--simulated]

prints the rows of config/rests_and_slides.csv, one for each set and choice of channels: verdict, law, effects
with their parameters, held-out error in m/s, and root mean squares in units of noise.  Single hits only: a search with
episodes takes ten times as long.  Simulated drops elsewhere end where the body comes to rest, so that these channels
have nothing to say there.

Of the throws in MuJoCo a third are flat, so that the square slides.  In the case `sliding_friction` its coefficient is
another one once nothing has moved at 0.2 m/s towards the floor for 15 ms.  Our own contact has drops as in the tests
(`that_end_at_rest`), with rests and slides put after them.
"""

import argparse
import sys
from collections.abc import Iterator

import numpy as np
import pandas as pd

from tests.critique.drops.test_rest_and_slide import GRAVITY, HALF, MU, NOISE, RATE, SQUARE, that_end_at_rest
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.read import read_dataset
from thesis_lib.foundation.randomness import generator

MASS, STEP, DURATION = SQUARE.mass, 1e-4, 1.2  # kg, s, s
STIFFNESS = MASS * (np.pi / 1e-3) ** 2  # N/m, of a contact of 1 ms
RATIO = -np.log(0.55) / np.sqrt(np.pi**2 + np.log(0.55) ** 2)  # of damping, for a restitution near 0.55
DAMPING = 2.0 * RATIO * np.sqrt(STIFFNESS * MASS)  # N s/m
DROPS = 48
FAST, SUPPORTED = 0.2, 0.015  # m/s towards the floor, s without
SEED = 20190906
MUJOCO: dict[str, dict] = {"nothing": {}, "sliding_friction": {"mu_s": 0.3}}
OWN: dict[str, dict] = {
    "nothing": {},
    "nothing, seed 1": {"seed": 1},
    "angle_offset": {"offset": 0.033},
    "surface_height": {"higher": 1e-3},
    "sliding_friction": {"sliding": 0.22},
    "angle_offset and sliding_friction": {"offset": 0.033, "sliding": 0.22, "seed": 1},
}
CHANNELS: tuple[tuple, ...] = ((), ("rest",), ("rest", "slide"))


def thrown(mu_s: float = MU) -> Dataset:
    """Throws until the square lies still."""
    import mujoco

    rng = np.random.default_rng(0)
    inertia = MASS * (HALF**2 * 2.0 / 3.0)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{STEP}" gravity="0 0 {-GRAVITY}" integrator="RK4" cone="elliptic" impratio="10"/>
        <worldbody><geom name="floor" type="plane" size="5 5 .1" contype="0" conaffinity="0"/>
        <body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 -1 0"/>
        <inertial pos="0 0 0" mass="{MASS}" diaginertia="{inertia} {inertia} {inertia}"/>
        <geom name="square" type="box" size="{HALF} .005 {HALF}" contype="0" conaffinity="0"/></body></worldbody>
        <contact><pair geom1="floor" geom2="square" condim="3" friction="{MU} {MU} .001 0 0" solimp=".99 .99 .001"
        solref="{-STIFFNESS / MASS / 0.9} {-DAMPING / MASS / 0.9}"/></contact></mujoco>"""
    )
    data = mujoco.MjData(model)
    parts = []
    for trial in range(DROPS):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = rng.uniform(-0.2, 0.2), rng.uniform(0.12, 0.25), rng.uniform(-np.pi, np.pi)
        data.qvel[:] = rng.uniform(-1.2, 1.2), rng.uniform(-1.0, 0.3), rng.uniform(-12.0, 12.0)
        if trial % 3 == 0:
            data.qpos[1] = HALF + rng.uniform(0.012, 0.03)
            data.qpos[2] = rng.integers(4) * np.pi / 2.0 + rng.uniform(-0.06, 0.06)
            data.qvel[:] = rng.choice([-1.0, 1.0]) * rng.uniform(0.8, 1.8), 0.0, rng.uniform(-0.3, 0.3)
        last, q = -1.0, []
        for _ in range(int(DURATION * RATE)):
            q.append(data.qpos.copy())
            for _ in range(10):
                if abs(data.qvel[1]) > FAST or abs(data.qvel[2]) * HALF > FAST:
                    last = data.time
                model.pair_friction[0, :2] = mu_s if data.time - last > SUPPORTED else MU
                mujoco.mj_step(model, data, nstep=round(0.1 / RATE / STEP))
        seen = np.array(q)
        seen += rng.normal(size=seen.shape) * [NOISE.position, NOISE.position, NOISE.angle]
        columns = dict(zip(("x", "y", "theta"), seen.T))
        parts.append(pd.DataFrame({"trial": trial, "t": np.arange(len(seen)) / RATE, **columns}))
    header = Header(schema=1, description="thrown to rest", body=SQUARE, gravity=GRAVITY, rate=RATE, noise=NOISE)
    return Dataset("square", header, pd.concat(parts, ignore_index=True))


def row(name: str, dataset: Dataset, channels: tuple) -> dict:
    """The critique of the single hits of a set with these channels."""
    settings = CritiqueSettings(channels=channels, episodes=False)
    critique: DropsCritique = criticise_drops(dataset, rng=generator(SEED, "critique"), settings=settings)
    (_, _, before), (_, fitted, after) = critique.ladder[0], critique.ladder[-1]
    sizes = (f"{k} {fitted.values[k]:.4g} ± {fitted.std[k]:.1g}" for k in fitted.values if "." in k)
    left = {}
    for channel in ("touch", "rest", "slide"):
        for when, judged in (("before", before), ("after", after)):
            left[f"{channel}_{when}"] = round(float(np.sqrt(judged.sigmas.get(channel, np.nan))), 2)
    return {
        "set": name,
        "channels": " + ".join(channels) or "none",
        "verdict": critique.verdict,
        "law": fitted.base,
        "effects": " + ".join(effect.name for effect in fitted.effects),
        "parameters": "; ".join(sizes),
        "mu": round(fitted.values["mu"], 4),
        "error": round(float(after.error.mean()), 4),
        "floor": round(float(after.floor), 4),
        **left,
    }


def rows(data: str | None, simulated: bool) -> Iterator[dict]:
    """A row for each set and choice of channels; of simulated sets mostly with all of them."""
    if data:
        die = read_dataset(data).first_trials(150)
        yield from (row("die, 150 throws", die, channels) for channels in CHANNELS)
    if simulated:
        sets = [(f"own contact: {name}", that_end_at_rest, how) for name, how in OWN.items()]
        sets += [(f"MuJoCo: {name}", thrown, how) for name, how in MUJOCO.items()]
        for name, made, how in sets:
            asked = CHANNELS[::2] if name.endswith(": nothing") else CHANNELS[2:]
            yield from (row(name, made(**how), channels) for channels in asked)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", help="folder of the measured die")
    parser.add_argument("--simulated", action="store_true", help="drops of our own contact and of MuJoCo")
    args = parser.parse_args()
    for i, one in enumerate(rows(args.data, args.simulated)):
        pd.DataFrame([one]).to_csv(sys.stdout, index=False, header=i == 0)
        sys.stdout.flush()


if __name__ == "__main__":
    main()
