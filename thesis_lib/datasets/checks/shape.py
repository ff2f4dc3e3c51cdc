"""Do the shape and the surface of dataset.yaml fit the poses at which the body touches?"""

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.checks.known_body import FILE, SHAPE_METRES
from thesis_lib.datasets.format.validate import Problem

GROSS_SIZE = 1.4  # ratio of heights at impact to those of the shape; beyond any error of ruler or frame
FEW_HITS = 10  # impacts below which shape and surface are not judged
BLIND_SHAPE = 0.1  # extents by which the lowest point moves over a turn; below, the gap does not depend on theta
FACTORS = {  # likely causes of a shape that is too large by a factor
    2.0: "diameters given as semi-axes or radius?",
    10.0: "centimetres for millimetres?",
    0.1: "millimetres for centimetres?",
    25.4: "inches?",
    100.0: "centimetres?",
    1000.0: "millimetres?",
}
NEAR = 0.15  # relative distance to such a factor


def contradictions(shape: Shape, height: float, q: np.ndarray) -> list[Problem]:
    """How poses q (n, 3) at impact, in m and rad, contradict the shape and the surface height (m).

    At impact the lowest point touches: y − height = reach(θ).  If the ratio of the two is far from 1 in most impacts,
    the shape is wrong by that factor or the surface lies elsewhere; the reading with less scatter is reported.
    """
    if len(q) < FEW_HITS:
        return []
    reach, centre = -shape.contact_point(q[:, 2])[:, 1], q[:, 1] - height
    ratio = float(np.median(centre / reach))
    if 1.0 / GROSS_SIZE < ratio < GROSS_SIZE:
        return []
    offset = float(np.median(centre - reach))

    def scatter(rest: np.ndarray) -> float:
        return float(np.median(np.abs(rest - np.median(rest))))

    what = f"at {len(q)} impacts the centre is {ratio:.3g} times as high above the surface as the shape says"
    closes = f"surface.height {height + offset:.4g} m instead of {height:g} m would close the gap of {offset:+.3g} m"
    round_body = np.ptp(reach) < BLIND_SHAPE * shape.extent
    if ratio > 0.0 and (round_body or scatter(centre - ratio * reach) < scatter(centre - reach)):
        times = 1.0 / ratio
        why = next((f" ({text})" for factor, text in FACTORS.items() if abs(times / factor - 1.0) < NEAR), "")
        what += f": the shape is {max(times, ratio):.3g} times too {'large' if times > 1 else 'small'}{why}"
        what += f"; or {closes}" if round_body else ""
        return [Problem(FILE, "body.shape", what, SHAPE_METRES + ", semi-axes and not diameters")]
    remedy = "correct surface.height, or the shape, or y, which must be that of the body's centre of mass"
    return [Problem(FILE, "surface.height", f"{what}: {closes}", remedy)]
