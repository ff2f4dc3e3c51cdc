"""The keys of dataset.yaml as a table, from the model that checks it."""

from collections.abc import Iterator

from thesis_lib.docs.configuration import kind
from thesis_lib.docs.markdown import code, table
from thesis_lib.foundation.settings import Section


def text() -> str:
    """Every key with its default."""
    from thesis_lib.datasets.format.header import Header

    return table(("key", "needed", "kind", "meaning"), _rows("", Header))


def _rows(path: str, section: type[Section]) -> Iterator[tuple[str, str, str, str]]:
    from thesis_lib.bodies.body import Body, Noise, Surface

    nested = {"body": Body, "surface": Surface, "noise": Noise}
    for name, field in section.model_fields.items():
        key = f"{path}{field.alias or name}"
        if not path and name in nested:
            yield from _rows(f"{key}.", nested[name])
        elif name == "shape":
            what = "see above: `ellipse`, `disk` or `polygon`"
            yield (
                code(key),
                "yes",
                what,
                "m, in the frame of the body, whose origin is the believed centre of mass",
            )
        else:
            needed = "yes" if field.is_required() else "no"
            if not field.is_required() and field.default not in (None, ""):
                needed += f", default {field.default:g}"
            yield code(key), needed, kind(field).removesuffix(" or null"), field.description or ""
