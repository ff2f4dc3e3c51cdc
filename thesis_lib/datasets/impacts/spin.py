"""The spin of a body whose angle is not measured: what is believed of it before an impact.

Friction at an impact gives a disk that slides without spin at most 2/3 of its tangential velocity as rim speed; a hand
gives as much.  So unless dataset.yaml states `spin`, the rim speed before an impact is taken as 0 ± `RIM` times the
median speed (one sigma).
"""

import numpy as np

from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.impacts import Impacts

RIM = 0.5


def unseen_spin(speed: np.ndarray, header: Header | SpaceHeader) -> float:
    """One sigma in rad/s of each component of the spin before impacts at speeds (n,) in m/s, where no angle is seen."""
    if header.spin is not None:
        return header.spin
    shape = header.body.shape if isinstance(header, Header) else header.body.solid
    return RIM * float(np.median(speed)) / shape.extent if len(speed) else 1.0


def spin_sentence(impacts: Impacts, header: Header) -> str:
    """Sentence on the spin that is assumed."""
    sigma = unseen_spin(np.hypot(*impacts.v_pre[:, :2].T), header)
    whence = "as dataset.yaml states" if header.spin is not None else f"a rim speed of {RIM:g} times the median speed"
    return (
        f"theta is not measured: the spin before each impact is unknown and taken as 0 ± {sigma:.3g} rad/s ({whence}); "
        "effects that show in the angle or the spin alone cannot be tested."
    )
