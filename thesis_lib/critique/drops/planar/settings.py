"""Settings of what only planar drops have."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class OneBody(Section):
    """When drops count as those of two bodies, or of none that moves in a plane; tried on every simulated cause."""

    shrink: float = Field(
        3.0, gt=1, description="scatter with one body over that with two: splitting an even spread gives 2"
    )
    clear: float = Field(
        9.0, gt=0, description="difference of χ² at which a trial clearly belongs to one body: odds of 90 to 1"
    )
    unclear: float = Field(
        0.15, ge=0, le=1, description="largest share of trials without a clear body: what drifts leaves many in between"
    )
    smallest: float = Field(
        0.2, ge=0, le=0.5, description="least share of trials of either body: fewer may be wild ones"
    )
    near_noise: float = Field(
        1.5, ge=1, description="scatter over a known noise: two bodies must stay below it, as one alone may not"
    )
    sideways: float = Field(
        0.4,
        gt=0,
        description="acceleration in flight along the surface or in rotation, one sigma over gravity, beyond which the "
        "motion is not planar: a surface tilted by 0.13 rad gives 0.19",
    )
