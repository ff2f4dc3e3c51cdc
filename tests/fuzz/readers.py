"""Everything that reads a file of a user or an intermediate of the pipeline, with small valid samples of its files.

`READERS[name]` has samples, as the project's own writers make them, and a function that reads such a folder and uses
what it got: an input is accepted only if it can be worked with.  What reads it may raise `UserError` and nothing else.
"""

import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from tests.datasets import folders
from tests.datasets import folders_in_space as in_space
from tests.fuzz.intermediates import (
    ROOT,
    csv_of,
    jenga_samples,
    parquet_of,
    policy_samples,
    read_jenga,
    read_policy,
    read_results,
    results_samples,
)
from tests.fuzz.motions import bag_samples, c3d_samples, motion_samples, read_in_space, read_motion, tensor_samples
from tests.fuzz.mutations import Sample


@dataclass(frozen=True)
class Reader:
    """samples: () -> folders as {name: bytes}; read: (input folder, output folder), raises UserError.

    contained: what a link shows of files outside the folder must not come back; share: of the inputs, relative.
    """

    samples: Callable[[], list[Sample]]
    read: Callable[[Path, Path], None]
    contained: bool = False
    share: float = 1.0


def _yaml(content: dict) -> bytes:
    return yaml.safe_dump(content, sort_keys=False).encode()


def _dataset_samples() -> list[Sample]:
    """An ellipse, a square, and a puck between walls, whose angle is not measured; then bodies in space."""
    noise = {"position": 3e-4, "angle": 3e-3, "velocity": 0.02, "angular_velocity": 0.5}
    body = {"shape": {"kind": "ellipse", "semi_axes": [0.035, 0.025]}, "mass": 0.05, "radius_of_gyration": 0.022}
    ellipse = _yaml(folders.header(body=body, noise=noise))
    poses = folders.trajectories(3, 30)
    puck = {"dataset.yaml": _yaml(folders.between_walls(spin=20.0))}
    return [
        {"dataset.yaml": ellipse, "trajectories.csv": csv_of(poses)},
        {"dataset.yaml": _yaml(folders.header(noise=noise)), "impacts.csv": csv_of(folders.impacts(12, 1))},
        puck | {"trajectories.csv": csv_of(folders.sliding(3, 30))},
        {"dataset.yaml": ellipse, "trajectories.parquet": parquet_of(poses)},
        *_samples_in_space(),
    ]


def _samples_in_space() -> list[Sample]:
    """A box, a ball without orientation, and a body as a mesh."""
    flights, hits = in_space.trajectories(3, 30), in_space.impacts()
    noise = {"position": [1e-4, 1e-4, 3e-4], "rotation": 3e-3}
    inertia = {"xx": 2.1e-4, "yy": 2.8e-4, "zz": 3.4e-4, "xy": 1e-6}
    rounded = in_space.BOX | {"edge_radius": 0.001}
    box = in_space.body(shape=rounded, homogeneous=None, inertia=inertia, uncertainty={"center_of_mass": 5e-4})
    place = {"tracked": {"position": [0, 0, 0.03]}, "surface": {"point": [0, 0, 0.01]}}
    ball = {"shape": {"kind": "sphere", "radius": 0.03}, "radii_of_gyration": [0.02, 0.02, 0.02]}
    floor = {"name": "floor", "point": [0, 0, 0], "normal": [0, 0, 1], "extent": [[1, 1, 0], [-1, 1, 0], [0, -1, 0]]}
    mesh = in_space.body(shape={"kind": "mesh", "file": "body.obj", "scale": 0.001})
    heads = [
        _yaml(in_space.header(noise=noise, **more))
        for more in (
            {"body": box} | place,
            {"body": ball, "surface": None, "surfaces": [floor], "spin": 20.0},
            {"body": mesh, "surface": None, "gravity": None, "tracked": "unknown"},
        )
    ]
    return [
        {"dataset.yaml": heads[0], "trajectories.csv": csv_of(flights), "impacts.parquet": parquet_of(hits)},
        {"dataset.yaml": heads[1], "trajectories.csv": csv_of(flights.drop(columns=["qw", "qx", "qy", "qz"]))},
        {"dataset.yaml": heads[2], "impacts.csv": csv_of(hits), "body.obj": in_space.mesh((50.0, 40.0, 30.0))},
    ]


def _read_dataset(folder: Path, out: Path) -> None:
    from thesis_lib.datasets.read import read_dataset

    dataset = read_dataset(folder)
    dataset.digest()
    assert (len(dataset.trials) > 0 and dataset.rate is None) or dataset.rate > 0
    for table in filter(lambda table: table is not None, (dataset.trajectories, dataset.impacts)):
        may_lack = ["t", "flags", "qw", "qx", "qy", "qz"]
        assert np.isfinite(table.drop(columns=may_lack, errors="ignore").to_numpy(float)).all()
    assert np.isfinite(dataset.shape.extent) and dataset.k_g > 0.0 and dataset.gravity >= 0.0


def _log_samples() -> list[Sample]:
    poses = pd.DataFrame({"run": np.repeat([1, 2], 20), "time": np.tile(np.arange(20), 2) / 250.0})
    poses = poses.assign(x=1.0, y=2.0 - poses["time"], angle=0.1)
    european = poses.rename(columns={"angle": "angle (°)"}).to_csv(sep=";", decimal=",", index=False)
    european = f"ball 1\n{european}".replace("\n1;", "\n;s;mm;mm;\n1;", 1).encode("cp1252")
    marks = "".join(f"{i},{300 + i},{200 + i},0.9,{330 + i},{200.5 + i},{0.2 + 0.02 * i:.2f}\n" for i in range(40))
    header = "scorer,net,net,net,net,net,net\nbodyparts,a,a,a,b,b,b\ncoords,x,y,likelihood,x,y,likelihood\n"
    stamps = "# timestamp tx ty\n" + "".join(f"{1567176123123456789 + 4000000 * i} 0.1 {0.2 + i}\n" for i in range(40))
    samples = {"european.txt": european, "points.csv": (header + marks).encode(), "stamps.txt": stamps.encode()}
    return [{"log.csv": csv_of(poses)}, *({name: content} for name, content in samples.items())]


LOG_OPTIONS = {  # columns, units, scale of the samples above
    "european.txt": ("trial=run,t=time,y=-y,theta=angle (°)", "", None),
    "points.csv": ("", "", "450/0.5"),
    "stamps.txt": ("t=timestamp,x=tx,y=ty", "ns", None),
}


def _read_log(folder: Path, out: Path) -> None:
    from thesis_lib.datasets.format.write import write_dataset
    from thesis_lib.datasets.sources.rig_log import convert_logs
    from thesis_lib.datasets.sources.tables.options import Reading, parse_columns
    from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape

    # the file may be gone, or a trap: its name says how it is read
    (name,) = [path.name for path in folder.iterdir()] or ["log.csv"]
    plain = ("trial=run,t=time,x=x,y=-y,theta=angle", "mm,deg", None)
    columns, units, scale = LOG_OPTIONS.get(name, plain)
    options = Reading(units, parse_columns(columns), scale=scale, origin="300,800", rate=250.0)
    done = convert_logs([folder / name], "made", options, RigOptions(parse_shape("disk:0.03")))
    write_dataset(done.dataset, out / "made")


def _published_samples() -> list[Sample]:
    from scipy.io import savemat

    from thesis_lib.datasets.sources.published import checksums

    files = {}
    for name in checksums("planar_impact"):
        content = io.BytesIO()
        savemat(content, {"data": np.zeros((3, 6))}, do_compression=True)
        files[name] = content.getvalue()
    return [files]


def _read_published(folder: Path, out: Path) -> None:
    """No sample is accepted: nothing is parsed whose checksum is not that of the published file."""
    from thesis_lib.datasets.sources.published import convert_published

    convert_published("planar_impact", folder, out / "planar_impact")


def _archive_samples() -> list[Sample]:
    from tests.fuzz.hostile import archive

    members = [(f"x/dice-data-processed/traj_{i}.csv", b"x,z,th\n1,2,3\n" * 20) for i in range(2)]
    return [{"archive.zip": archive(*members, ("x/README.md", b"text"))}]


def _read_archive(folder: Path, out: Path) -> None:
    from thesis_lib.datasets.sources.fetch import unpack
    from thesis_lib.datasets.sources.published import SOURCES

    unpack(folder / "archive.zip", SOURCES["planar_dice"], {f"traj_{i}.csv": out / f"traj_{i}.csv" for i in range(2)})


def _config_samples() -> list[Sample]:
    names = ("config.yaml", "quick.yaml")
    overlay = {
        "drops": {"n": 20, "noise": {"position": 1e-4}},
        "chapter3": {"topography": {"law": "mirtich", "mu": [0.1, 0.3]}, "convergence": {"sizes": [5, 10]}},
        "critique": {"effects": {"drops": ["com_offset"]}},
    }
    return [
        {name: (ROOT / "config" / name).read_bytes() for name in names},
        {"config.yaml": b"seed: 1\n", "quick.yaml": yaml.safe_dump(overlay).encode()},
    ]


def _read_config(folder: Path, out: Path) -> None:
    from thesis_lib.thesis.config import read_config

    read_config(folder / "config.yaml", folder / "quick.yaml").model_dump_json(by_alias=True)


TABLE = b"law,coded,mu,mu_std,converged\nmirtich,as_published,0.06,0.01,True\nnewton,as_published,0.1,0.01,True\n"


def _claims_samples() -> list[Sample]:
    content = yaml.CSafeLoader((ROOT / "config/claims/chapter3.yaml").read_bytes()).get_single_data()
    claims = content["claims"]
    kinds = {claim["check"]["kind"]: claim for claim in claims}
    sources = [{"file": "table.csv", "where": {"law": "mirtich"}, "column": "mu", "std_column": "mu_std"}]
    ledger = {"schema": 1, "defaults": {"chapter": 3, "needs": ["drops"]}}
    ledger["checks"] = [claim["check"] for claim in kinds.values()]  # written with anchors
    ledger["claims"] = [claim | {"source": sources[0]} for claim in kinds.values()]
    first = str(claims[0]["id"])
    checked = {"claims.yaml": yaml.safe_dump(ledger, sort_keys=False).encode(), "table.csv": TABLE}
    checked |= {"present.json": b'{"drops": {"present": true}}'}
    expected = yaml.safe_dump({"schema": 1, "expected": {"quick": {first: "reproduced"}}}).encode()
    return [checked, {"expected.yaml": expected}]


def _read_claims(folder: Path, out: Path) -> None:
    from thesis_lib.foundation.files import read_cells, write_table
    from thesis_lib.thesis.ledger.evaluate import evaluate
    from thesis_lib.thesis.ledger.expected import read_expected
    from thesis_lib.thesis.ledger.format import read_ledger
    from thesis_lib.thesis.ledger.reading import read_present
    from thesis_lib.thesis.ledger.result import to_table, write_page

    if folder.joinpath("expected.yaml").exists():
        read_expected(folder / "expected.yaml")
        return
    results = evaluate(read_ledger(folder / "claims.yaml"), folder, read_present(folder / "present.json"))
    write_table(to_table(results), out / "claims.csv")
    write_page(results, out / "claims.html", "quick")
    read_cells(folder / "table.csv")


def _model_samples() -> list[Sample]:
    from thesis_lib.contact import LAWS
    from thesis_lib.critique.contacts.model import Model
    from thesis_lib.effects import EFFECTS

    effects = ["com_offset", "wear"]
    made = Model(LAWS["wang_mason"], tuple(EFFECTS[name] for name in effects))
    model = {"schema": 1, "dataset": "drops", "law": "wang_mason", "effects": effects}
    model |= {"origins": {"wear": {"file": "my_effects.py", "sha256": "0" * 64}}, "parameters": _parameters(made)}
    ellipse = {"kind": "ellipse", "semi_axes": [0.035, 0.025]}
    rig = {"shape": ellipse, "radius_of_gyration": 0.0192, "gravity": 9.81, "height": 0.0}
    model |= {"scatter": 0.01, "rig": rig}
    n = np.arange(5.0)
    states = pd.DataFrame({"x": 0.0, "y": 0.03, "theta": n, "vx": 0.5, "vy": -2.0, "omega": n, "trial": n, "t": n})
    planar = {"model.json": json.dumps(model, indent=1).encode(), "states.csv": csv_of(states)}
    return [planar, _model_in_space()]


def _parameters(made) -> dict:
    values = {name: p.null + 0.1 * p.scale for name, p in made.parameters.items()} | {"mu": 0.2, "epsilon": 0.6}
    return {name: {"value": values[name], "std": 0.01, "unit": p.unit} for name, p in made.parameters.items()}


def _model_in_space() -> Sample:
    from thesis_lib.contact import LAWS
    from thesis_lib.critique.contacts.model import Model
    from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_PRE_IN_SPACE
    from thesis_lib.effects import EFFECTS
    from thesis_lib.mechanics.space import SPACE

    effects = ["com_offset", "wrong_inertia"]
    made = Model(LAWS["mirtich"], tuple(EFFECTS[name] for name in effects), space=SPACE)
    body = {"shape": {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}, "radii_of_gyration": [0.03, 0.034, 0.037]}
    place = {"tracked": {"position": [0.01, 0, 0.02]}, "surface": {"point": [0, 0, 0.1]}, "gravity": [0, 0, -9.81]}
    model = {"schema": 1, "dimensions": 3, "dataset": "tosses", "law": "mirtich", "effects": effects}
    model |= {"parameters": _parameters(made), "rig": {"schema": 2, "body": body, **place}}
    n = np.arange(5.0)
    states = pd.DataFrame(dict.fromkeys((*POSE_IN_SPACE, *V_PRE_IN_SPACE), 0.0), index=n)
    states = states.assign(trial=n, t=n, z=0.15, qw=1.0, vx_pre=0.5, vz_pre=-2.0, wx_pre=n)
    return {"model.json": json.dumps(model, indent=1).encode(), "states.csv": csv_of(states)}


def _read_model(folder: Path, out: Path) -> None:
    from thesis_lib.critique.results.load_model import load_model
    from thesis_lib.critique.results.saved_model import read_states
    from thesis_lib.foundation.files import write_table

    model = load_model(folder / "model.json")
    write_table(model.predict(read_states(folder / "states.csv"), str(folder / "states.csv")), out / "predicted.csv")


ROBOTS = {
    "mine.mjcf": """<?xml version="1.0"?>
<mujoco><option timestep="2e-5"/><worldbody><geom type="plane" size="1 1 1"/><body name="block"><freejoint/>
  <inertial pos="0 0 0" mass="0.05" quat="1 0 0 0" diaginertia="3e-5 3e-5 3e-5"/>
  <geom name="hull" type="box" size=".03 .03 .03" friction="1 .005 .0001"/></body></worldbody>
<contact><pair geom1="hull" geom2="hull" friction="1 1 0 0 0"/></contact></mujoco>
""",
    "mine.sdf": """<sdf version="1.9"><model name="lab"><link name="block">
  <inertial><pose>0 0 0 0 0.1 0</pose><mass>0.05</mass><inertia><ixx>3e-5</ixx><iyy>3e-5</iyy><izz>3e-5</izz></inertia>
  </inertial><collision name="hull"><pose>0 0.01 0 0 0 0</pose><surface><friction><ode><mu>1</mu></ode></friction>
  </surface></collision></link></model></sdf>
""",
    "mine.urdf": """<robot name="lab" xmlns:drake="http://drake.mit.edu"><link name="block"><inertial>
  <origin xyz="0 0 0" rpy="0 0 0"/><mass value="0.05"/><inertia ixx="3e-5" iyy="3e-5" izz="3e-5" ixy="0"/></inertial>
  <collision><drake:proximity_properties><drake:mu_static value="1"/></drake:proximity_properties></collision>
</link></robot>
""",
}


def _robot_samples() -> list[Sample]:
    return [{"model.json": _model_samples()[0]["model.json"]} | {name: text.encode()} for name, text in ROBOTS.items()]


def _read_robot(folder: Path, out: Path) -> None:
    """Patch what lies there; what comes out is XML again, and says the same when it is patched once more."""
    from thesis_lib.critique.export.export import patched, write
    from thesis_lib.critique.results.load_model import load_model

    model = load_model(folder / "model.json")
    for name in ROBOTS:
        if (folder / name).exists():
            target = name.split(".")[1]
            once = patched(model, target, folder / name, "block", mass=0.05)
            write(once, out / name)
            assert patched(model, target, out / name, "block", mass=0.05).content == once.content


def _command_samples() -> list[Sample]:
    return [_dataset_samples()[0] | _log_samples()[0] | _model_samples()[0] | {"diagnosis.json": b"{}"}]


def _run_commands(folder: Path, out: Path) -> None:
    """Command lines on what lies in the folder: exit codes instead of errors; a refusal's text is raised on."""
    import contextlib

    from thesis_lib.__main__ import main as critique
    from thesis_lib.commands.datasets import main as datasets
    from thesis_lib.thesis.commands.claims import main as claims

    files = sorted(str(path) for path in folder.iterdir())
    said = io.StringIO()
    codes = []
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        codes += [datasets(["check", str(folder), "--json"])]
        strange = (folder / ("x" * 300), f"{folder}/\udcff", f"{folder}/new\nline", f"{folder}/a\x00b")
        for i, path in enumerate((*files, *map(str, strange))):
            ways = (
                lambda path: datasets(["check", path]),
                lambda path: datasets(["init", path, "-o", str(out / "made"), "--shape", "disk:0.03", "--force"]),
                lambda path: critique(["predict", path, path]),
                lambda path: claims(["check", "--scale", "quick", "--ledger", path, "--results", path]),
            )
            codes += [way(path) for way in (ways if i >= len(files) else ways[i % 4 : i % 4 + 1])]
        codes.append(critique(["predict", str(folder / "model.json"), str(folder / "states.csv")]))
    assert set(codes) <= {0, 1, 2}, codes
    assert "Traceback" not in said.getvalue()


# shares: what strangers send comes first, the command lines run a dozen programs each
READERS: dict[str, Reader] = {
    "dataset": Reader(cache(_dataset_samples), _read_dataset, contained=True, share=8),
    "log": Reader(cache(_log_samples), _read_log, share=2),
    "motion": Reader(cache(motion_samples), read_motion, share=3),
    "bag": Reader(cache(bag_samples), read_motion, share=2),
    "c3d": Reader(cache(c3d_samples), read_motion),
    "space": Reader(cache(motion_samples), read_in_space),
    "tensors": Reader(cache(tensor_samples), read_in_space, share=0.5),
    "published": Reader(cache(_published_samples), _read_published),
    "archive": Reader(cache(_archive_samples), _read_archive),
    "config": Reader(cache(_config_samples), _read_config, share=3),
    "claims": Reader(cache(_claims_samples), _read_claims, share=3),
    "model": Reader(cache(_model_samples), _read_model, share=3),
    "robot": Reader(cache(_robot_samples), _read_robot),
    "results": Reader(cache(results_samples), read_results, share=3),
    "jenga": Reader(cache(jenga_samples), read_jenga),
    "policy": Reader(cache(policy_samples), read_policy),
    "commands": Reader(cache(_command_samples), _run_commands, share=0.3),
}
