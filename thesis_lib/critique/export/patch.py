"""What all patches share: the plane of the drops in the user's body, the tensor of inertia, what is reported.

A patch writes numbers that the drops have shown into one body of a file that exists: mass (if given), inertia, centre
of mass, friction, contact.  It leaves geometry, surface, gravity and options as they are, and says so where the model
has something about them.  The moment of inertia about the axis across the plane becomes m k²; as the drops show no
other, the whole tensor of the file is scaled by that factor, so that it stays that of a body.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from thesis_lib.critique.export.solid import Solid
from thesis_lib.critique.export.text import n
from thesis_lib.critique.export.xml_edit import Edits, Element
from thesis_lib.foundation.command_line import near
from thesis_lib.foundation.errors import UserError

# effects that are about what a patch leaves alone
NOT_PATCHED = {
    "wrong_size": "geometry is not patched: scale it by {factor:.6g}",
    "rounded_corners": "geometry is not patched: round the corners with {radius:.6g} m",
    "surface_height": "the surface is not patched: its height is {height:.6g} m",
    "surface_tilt": "the surface is not patched: its normal leans by {tilt:.6g} rad towards the x of the drops",
    "wrong_gravity": "gravity is not patched: it is {gravity:.6g} m/s^2",
}
SAME = 1e-9  # m


@dataclass(frozen=True)
class Plane:
    """Axes of the user's body that are x and y of the drops, as "xz"."""

    axes: str

    def __post_init__(self) -> None:
        if len(self.axes) != 2 or len(set(self.axes)) != 2 or not set(self.axes) <= set("xyz"):
            raise UserError(f"--plane must be two different letters of x, y and z, as xz; got {self.axes!r}.")

    @property
    def indices(self) -> list[int]:
        """Of the drops' x and y among the axes of the body."""
        return ["xyz".index(letter) for letter in self.axes]

    @property
    def across(self) -> int:
        """Index of the axis across the plane."""
        return 3 - sum(self.indices)

    def turned(self, tensor: np.ndarray) -> np.ndarray:
        """A tensor (3, 3) of `Solid`, whose plane is x-z, in the axes of the body."""
        new = np.empty((3, 3))
        order = [self.indices[0], self.across, self.indices[1]]
        new[np.ix_(order, order)] = tensor
        return new


@dataclass
class Report:
    """What a patch did and did not, as lines for the terminal."""

    changed: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)

    def change(self, what: str, old: Iterable[float] | None, new: Iterable[float]) -> None:
        before = "none" if old is None else n(*old)
        self.changed.append(f"{what}: {before} -> {n(*new)}")


def named(edits: Edits, elements: Sequence[Element], name: str, what: str) -> Element:
    """The element of this name; UserError with those that there are."""
    found = [one for one in elements if one.attributes.get("name") == name]
    if len(found) == 1:
        return found[0]
    names = sorted({one.attributes["name"] for one in elements if "name" in one.attributes})
    if len(found) > 1:
        lines = ", ".join(str(one.line) for one in found)
        raise UserError(f"{edits.path} has {len(found)} {what} named {name!r} (lines {lines}); give each its own name.")
    known = f"it has {', '.join(names[:20])}" if names else f"it has no {what} with a name"
    raise UserError(f"{edits.path} has no {what} named {name!r}{near(name, names)}; {known}.")


def inertia_factor(tensor: np.ndarray, solid: Solid, plane: Plane, where: str) -> float:
    """What makes m k² of the moment across the plane of a file's tensor (3, 3); UserError if it has none there."""
    old = tensor[plane.across, plane.across]
    if not old > 0.0:
        raise UserError(f"{where} has no positive moment of inertia about {'xyz'[plane.across]}; mend it first.")
    return float(solid.mass * solid.k_g**2 / old)


def moved(position: Sequence[float], solid: Solid, plane: Plane, report: Report) -> list[float] | None:
    """The place of the centre of mass with the fitted offset; None if it stays."""
    place = list(position)
    if "com_offset" not in solid.model.effects:
        if max(abs(place[i]) for i in plane.indices) > SAME:
            report.left.append(
                f"centre of mass: stays at {n(*place)}; in the drops it was believed at the body's origin"
            )
        return None
    for i, value in zip(plane.indices, solid.com):
        place[i] = float(value)
    return place


def not_patched(solid: Solid) -> list[str]:
    """What the model has of things that a patch leaves alone, and what no file can hold."""
    values = {
        "factor": 1.0 + solid.model.values.get("wrong_size.s", 0.0),
        "radius": solid.corner_radius,
        "height": solid.height,
        "tilt": solid.tilt,
        "gravity": solid.gravity,
    }
    held = [f"{name}: {NOT_PATCHED[name].format(**values)}" for name, _ in solid.expressed if name in NOT_PATCHED]
    return [*held, *(f"{name}: {why}" for name, why in solid.left_out if name not in NOT_PATCHED)]
