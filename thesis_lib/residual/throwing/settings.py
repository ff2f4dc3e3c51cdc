"""Settings of simulated throws."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class ThrowSettings(Section):
    """When a simulated throw ends, and what is kept of it."""

    settle: float = Field(
        0.02,
        gt=0,
        lt=1,
        description="share of the energy barrier between sides below which a body lies; "
        "0.02 leaves hops of 0.2 mm on a die of 6 cm",
    )
    micro: float = Field(
        0.05,
        ge=0,
        description="m/s; contacts that approach more slowly are resolved by the law with restitution 1, so that a "
        "body that tips or slides on a corner hops on it by 0.1 mm instead of bouncing infinitely often",
    )
    max_contacts: int = Field(
        150, ge=1, description="hits of single corners after which a body is laid on its nearest side, and counted"
    )
    snapshots: int = Field(3, ge=0, description="contacts whose states are kept")
    merge: float = Field(
        0.008,
        ge=0,
        description="s; hits nearer in time than this are one contact in snapshots: two frames at 250 Hz, "
        "within which a camera sees one",
    )
