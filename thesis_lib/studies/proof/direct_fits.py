"""Models fitted directly, without a search: remaining error of contact models, and the gain of each of their parts.

    python -m thesis_lib.studies.proof direct-fits run --drops "MuJoCo, ellipse" --drops "MuJoCo, square"
    python -m thesis_lib.studies.proof direct-fits run --drops "die, single hits" --measured data/measured
    python -m thesis_lib.studies.proof direct-fits table

Simulated drops, most with nothing hidden, are all used for both fitting and judging, since no model is selected with
them.  Measured drops, with the effects that their residuals call for, are judged on the 30 % of the trials that are not
fitted.  Effects are added in the order given.  `run` replaces the rows of some drops in config/proof/direct_fits.csv.

| column              | unit | meaning                                                                     |
|---------------------|------|-----------------------------------------------------------------------------|
| drops, model        |      | key of `SERIES`; base, and effects after "+"                                |
| detected, used      | 1    | number of hits                                                              |
| gain                | nats | log score of the fitted hits minus that of the first model                  |
| error, median       | m/s  | mean and median error of the velocity after impact, of the judged hits      |
| noise_floor         | m/s  | part of `error` that is due to noise                                        |
| single, episodes    | m/s  | `error` of single hits and of episodes                                      |
| flat_hits, flat     | m/s  | number and `error` of single hits at which two corners touch at once        |
| learned, low, high  | m/s  | `questions.floor` of measured drops: `learned`, and the interval of `gain`  |
| pairs               | m/s  | `questions.floor` of measured drops: bound from pairs of similar hits       |
| by_contact          |      | of a hull in space, by kind of contact: `error`, its noise floor, number of judged  |
|                     |      | hits, and share of all such hits that is used; e.g. "corner=0.1:0.02:90:0.9;…"      |
| tosses              |      | of a body in space, for whole held-out tosses from their first flight: each number  |
|                     |      | of `simulation.rollout` with its 95 % interval, and the value for its floor  |
| refitted, refitted_parameters | | `tosses` once more, with these parameters fitted to whole tosses (`to_tosses`)  |
| parameters          |      | with standard errors                                                        |
| code, made          |      | hash of the code that made the row, empty: unknown; date                    |
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.bodies.solids import CONTACT_KINDS
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.judgement import judge
from thesis_lib.critique.drops.questions.floor import floor
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.unpredictable import predictable
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.in_space.hits import hard_hits, observe_in_space
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel, saved_in_space
from thesis_lib.critique.selection.search import split
from thesis_lib.critique.simulation.rollout import GROUPS, roll_out
from thesis_lib.critique.simulation.to_tosses import fit_to_tosses
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.read import read_dataset
from thesis_lib.datasets.sources.along_throws import along_throws
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, RIG_NOISE, CompliantContact
from thesis_lib.statistics.wording import bounded, number
from thesis_lib.studies.proof.cases import BODIES, SEEDS, Case, make
from thesis_lib.studies.proof.store import NOTHING, numbers_in, numbers_of, stamped, stored

FOUND = (
    *("model", "detected", "used", "gain", "error", "median", "noise_floor", "single", "episodes"),
    *("flat_hits", "flat", "learned", "low", "high", "pairs", "by_contact", "tosses"),
    *("refitted", "refitted_parameters", "parameters"),
)
OF_TOSSES = ("name", "value", "low", "high", "floor")
OF_CONTACTS = ("kind", "error", "noise_floor", "n", "used_share")
NUMBERS = {"tosses": OF_TOSSES, "refitted": OF_TOSSES, "by_contact": OF_CONTACTS}
HERTZ_TIME = 3e-3  # s
MEASURED = ("planar_", "contactnets_")  # prefixes of the names of measured sets
FLAT = np.radians(2.0)  # angle between face and surface below which both corners touch within a contact of 1 ms
HELD_OUT = 0.3  # of the trials
SEED = 0


@dataclass(frozen=True)
class Series:
    """Drops of a source of the proof, of "hertz", or of a measured set, and the models that are fitted to them.

    `along_throws`: whether each toss is rotated so that all are thrown along the same axis (`datasets turn`).
    `to_tosses`: by model, parameters that are fitted once more, to whole tosses instead of hits.
    """

    source: str
    models: tuple[str, ...]
    shape: str = "ellipse"
    trials: int | None = None  # number of trials of a measured set that are used, the first ones
    episodes: bool = False
    truth: str = NOTHING  # hidden effect or cause of simulated drops
    along_throws: bool = False
    to_tosses: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def is_measured(self) -> bool:
        return self.source.startswith(MEASURED)


_MUJOCO = ("mirtich", "damped_contact", "convex_contact")
_POINT = ("mirtich", "mirtich+velocity_dependent_restitution", "hunt_crossley_contact")
_SOFT = ("hunt_crossley_contact", "hunt_crossley_contact+soft_body", "pressure_field_contact")
_HERTZ = ("mirtich", "mirtich+velocity_dependent_contact_time", "hertz_contact")
_BASES = ("mirtich", "compliant_contact")
_DIE = (
    "mirtich+linear_drag+rounded_corners+angle_offset+wrong_inertia+tangential_compliance"
    "+velocity_dependent_restitution+surface_patch"
)
# without rounded corners: in a pressure field the corners yield anyway
_DIE_FIELD = (
    "pressure_field_contact+linear_drag+angle_offset+wrong_inertia+velocity_dependent_restitution+surface_patch"
    "+surface_height"
)
_PLATE = "mirtich+mirrored_rotation+surface_patch+tangential_compliance+position_dependent_restitution"
_CUBE = "length_scale+rounded_corners+com_offset+wrong_inertia+angle_offset"
_CUBE_AND_CAMERA = f"{_CUBE}+camera_pose+camera_skew+sliding_friction"
SERIES = {
    "MuJoCo, ellipse": Series("mujoco", _MUJOCO),
    "MuJoCo, square": Series("mujoco", _MUJOCO, "square"),
    "Drake, point, ellipse": Series("drake_point", _POINT),
    "Drake, point, square": Series("drake_point", _POINT, "square"),
    "Drake, hydroelastic, ellipse": Series("drake_hydroelastic", _SOFT),
    "Drake, hydroelastic, square": Series("drake_hydroelastic", _SOFT, "square"),
    "Hertz, 3 ms, ellipse": Series("hertz", _HERTZ),
    "own, nothing hidden": Series("mechanism", tuple(f"{base}+time_lag" for base in _BASES)),
    "own, height 0.28 mm": Series(
        "mechanism", tuple(f"{base}+surface_height" for base in _BASES), truth="surface_height"
    ),
    "own, plate 0.056 m/s": Series(
        "mechanism", tuple(f"{base}+moving_surface" for base in _BASES), truth="plate_velocity"
    ),
    "die, single hits": Series("planar_dice", ("mirtich", f"{_DIE}+com_offset")),
    "die, all hits of 150 throws": Series(
        "planar_dice", ("mirtich", f"{_DIE}+surface_height", _DIE_FIELD), trials=150, episodes=True
    ),
    "cube, tosses 0 to 299": Series(
        "contactnets_cube",
        (
            *("mirtich", f"mirtich+{_CUBE}", f"mirtich+{_CUBE_AND_CAMERA}"),
            f"mirtich+{_CUBE_AND_CAMERA}+velocity_dependent_restitution+inertia_ratios",
            f"hunt_crossley_hertz_contact+{_CUBE_AND_CAMERA}",
        ),
        trials=300,
        episodes=True,
        along_throws=True,
        to_tosses={f"mirtich+{_CUBE_AND_CAMERA}": ("mu", "epsilon", "sliding_friction.mu_s")},
    ),
    "measured ellipse": Series("planar_impact", (_PLATE, f"{_PLATE}+angle_offset+time_lag")),
}

# new rows of a series of drops replace all its stored rows
ROWS = stored(
    "direct_fits", ("drops",), FOUND, "direct-fits run", digits=6, order=lambda row: list(SERIES).index(row["drops"])
)


def drops_of(series: Series, measured: Path) -> Dataset:
    """The drops of a series: simulated with the first seed of the proof, or read from the folder `measured`."""
    if series.is_measured:
        dataset = read_dataset(measured / series.source).first_trials(series.trials)
        return along_throws(dataset) if series.along_throws else dataset
    if series.source != "hertz":
        return make(Case(series.source, series.truth, SEEDS, shape=series.shape, contact_time=1e-3))[0]
    contact = CompliantContact(contact_time=HERTZ_TIME, exponent=1.5)
    rng, body = generator(SEEDS, "proof", series.source, series.shape), BODIES[series.shape]
    made = simulate_compliant_drops(body, PROOF_RELEASE, 150, contact=contact, noise=RIG_NOISE, rng=rng)
    return Dataset(series.source, made.header, made.trajectories)


def fit_in_steps(world: Drops, model: str) -> Fit:
    """Fit a model to all hits, started from quick fits to which its effects are added one after the other."""
    base, *names = model.split("+")
    effects = tuple(EFFECTS[name] for name in names)
    fitted = world.fit(base, (), effort="quick")
    for i, effect in enumerate(effects):
        fitted = world.fit(base, effects[: i + 1], world.start_with(fitted, effect), effort="quick")
    return world.fit(base, effects, fitted.values)


def rows(name: str, dataset: Dataset) -> list[dict]:
    """Fit the models of a series to its drops; return a row of the table for each model."""
    series = SERIES[name]
    seen = observe if dataset.space.is_plane else observe_in_space
    o = seen(dataset, episodes=series.episodes)
    training = judged = o
    if series.is_measured:
        fitted_trials, others = split(np.unique(o.trial), HELD_OUT, generator(SEED, dataset.name))
        o = predictable(o, o.select(fitted_trials), CritiqueSettings())
        training, judged = o.select(fitted_trials), o.select(others)
    fits = [fit_in_steps(Drops(training), model) for model in series.models]
    about = {"drops": name, "detected": int(o.hits.sum()) + len(o.found.left_out), "used": int(o.hits.sum())}
    return [
        about
        | {"model": model, "gain": fitted.score - fits[0].score}
        | _errors(fitted, judged)
        | (_floor(fitted, judged) if series.is_measured and o.space.is_plane else {})
        | ({} if o.space.is_plane else _in_space(fitted, o, judged, dataset, series.to_tosses.get(model, ())))
        | {"parameters": "; ".join(told_parameters(fitted))}
        for model, fitted in zip(series.models, fits)
    ]


def told_parameters(fitted: Fit) -> list[str]:
    """Each fitted parameter with its standard error, or with its bound if the drops give only a bound."""
    told = {key: fitted.content(key) for key in fitted.model.fitted_parameters}
    sizes = [bounded(p) if "bound" in p else f"{number(p['value'])} ± {number(p['std'], 2)}" for p in told.values()]
    return [f"{key} {size}" for key, size in zip(told, sizes)]


def _errors(fitted: Fit, o: Observations) -> dict[str, float]:
    judged = Drops(o).judge(fitted)
    is_single, is_flat = o.span == 0.0, np.zeros(len(o), bool)
    if isinstance(o.rig.shape, Polygon):
        here = fitted.on(o)
        true = here.dynamics.to_true(here.before)
        is_flat = is_single & (np.abs(true.theta - o.rig.shape.lying(true.theta)) < FLAT)
    kinds = {"single": is_single, "episodes": ~is_single, "flat": is_flat}
    means = {kind: float(judged.error[rows].mean()) if rows.any() else np.nan for kind, rows in kinds.items()}
    whole = {"error": float(judged.error.mean()), "median": float(np.median(judged.error))}
    return whole | {"noise_floor": judged.floor, "flat_hits": int(is_flat.sum())} | means


def by_contact(fitted: Fit, o: Observations, judged: Observations) -> dict[str, tuple[float, float, int, float]]:
    """For each kind of contact of a hull in space: error of judged hits and its noise floor in m/s, their number, and
    the share of all such hits of `o` that is used."""
    hits, here = hard_hits(o), hard_hits(judged)
    found = {}
    for kind in CONTACT_KINDS:
        rows = here["row"][(here["kind"] == kind) & (here["row"] >= 0)].to_numpy()
        judgement = judge(fitted, judged.rows(rows))
        share = float((hits["row"][hits["kind"] == kind] >= 0).mean())
        found[kind] = (float(judgement.error.mean()), judgement.floor, len(rows), share)
    return found


def _in_space(
    fitted: Fit, o: Observations, judged: Observations, dataset: Dataset, to_tosses: Sequence[str]
) -> dict[str, str]:
    model = saved_in_space(fitted, dataset.in_space, dataset.name)
    found = {"by_contact": numbers_in(by_contact(fitted, o, judged), 6), "tosses": _rolled_out(model, dataset, judged)}
    if not to_tosses:
        return found
    model, _ = fit_to_tosses(model, dataset, np.setdiff1d(dataset.trials, judged.trial).tolist(), to_tosses)
    sizes = "; ".join(f"{name} {number(model.values[name])}" for name in to_tosses)
    return found | {"refitted": _rolled_out(model, dataset, judged), "refitted_parameters": sizes}


def _rolled_out(model: SavedSpaceModel, dataset: Dataset, judged: Observations) -> str:
    """The cell with the roll-out errors of the judged trials' whole tosses, with intervals and noise floors."""
    found = roll_out(model, dataset, np.unique(judged.trial).tolist(), generator(SEED, "rollout"))
    said = found.content("first_flight", generator(SEED, "intervals"))
    tosses = {
        name: (said[group][name], *said[group]["interval"][name], said["floor"][group][name])
        for group, names in GROUPS.items()
        for name in names
    }
    return numbers_in(tosses, 6)


def numbers(column: str) -> pd.DataFrame:
    """The stored numbers in the cells of a column, a row for each: drops, model and `NUMBERS`."""
    rows = [
        (one["drops"], one["model"], name, *values)
        for one in ROWS.parsed(dict)
        for name, values in numbers_of(one[column]).items()
    ]
    return pd.DataFrame(rows, columns=["drops", "model", *NUMBERS[column]])


def _floor(fitted: Fit, o: Observations) -> dict[str, float | None]:
    rest = floor(fitted, o, generator(SEED, "floor"))
    return {"learned": rest.learned, "low": rest.gain[1], "high": rest.gain[2], "pairs": rest.pairs}


def parameters(path: Path = ROWS.path) -> pd.DataFrame:
    """The stored parameters that are not merely bounded, a row for each: drops, model, name, value, std."""
    plain = str.maketrans("−⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "--0123456789")
    rows = [
        (one["drops"], one["model"], name, *(float(x.translate(plain).replace("·10", "e")) for x in (value, std)))
        for _, one in pd.read_csv(path).iterrows()
        for name, value, _, std in (text.split() for text in one["parameters"].split("; ") if "±" in text)
    ]
    return pd.DataFrame(rows, columns=["drops", "model", "name", "value", "std"])


def tables(path: Path = ROWS.path) -> tuple[str, str, str]:
    """The stored rows as Markdown: simulated drops, measured drops, and the parameters for measured drops."""
    stored = pd.read_csv(path)
    measured = np.array([SERIES[str(name)].is_measured for name in stored["drops"]])
    plain = [
        (one["drops"], _model(one), number(one["error"]), number(one["noise_floor"]))
        + ("" if one["gain"] == 0.0 else f"{one['gain']:,.0f}", one["parameters"])
        for _, one in stored[~measured].iterrows()
    ]
    head = ("drops", "model", "hits used", "error (median)", "noise", "single hits", "two corners at once", "episodes")
    return (
        markdown(("drops", "model", "error", "noise", "gain in nats", "parameters"), plain),
        markdown((*head, "with the rest learned", "nearest pairs"), map(_line, stored[measured].to_dict("records"))),
        "\n".join(f"{one['drops']}: {one['parameters']}" for _, one in stored[measured].iterrows()),
    )


def _line(one: dict) -> tuple[str, ...]:
    flat = f"{_cell(one['flat'])} ({one['flat_hits']})" if one["flat_hits"] else ""
    share = f"{100 * one['used'] / one['detected']:.0f} % of {one['detected']:,}"
    error = f"{number(one['error'])} ({number(one['median'])})"
    about = (one["drops"], _model(one), share, error, _cell(one["noise_floor"]), _cell(one["single"]), flat)
    return (*about, *(_cell(one[name]) for name in ("episodes", "learned", "pairs")))


def _model(one: Any) -> str:
    base, *effects = one["model"].split("+")
    return " with ".join(
        [BASES[base].title, *([", ".join(EFFECTS[name].title for name in effects)] if effects else [])]
    )


def _cell(value: float) -> str:
    return "" if np.isnan(value) else number(value)


def compute(names: Iterable[str], measured: Path, say: Callable[[str], object]) -> None:
    """Fit the models of the named series and store their rows; measured sets are in the folder `measured`."""
    for name in names:
        made = [stamped(row, rows) for row in rows(name, drops_of(SERIES[name], measured))]
        ROWS.put(*made)
        say("\n".join(f"{name}: {row['model']} {row['error']:.4f} m/s" for row in made))


def as_markdown() -> str:
    """All `tables`, one below the other."""
    return "\n\n".join(tables())
