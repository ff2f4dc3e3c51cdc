"""Settings of the No-U-Turn sampler, in a separate module so that configuration needs neither torch nor pandas."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class NutsSettings(Section):
    """The sampler (own choices; the thesis says Hamiltonian Monte Carlo only)."""

    chains: int = Field(4, ge=4, description="chains, run side by side")
    warm_up: int = Field(300, ge=50, description="steps of adaptation, thrown away")
    draws: int = Field(300, ge=50, description="draws of each chain")
    target_accept: float = Field(0.85, gt=0.5, lt=1, description="acceptance that the step size aims at")
    max_tree_depth: int = Field(8, ge=4, le=10, description="doublings of a trajectory at most")
