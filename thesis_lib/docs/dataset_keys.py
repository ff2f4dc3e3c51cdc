"""The keys of dataset.yaml and recording.yaml as tables, from the models that check them."""

import json
from collections.abc import Iterator, Mapping

from pydantic.fields import FieldInfo

from thesis_lib.docs.configuration import kind
from thesis_lib.foundation.markdown import code, table
from thesis_lib.foundation.settings import Section

Nested = Mapping[str, type[Section]]


def text() -> str:
    """Every key of schema 1 with its default."""
    from thesis_lib.bodies.body import Body, Noise, Surface, Uncertainty
    from thesis_lib.bodies.walls import Wall
    from thesis_lib.datasets.format.header import Header

    nested = {"body": Body, "surface": Surface, "noise": Noise, "body.uncertainty": Uncertainty, "surfaces": Wall}
    return table(("key", "needed", "kind", "meaning"), _rows("", Header, nested))


def space_text() -> str:
    """Every key of schema 2 with its default."""
    from thesis_lib.bodies import solid_body
    from thesis_lib.datasets.format.space_header import SpaceHeader

    nested: Nested = {
        "body": solid_body.SolidBody,
        "body.inertia": solid_body.InertiaTensor,
        "body.uncertainty": solid_body.SolidUncertainty,
        "tracked": solid_body.Tracked,
        "tracked.uncertainty": solid_body.TrackedUncertainty,
        "surface": solid_body.FlatSurface,
        "surfaces": solid_body.NamedSurface,
        "noise": solid_body.NoiseInSpace,
    }
    return table(("key", "needed", "kind", "meaning"), _rows("", SpaceHeader, nested))


def recording_text() -> str:
    """Every key of recording.yaml with its default, those of the arm before those of the wheel."""
    from thesis_lib.datasets.recordings.header import Arm, RecordingHeader, Sampling, StateNoise, Wheel

    rows: list[tuple[str, str, str, str]] = []
    nested = {"mechanism": (Arm, Wheel), "noise": (StateNoise,), "sampling": (Sampling,)}
    for name, field in RecordingHeader.model_fields.items():
        for section in nested.get(name, ()):
            rows += _rows(f"{name}.", section, {})
        if name not in nested:
            rows.append(_row("", name, field))
    return table(("key", "needed", "kind", "meaning"), rows)


def _rows(path: str, section: type[Section], nested: Nested) -> Iterator[tuple[str, str, str, str]]:
    for name, field in section.model_fields.items():
        key = f"{path}{field.alias or name}"
        if key == "surfaces":
            yield code(key), "no", "list", field.description or ""
            yield from _rows("surfaces[].", nested[key], nested)
        elif key in nested:
            yield from _rows(f"{key}.", nested[key], nested)
        elif name == "shape":
            yield code(key), "yes", "see above", "m, in the frame of the body"
        else:
            yield _row(path, name, field)


def _row(path: str, name: str, field: FieldInfo) -> tuple[str, str, str, str]:
    needed = "yes" if field.is_required() else "no"
    if not field.is_required() and field.default not in (None, ""):
        number = isinstance(field.default, (int, float)) and not isinstance(field.default, bool)
        needed += f", default {f'{field.default:g}' if number else json.dumps(field.default)}"
    key = code(f"{path}{field.alias or name}")
    return key, needed, kind(field).removesuffix(" or null"), field.description or ""
