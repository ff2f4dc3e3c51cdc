"""Common parts of all patches: the user's file, the plane of the drops in its body, the inertia tensor, the report.

A patch writes numbers identified from the drops into one body of an existing file: mass (if given), inertia, centre of
mass, friction, contact.  It leaves geometry, surface, gravity and options as they are, and reports them if the model
differs.  For a model in space, the tensor becomes that of the model, and the body must have the frame of the shape.
For a planar model, the moment about the axis across the plane becomes m k²; as planar drops determine no other moment,
the whole tensor of the file is scaled by the same factor, which keeps it physically possible.

Document types are refused: the entities that they declare could expand to gigabytes or open other files, and no
engine's file needs them.  Files that the user's file refers to are not opened.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from thesis_lib.critique.export.solid import ExportedBody, n
from thesis_lib.critique.export.splice import Element, Source
from thesis_lib.foundation.command_line import near
from thesis_lib.foundation.errors import UserError, first_line
from thesis_lib.foundation.regular_file import read_bytes

LARGEST = 20_000_000  # bytes; a humanoid's file has 0.1 MB, a file that contains meshes a few MB
SAME = 1e-9  # m


@dataclass(frozen=True)
class BodyAxes:
    """Axes of the user's body that are x and y of planar drops, as "xz"; None in space, where the frames are equal."""

    axes: str | None

    def __post_init__(self) -> None:
        axes = "xz" if self.axes is None else self.axes
        if len(axes) != 2 or len(set(axes)) != 2 or not set(axes) <= set("xyz"):
            raise UserError(f"--plane must be two different letters of x, y and z, such as xz; got {self.axes!r}.")

    @property
    def indices(self) -> list[int]:
        """Indices of the body's axes that lie in the plane of the drops; in space, of all axes."""
        return ["xyz".index(letter) for letter in self.axes or "xyz"]

    @property
    def across(self) -> int | None:
        """Index of the axis across the plane; None in space."""
        return None if self.axes is None else 3 - sum(self.indices)

    @property
    def order(self) -> list[int]:
        """Index of the body's axis for each axis of `ExportedBody`, whose plane is x-z."""
        return self.indices if self.across is None else [self.indices[0], self.across, self.indices[1]]

    def turned(self, array: np.ndarray) -> np.ndarray:
        """Return a vector (3,) or tensor (3, 3) of `ExportedBody` in the axes of the body."""
        new = np.empty_like(array)
        new[np.ix_(*[self.order] * array.ndim)] = array
        return new


class Patch:
    """A user's file with the edits made in it; `changed` and `left` are lines for the terminal."""

    def __init__(self, path: str | Path, plane: BodyAxes) -> None:
        """Read the file; UserError if it cannot be read, is not XML, has a document type, or nests too deeply."""
        self.path, self.plane = path, plane
        self.changed: list[str] = []
        self.left: list[str] = []
        self._prefixes: dict[str, str] = {}
        content = read_bytes(path, LARGEST)
        try:
            self.root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True))
        except etree.XMLSyntaxError as error:
            reason, remedy = error.msg.split(", line")[0], "check it, or name the file of your model"
            if reason.startswith("Namespace prefix drake "):
                remedy = (
                    'write <robot xmlns:drake="http://drake.mit.edu"> or <sdf xmlns:drake="drake.mit.edu"> at its top'
                )
            raise UserError(f"{path} is not XML: {reason} in line {error.lineno}; {remedy}.") from error
        if self.root.getroottree().docinfo.doctype:
            raise UserError(f"{path} has a document type (<!DOCTYPE ...>); remove it: no model needs it.")
        try:
            self._source = Source(content, self.root)
        except (LookupError, ValueError) as error:
            raise UserError(f"{path} cannot be patched ({first_line(error)}); save it as UTF-8.") from error

    def content(self) -> bytes:
        """Return the file; parts that were not edited are unchanged to the byte."""
        return self._source.content()

    def where(self, element: Element) -> str:
        return f"{self.path}, line {element.sourceline}"

    def named(
        self,
        elements: Iterable[Element],
        name: str,
        what: str,
        called: Callable[[Element], str] = lambda one: one.get("name", ""),
    ) -> Element:
        """Return the element that is `called` so; the UserError for an unknown name lists the known names."""
        by_name: dict[str, list[Element]] = {}
        for one in elements:
            by_name.setdefault(called(one), []).append(one)
        found, names = by_name.get(name, []), sorted(filter(None, by_name))
        if len(found) > 1:
            lines = f"lines {', '.join(str(one.sourceline) for one in found)}"
            raise UserError(f"{self.path} has {len(found)} {what} named {name!r} ({lines}); give each its own name.")
        if not found:
            known = f"it has {', '.join(names[:20])}" if names else f"it has no {what} with a name"
            raise UserError(f"{self.path} has no {what} named {name!r}{near(name, names)}; {known}.")
        return found[0]

    def numbers(self, element: Element | None, attribute: str = "", count: int = 0) -> list[float]:
        """Return the numbers of an attribute, or of the text; empty if either is missing.

        UserError if they are not finite, or if their number is not `count`.
        """
        said = None if element is None else element.get(attribute) if attribute else element.text
        try:
            values = [float(word) for word in (said or "").split()]
        except ValueError:
            values = [float("nan")]
        if element is not None:
            where = f"{self.where(element)}: <{etree.QName(element).localname}>"
            if not all(abs(value) < 1e300 for value in values):
                raise UserError(f"{where} {attribute}={(said or '')[:60]!r} must be finite numbers.")
            if count and len(values) != count:
                raise UserError(f"{where} needs {count} number(s) in {attribute or 'its text'}.")
        return values

    def write(self, what: str, values: Sequence[float], element: Element, attribute: str = "") -> None:
        """Write numbers into an attribute, or as the text, and report the change."""
        old = self.numbers(element, attribute)
        if old and n(*old) == n(*values):
            return
        self.changed.append(f"{what}: {n(*old) if old else 'none'} -> {n(*values)}")
        if attribute:
            element.set(attribute, n(*values))
        else:
            element.text = n(*values)

    def remove(self, element: Element, attribute: str) -> None:
        """Remove an attribute that would contradict the written numbers, and report the change."""
        self.changed.append(f"{attribute} of <{element.tag}>: {element.attrib.pop(attribute)} -> none")

    def insert(self, parent: Element, tag: str) -> Element:
        """Insert and return a first child, on a separate line if the other children are."""
        parent.insert(0, new := etree.Element(tag, nsmap=parent.nsmap | self._prefixes))
        return new

    def child(self, parent: Element, tag: str) -> Element:
        """Return the first child with this tag; if there is none, append one, on a separate line if the others are."""
        return etree.SubElement(parent, tag) if (found := parent.find(tag)) is None else found

    def declare(self, prefix: str, namespace: str) -> None:
        """Declare at the root the namespace of the elements that will be added."""
        self._prefixes = {prefix: namespace}
        self._source.declare(prefix, namespace)

    def inertia(self, old: np.ndarray, R: np.ndarray, solid: ExportedBody, where: str) -> np.ndarray:
        """Return the new tensor (3, 3) for a file, in axes that R maps to the body's axes; for planar drops the `old`
        tensor, scaled to the moment m k² across the plane.  UserError if `old` has no positive moment there."""
        if self.plane.across is None:
            return R.T @ solid.inertia @ R
        here = (R @ old @ R.T)[self.plane.across, self.plane.across]
        if not here > 0.0:
            raise UserError(
                f"{where} has no positive moment of inertia about {'xyz'[self.plane.across]}: correct it first."
            )
        return self.plane.turned(solid.inertia)[self.plane.across, self.plane.across] / here * old

    def moved(self, position: Sequence[float], solid: ExportedBody) -> list[float]:
        """Return the position of the centre of mass with the fitted offset; unchanged if none was fitted."""
        place, true = list(position), self.plane.turned(solid.centre)
        if "com_offset" in solid.model.effects:
            for i in self.plane.indices:
                place[i] = float(true[i])
        elif max(abs(place[i] - true[i]) for i in self.plane.indices) > SAME:
            believed = n(*(true[i] for i in self.plane.indices))
            self.left.append(f"centre of mass: stays at {n(*place)}; the critique of the drops assumed {believed}")
        return place

    def sharing(self, places: Iterable[Sequence[float]]) -> int:
        """Return the largest number of places (3,) that lie behind each other across the plane, and share the load."""
        flat = [tuple(np.round([place[i] for i in self.plane.indices], 9)) for place in places]
        return max(flat.count(one) for one in flat)


def not_patched(solid: ExportedBody) -> list[str]:
    """Return lines on properties of the model that a patch does not change, and on those that no file can express."""
    held = [f"{name}: {said}" for name, said in solid.not_patched.items() if name in solid.model.effects]
    of_geometry = (*solid.not_patched, "edge_radius")
    return [*held, *(f"{name}: {why}" for name, why in solid.left_out if name not in of_geometry)]
