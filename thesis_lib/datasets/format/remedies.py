"""Remedies for a wrong or missing key of dataset.yaml, schema 1 (plane) or 2 (space)."""

from collections.abc import Callable, Mapping

from thesis_lib.foundation.mistakes import Mistake

Remedies = Mapping[tuple[str, ...], str]
_SHARED: Remedies = {
    ("schema",): "write 'schema: 1' for a motion in a plane, 'schema: 2' for one in space (the versions of the format "
    "that this program reads)",
    ("description",): "write free text, in quotes if it holds a colon",
    ("body", "mass"): "give the mass in kg as a number above 0, or leave it out",
    ("body", "homogeneous"): "write true if the body is of one density throughout, or leave it out",
    ("body", "uncertainty"): "give relative standard uncertainties above 0 and below 1 ({mass: 0.001, size: 0.002}), "
    "or leave it out",
    ("rate",): "give the sampling rate in Hz as a number above 0, or leave it out",
    ("spin",): "give the spin in rad/s, one sigma, as a number above 0, or leave it out",
}
# the remedy of the nearest enclosing key applies
_BY_SCHEMA: dict[int, Remedies] = {
    1: {
        **_SHARED,
        ("body",): "give the section body with shape and radius_of_gyration",
        ("body", "shape"): "write {kind: ellipse, semi_axes: [a, b]}, {kind: disk, radius: R} or {kind: polygon, "
        "vertices: [[x, y], ...]}, in m from the centre of mass; solids (box, sphere, …) have 'schema: 2'",
        ("body", "radius_of_gyration"): "give it in m as a number above 0: sqrt(I/m) about the centre of mass "
        "(a/sqrt(6) for a uniform square of side a)",
        ("surface",): "write {height: 0.0}, the height of the surface in m, or leave it out",
        ("surfaces",): "write a list of walls {name: north, point: [x, y], normal: [0, -1]}: a point of the line in m, "
        "and the direction from the wall to the body; names have lower-case letters, digits and _",
        ("gravity",): "give 9.81 in m/s² (positive: it points down by convention), or leave it out; 0 for a motion "
        "over a level table",
        ("noise",): "give one-sigma values above 0 (position in m, angle in rad, velocity in m/s, angular_velocity in "
        "rad/s), or leave noise out",
        (): "give surface or surfaces, not both; each wall in surfaces needs a name of its own",
    },
    2: {
        **_SHARED,
        ("body",): "give the section body with shape and one of inertia: {xx: …, yy: …, zz: …} with the mass, "
        "radii_of_gyration: [k_x, k_y, k_z] and homogeneous: true",
        ("body", "shape"): "write {kind: box, half_extents: [a, b, c]}, {kind: sphere, radius: R}, {kind: ellipsoid, "
        "semi_axes: [a, b, c]}, {kind: cylinder, radius: R, half_length: h}, {kind: capsule, radius: R, half_length: "
        "h} or {kind: mesh, file: body.obj, scale: 0.001}, in m; planar shapes have 'schema: 1'",
        ("body", "center_of_mass"): "give [x, y, z] in m in the frame of the shape, or leave it out",
        ("body", "inertia"): "give {xx: …, yy: …, zz: …, xy: 0, xz: 0, yz: 0} in kg m² about the centre of mass, with "
        "xy = -∫ x y dm; no principal moment is above the sum of the others",
        ("body", "radii_of_gyration"): "give [k_x, k_y, k_z] in m, sqrt(I/m) about each axis through the centre of "
        "mass",
        ("tracked",): "write {position: [x, y, z], quaternion: [w, x, y, z]}, the pose of the tracked frame in that of "
        "the shape, or unknown, or leave it out",
        ("surface",): "write {point: [0, 0, 0], normal: [0, 0, 1]}: a point in m, and the direction from the surface "
        "to the body, in the axes of the recording; or leave it out",
        ("surfaces",): "write a list of {name: floor, point: [x, y, z], normal: [0, 0, 1]}, each with the corners of "
        "its extent: [[x, y, z], …] if it ends somewhere, and no surface beside it",
        ("gravity",): "give [0, 0, -9.81] in m/s², in the axes of the recording, or leave it out; [0, 0, 0] for none",
        ("noise",): "give one-sigma values above 0 (position in m, one number or [x, y, z]; rotation in rad, velocity "
        "in m/s, angular_velocity in rad/s), or leave noise out",
        (): "give surface: {point: [0, 0, 0], normal: [0, 0, 1]} or surfaces, not both",
    },
}
_SPACE_ONLY = "this key is for bodies in space ('schema: 2'); leave it out of a file with 'schema: 1'"
# keys of the other schema, and how to state the same in this one
_OTHER_FORM: dict[int, Remedies] = {
    1: dict.fromkeys(
        (
            ("tracked",),
            *(("body", name) for name in ("center_of_mass", "inertia", "radii_of_gyration")),
            *(("surface", name) for name in ("point", "normal")),
            ("noise", "rotation"),
        ),
        _SPACE_ONLY,
    ),
    2: {
        ("body", "radius_of_gyration"): _BY_SCHEMA[2]["body", "radii_of_gyration"].replace("give", "in space, give"),
        ("body", "shape", "edge_radius"): "remove it; only box, cylinder and mesh have edges",
        (
            "tracked",
            "rotation",
        ): "write quaternion: [w, x, y, z], which turns the axes of the tracked frame into the shape's",
        ("surface", "height"): "in space, write surface: {point: [0, 0, height], normal: [0, 0, 1]}",
        ("noise", "angle"): "in space, write rotation: rad, one sigma of each component of a small turn",
    },
}


def remedy_of(schema: int) -> Callable[[Mistake], str]:
    """Function that returns the remedy for a mistake in a file of this schema."""
    remedies, others = _BY_SCHEMA[schema], _OTHER_FORM[schema]

    def remedy(mistake: Mistake) -> str:
        if (place := tuple(map(str, mistake.place))) in others:
            return others[place]
        enclosing = (place[:n] for n in range(len(place), -1, -1))
        return mistake.remedy or next((remedies[part] for part in enclosing if part in remedies), "see the format")

    return remedy
