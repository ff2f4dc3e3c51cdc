"""Settings of the policies, the same for all learners: own choices, fixed on development towers 0 to 4."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class RuleSettings(Section):
    """The hand-written rule: straight, centred, with two thresholds.

    From a grid of 6 × 4 thresholds on straight pushes of tower 0, replayed under 6 draws of the sensor noise (flat
    between 0.3 and 1 N, 1.5 and 2 mm), then games on tower 1: 0.3 N, 1 mm gave 6 extractions; 0.75 N, 1.5 mm 9; 1.5 N,
    2 mm 8.
    """

    force: float = Field(0.75, gt=0, description="N along the push, above which the block is given up")
    tower: float = Field(1.5, gt=0, description="mm of tower perturbation as seen, above which it is given up")


class SupervisorSettings(Section):
    """The exploration's hand-coded supervisor (thesis, section 5.5.3): mitigates damage, tuned to allow mistakes."""

    force: float = Field(3.0, gt=0, description="N along the push, above which the block is given up")
    tower: float = Field(4.0, gt=0, description="mm of tower perturbation as seen, above which it is given up")
    stray: float = Field(12.0, gt=0, description="mm sideways or of yaw·r_g, beyond which it is given up")


class OracleSettings(Section):
    """The ceiling: each push is simulated before it is made."""

    offsets: tuple[float, ...] = Field((0.0,), min_length=1, description="mm, contacts of straight pushes, in turn")
    damage: float = Field(5.0, gt=0, description="mm of tower perturbation in push and extraction that is too much")


class ControllerSettings(Section):
    """Model predictive control; costs are dimensionless, 1 is what giving up costs.

    Weights: one grid of 960 points for all learners, on straight pushes of tower 0 replayed through HMA, MOR and
    network at 100 and 1000 samples, scored by blocks brought out less 0.15 per mm of tower displacement.  Then
    `effort`, `stray`, `no_move` and `probe` were set by hand after three games of HMA and one of the network on towers
    1 and 2, so HMA was tuned more than the others.
    """

    sequences: int = Field(64, ge=3, description="action sequences tried at each step")
    horizon: int = Field(5, ge=1, le=15, description="H, steps that each looks ahead")
    offset: float = Field(8.0, ge=0, le=12.5, description="mm, largest contact offset tried")
    heading: float = Field(0.15, ge=0, le=1, description="rad, largest heading tried")
    progress: float = Field(0.33, ge=0, description="weight of the share of the advance that the block does not make")
    growth: float = Field(0.33, ge=0, description="weight of the tower's growth per advance, mm/mm")
    damage: float = Field(3.2, gt=0, description="mm of tower perturbation (squared) that cost as much as giving up")
    stray: float = Field(12.0, gt=0, description="mm sideways or of yaw·r_g (squared) that cost as much as giving up")
    no_move: float = Field(1.0, ge=0, description="weight of the growth of p(no move); 0 for the ablation")
    effort: float = Field(0.1, ge=0, description="weight of (offset/largest)² + (heading/largest)²: no idle steering")
    change: float = Field(0.01, ge=0, description="cost of lifting the finger to touch elsewhere")
    probe: int = Field(2, ge=0, description="pushes before a block may be given up: the first poses are the noisiest")
    give_up: float = Field(1.0, gt=0, description="cost of retracting: what giving up a block is worth")


class PlaySettings(Section):
    """Everything that plays."""

    rule: RuleSettings = Field(RuleSettings(), description="the hand-written rule")
    supervisor: SupervisorSettings = Field(SupervisorSettings(), description="the exploration's supervisor")
    oracle: OracleSettings = Field(OracleSettings(), description="the ceiling")
    controller: ControllerSettings = Field(ControllerSettings(), description="model predictive control")
