"""Settings of simulated throws."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class ThrowSettings(Section):
    """When a simulated throw ends, and what is kept of it."""

    settle: float = Field(0.02, gt=0, lt=1, description="share of the barrier below which a body lies: hops of 0.2 mm")
    micro: float = Field(0.05, ge=0, description="m/s; slower contacts have restitution 1 (`throw`): hops of 0.1 mm")
    max_contacts: int = Field(
        150, ge=1, description="hits of single corners after which it is laid on a side, and counted"
    )
    snapshots: int = Field(3, ge=0, description="contacts whose states are kept")
    merge: float = Field(0.008, ge=0, description="s; nearer hits are one contact in snapshots: two frames at 250 Hz")
