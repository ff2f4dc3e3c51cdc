"""Models of bodies in space that were not fitted, as if a critique had saved them."""

from thesis_lib.critique.results.saved_in_space import SavedSpaceModel

BOX = {"kind": "box", "half_extents": (0.05, 0.04, 0.03)}
SPHERE = {"kind": "sphere", "radius": 0.04}


def space_model(law: str = "mirtich", shape: dict = BOX, rig: dict | None = None, **values: float) -> SavedSpaceModel:
    """A homogeneous body with this law and these values, by default μ 0.25 and ε 0.5."""
    values = {"mu": 0.25, "epsilon": 0.5, **values}
    names = tuple(dict.fromkeys(name.split(".")[0] for name in values if "." in name))
    body = {"shape": shape, "mass": 0.25, "homogeneous": True}
    return SavedSpaceModel.model_validate(
        {"schema": 1, "dimensions": 3, "dataset": "none", "law": law, "effects": names}
        | {"parameters": {name: {"value": value, "unit": "1"} for name, value in values.items()}}
        | {"rig": {"schema": 2, "body": body, **(rig or {})}}
    )
