"""Settings of simulated throws."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class ThrowSettings(Section):
    """End of a simulated throw, and states stored during it."""

    settle: float = Field(0.02, gt=0, lt=1, description="share of the barrier below which it rests: hops of 0.2 mm")
    micro: float = Field(0.05, ge=0, description="m/s; slower contacts have restitution 1 (`throw`): hops of 0.1 mm")
    max_contacts: int = Field(
        150, ge=1, description="hits of single corners after which a body is put on a side, and counted"
    )
    snapshots: int = Field(3, ge=0, description="number of contacts whose states are stored")
    merge: float = Field(0.008, ge=0, description="s; closer hits are one contact in snapshots: two frames at 250 Hz")
