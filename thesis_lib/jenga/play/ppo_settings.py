"""Settings of the reinforcement-learning baseline: reward, episodes and optimiser; the thesis gives none."""

from pydantic import Field

from thesis_lib.foundation.settings import Section


class RewardSettings(Section):
    """R = Σ_t [b1 Δx_t − b2 D1(p_t) − b3 D2(p_t)] + b4 D3, second-hand; see `push_env`."""

    progress: float = Field(0.1, ge=0, description="b1, per mm that the block moves along the push")
    tower: float = Field(0.2, ge=0, description="b2, per step, of the tower's perturbation (D1, 0 to 1)")
    fall: float = Field(100.0, ge=0, description="b3 where D2 is 1; own reading of D2 = 100 (a second source: −100)")
    extraction: float = Field(4.0, ge=0, description="b4, where the block is out and nothing is damaged (D3)")
    start: float = Field(0.08, ge=0, description="p from which D1 rises linearly; as quoted")
    limit: float = Field(0.4, gt=0, description="p at which D1 is 1 and beyond which D2 is 1; as quoted")
    distance: float = Field(20.0, gt=0, description="mm of any other block that are p = `limit`; as quoted")
    angle: float = Field(30.0, gt=0, description="degrees of any other block that are p = `limit`; as quoted")
    scale: float = Field(0.1, gt=0, description="of the whole reward; own choice: keeps the value's errors near 1")


class EpisodeSettings(Section):
    """One episode is one push of one block; all own choice."""

    first_tower: int = Field(2000, ge=2000, description="seeds of training towers are drawn from here on")
    towers: int = Field(10**6, ge=1, description="number of seeds that they are drawn from")
    pushes_per_tower: int = Field(20, ge=1, description="pushes after which a new tower is built and settled")
    full: bool = Field(False, description="push on the full tower instead of the reduced one (4 times slower)")
    offset: float = Field(8.0, gt=0, le=12.5, description="mm, contact offset of action ±1; the controller's largest")
    heading: float = Field(0.15, gt=0, le=1, description="rad, heading of action ±1; the controller's largest")
    retract: float = Field(0.5, ge=-1, lt=1, description="third action above which the robot retracts; own choice")


class PpoSettings(Section):
    """Proximal policy optimisation; stable-baselines3's numbers unless said."""

    reward: RewardSettings = Field(RewardSettings(), description="what is to be gained")
    episode: EpisodeSettings = Field(EpisodeSettings(), description="towers, blocks, actions")
    hidden: tuple[int, ...] = Field((64, 64), min_length=1, description="units of both networks' layers; second-hand")
    rollout: int = Field(256, ge=2, description="most samples between updates; own choice: a few pushes")
    batch: int = Field(64, ge=2, description="samples of a gradient step")
    epochs: int = Field(10, ge=1, description="passes over each rollout")
    rate: float = Field(3e-4, gt=0, description="of Adam")
    discount: float = Field(0.99, gt=0, le=1, description="γ")
    trace: float = Field(0.95, ge=0, le=1, description="λ of the generalised advantage estimate")
    clip: float = Field(0.2, gt=0, description="of the ratio of probabilities")
    spread: float = Field(-0.7, description="first log deviation of actions; own choice: 16 % of first steps retract")
    segment: int = Field(5000, ge=2, description="samples after which training is saved; own choice: 2 CPU minutes")
