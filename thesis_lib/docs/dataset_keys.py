"""The keys of dataset.yaml and recording.yaml as tables, from the models that check them."""

import json
from collections.abc import Iterator

from pydantic.fields import FieldInfo

from thesis_lib.docs.configuration import kind
from thesis_lib.foundation.markdown import code, table
from thesis_lib.foundation.settings import Section


def text() -> str:
    """Every key with its default."""
    from thesis_lib.datasets.format.header import Header

    return table(("key", "needed", "kind", "meaning"), _rows("", Header))


def recording_text() -> str:
    """Every key of recording.yaml with its default, those of the arm before those of the wheel."""
    from thesis_lib.datasets.recordings.header import Arm, RecordingHeader, Sampling, StateNoise, Wheel

    rows: list[tuple[str, str, str, str]] = []
    nested = {"mechanism": (Arm, Wheel), "noise": (StateNoise,), "sampling": (Sampling,)}
    for name, field in RecordingHeader.model_fields.items():
        for section in nested.get(name, ()):
            rows += _rows(f"{name}.", section)
        if name not in nested:
            rows.append(_row("", name, field))
    return table(("key", "needed", "kind", "meaning"), rows)


def _rows(path: str, section: type[Section]) -> Iterator[tuple[str, str, str, str]]:
    from thesis_lib.bodies.body import Body, Noise, Surface, Uncertainty
    from thesis_lib.bodies.walls import Wall

    nested = {"body": Body, "surface": Surface, "noise": Noise, "body.uncertainty": Uncertainty}
    for name, field in section.model_fields.items():
        key = f"{path}{field.alias or name}"
        if key == "surfaces":
            yield code(key), "no", "list", field.description or ""
            yield from _rows("surfaces[].", Wall)
        elif key in nested:
            yield from _rows(f"{key}.", nested[key])
        elif name == "shape":
            what = "see above: `ellipse`, `disk` or `polygon`"
            yield (code(key), "yes", what, "m, in the frame of the body, whose origin is the believed centre of mass")
        else:
            yield _row(path, name, field)


def _row(path: str, name: str, field: FieldInfo) -> tuple[str, str, str, str]:
    needed = "yes" if field.is_required() else "no"
    if not field.is_required() and field.default not in (None, ""):
        number = isinstance(field.default, (int, float)) and not isinstance(field.default, bool)
        needed += f", default {f'{field.default:g}' if number else json.dumps(field.default)}"
    key = code(f"{path}{field.alias or name}")
    return key, needed, kind(field).removesuffix(" or null"), field.description or ""
