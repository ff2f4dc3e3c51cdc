"""Models that were not fitted, as if a critique had saved them."""

from thesis_lib.bodies.body import Body
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import parameters_in
from thesis_lib.mechanics.space import SPACE
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY

BOX = {"kind": "box", "half_extents": (0.05, 0.04, 0.03)}
SPHERE = {"kind": "sphere", "radius": 0.04}


def space_model(law: str = "mirtich", shape: dict = BOX, rig: dict | None = None, **values: float) -> SavedSpaceModel:
    """A homogeneous body with this law and these values, by default μ 0.25 and ε 0.5."""
    values = {"mu": 0.25, "epsilon": 0.5, **values}
    names = tuple(dict.fromkeys(name.split(".")[0] for name in values if "." in name))
    units = {"tau": "s"} | {f"{n}.{p.name}": p.unit for n in names for p in parameters_in(EFFECTS[n], SPACE)}
    body = {"shape": shape, "mass": 0.25, "homogeneous": True}
    return SavedSpaceModel.model_validate(
        {"schema": 1, "dimensions": 3, "dataset": "none", "law": law, "effects": names}
        | {"parameters": {name: {"value": value, "unit": units.get(name, "1")} for name, value in values.items()}}
        | {"rig": {"schema": 2, "body": body, **(rig or {})}}
    )


def model_of(height: float = 0.0, body: Body = ELLIPSE_BODY, law: str = "wang_mason", **values: float) -> SavedModel:
    """The law with these values, of a contact that takes time with tau; for the body of the proof if no other."""
    names = tuple(dict.fromkeys(name.split(".")[0] for name in values if "." in name))
    declared = Model(BASES[law], tuple(EFFECTS[name] for name in names), "tau" in values).parameters
    rig = {"shape": body.shape.model_dump(), "radius_of_gyration": body.radius_of_gyration}
    return SavedModel.model_validate(
        {
            **{"schema": 1, "law": law, "effects": names},
            "parameters": {name: {"value": values[name], "unit": p.unit} for name, p in declared.items()},
            "rig": rig | {"gravity": 9.81, "height": height},
        }
    )
