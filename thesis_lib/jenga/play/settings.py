"""Settings of chapter 5: towers, numbers of samples, policies.

Settings of policies are the same for all learners: own choices, fixed on development towers 0 to 4.  The thesis gives
none for the reinforcement-learning baseline (reward, episodes, optimiser).
"""

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.jenga.learners.settings import LearnerSettings, NutsSettings
from thesis_lib.jenga.tower.settings import Setup


class RewardSettings(Section):
    """Reward R = Σ_t [b1 Δx_t − b2 D1(p_t) − b3 D2(p_t)] + b4 D3, from a secondary source; see `push_env`."""

    progress: float = Field(0.1, ge=0, description="b1, per mm that the block moves along the push")
    tower: float = Field(0.2, ge=0, description="b2, per step, of the tower's perturbation (D1, 0 to 1)")
    fall: float = Field(100.0, ge=0, description="b3 where D2 is 1; own reading of D2 = 100 (another source: −100)")
    extraction: float = Field(4.0, ge=0, description="b4, where the block is out and nothing is damaged (D3)")
    start: float = Field(0.08, ge=0, description="p from which D1 rises linearly; as quoted")
    limit: float = Field(0.4, gt=0, description="p at which D1 is 1 and beyond which D2 is 1; as quoted")
    distance: float = Field(20.0, gt=0, description="mm of any other block at which p = `limit`; as quoted")
    angle: float = Field(30.0, gt=0, description="degrees of any other block at which p = `limit`; as quoted")
    scale: float = Field(0.1, gt=0, description="factor on the reward; own choice: keeps errors of the value near 1")


class EpisodeSettings(Section):
    """One episode is one push of one block; all own choice."""

    first_tower: int = Field(2000, ge=2000, description="lowest seed of the training towers")
    towers: int = Field(10**6, ge=1, description="number of seeds from which training towers are drawn")
    pushes_per_tower: int = Field(20, ge=1, description="pushes after which a new tower is built and settled")
    offset: float = Field(8.0, gt=0, le=12.5, description="mm, contact offset of action ±1; the controller's largest")
    heading: float = Field(0.15, gt=0, le=1, description="rad, heading of action ±1; the controller's largest")
    retract: float = Field(0.5, ge=-1, lt=1, description="third action above which the robot retracts; own choice")


class PpoSettings(Section):
    """Proximal policy optimisation; the defaults of stable-baselines3 unless stated otherwise."""

    reward: RewardSettings = Field(RewardSettings(), description="the reward")
    episode: EpisodeSettings = Field(EpisodeSettings(), description="towers, blocks, actions")
    hidden: tuple[int, ...] = Field((64, 64), min_length=1, description="units of both networks' layers; second-hand")
    rollout: int = Field(256, ge=2, description="most samples between updates; own choice: a few pushes' worth")
    batch: int = Field(64, ge=2, description="samples of a gradient step")
    epochs: int = Field(10, ge=1, description="passes over each rollout")
    rate: float = Field(3e-4, gt=0, description="learning rate of Adam")
    discount: float = Field(0.99, gt=0, le=1, description="γ, discount per step")
    trace: float = Field(0.95, ge=0, le=1, description="λ of the generalised advantage estimate")
    clip: float = Field(0.2, gt=0, description="ε, limit of the change of the probability ratio")
    spread: float = Field(-0.7, description="first log deviation of actions; 16 % of first steps retract (own choice)")
    segment: int = Field(
        5000,
        ge=2,
        description="samples of a part of the training, each with its own random numbers; own choice: 2 CPU minutes",
    )


class RuleSettings(Section):
    """The hand-written rule: straight, centred, with two thresholds.

    Chosen on a grid of 6 × 4 thresholds: straight pushes of tower 0, replayed under 6 draws of the sensor noise (flat
    between 0.3 and 1 N, 1.5 and 2 mm), then games on tower 1: 0.3 N, 1 mm gave 6 extractions; 0.75 N, 1.5 mm 9; 1.5 N,
    2 mm 8.
    """

    force: float = Field(0.75, gt=0, description="N along the push, above which the block is given up")
    tower: float = Field(1.5, gt=0, description="mm of measured tower perturbation, above which it is given up")


class SupervisorSettings(Section):
    """The exploration's hand-coded supervisor (thesis, section 5.5.3): mitigates damage, tuned to allow mistakes."""

    force: float = Field(3.0, gt=0, description="N along the push, above which the block is given up")
    tower: float = Field(4.0, gt=0, description="mm of measured tower perturbation, above which it is given up")
    stray: float = Field(12.0, gt=0, description="mm sideways or of yaw·r_g, beyond which it is given up")


class OracleSettings(Section):
    """Oracle, the upper bound: each push is simulated before it is made."""

    offsets: tuple[float, ...] = Field((0.0,), min_length=1, description="mm, contacts of straight pushes to try")
    damage: float = Field(5.0, gt=0, description="mm of tower perturbation that a push with extraction must not exceed")


class ControllerSettings(Section):
    """Model predictive control; costs are dimensionless, giving up costs 1.

    Weights: one grid of 960 points for all learners, on straight pushes of tower 0 replayed through HMA, MOR and
    network at 100 and 1000 samples, scored by blocks brought out minus 0.15 per mm of tower displacement.  Then
    `effort`, `stray`, `no_move` and `probe` were set by hand after three games of HMA and one of the network on towers
    1 and 2; HMA was therefore tuned more than the others.
    """

    sequences: int = Field(64, ge=3, description="action sequences tried at each step")
    horizon: int = Field(5, ge=1, le=15, description="H, steps in each sequence")
    offset: float = Field(8.0, ge=0, le=12.5, description="mm, largest contact offset tried")
    heading: float = Field(0.15, ge=0, le=1, description="rad, largest heading tried")
    progress: float = Field(0.33, ge=0, description="weight of the share of the advance that the block does not follow")
    growth: float = Field(0.33, ge=0, description="weight of the tower's growth per advance, mm/mm")
    damage: float = Field(3.2, gt=0, description="mm of tower perturbation (squared) that cost as much as giving up")
    stray: float = Field(12.0, gt=0, description="mm sideways or of yaw·r_g (squared) that cost as much as giving up")
    no_move: float = Field(1.0, ge=0, description="weight of the growth of p(no move); 0 for the ablation")
    effort: float = Field(0.1, ge=0, description="weight of (offset/largest)² + (heading/largest)²: no idle steering")
    change: float = Field(0.01, ge=0, description="cost of lifting the finger to touch elsewhere")
    probe: int = Field(2, ge=0, description="pushes before a block may be given up: the first poses are the noisiest")
    give_up: float = Field(1.0, gt=0, description="cost of retracting, that is, of giving up a block")


class PlaySettings(Section):
    """All policies."""

    rule: RuleSettings = Field(RuleSettings(), description="the hand-written rule")
    supervisor: SupervisorSettings = Field(SupervisorSettings(), description="the exploration's supervisor")
    oracle: OracleSettings = Field(OracleSettings(), description="the upper bound")
    controller: ControllerSettings = Field(ControllerSettings(), description="model predictive control with a learner")


class TowerChoice(Section):
    """Seeds of towers.  Development, training, held-out and test towers are always different."""

    development: int = Field(5, ge=1, le=5, description="towers 0, 1, ... on which settings were fixed, scanned")
    test: int = Field(3, ge=1, description="test towers that are scanned, like those of development")
    scanned: int = Field(45, ge=3, le=45, description="blocks of each tower that are scanned, evenly spread")
    compared: int = Field(15, ge=2, le=45, description="of these, on tower 0 also finer, reduced and pulled out")
    first_test: int = Field(100, ge=100, description="seed of the first test tower")
    first_training: int = Field(1000, ge=1000, description="seed of the first tower of training samples")
    first_held_out: int = Field(50_000, ge=50_000, description="seed of the first tower of held-out pushes")


class GameChoice(Section):
    """Games of the study; each is stored in its own file, so an interrupted study continues where it stopped."""

    towers: int = Field(2, ge=1, description="test towers, the same for all policies")
    learner_towers: int = Field(0, ge=0, description="towers of `learners` and `ablations`, if more than `towers`")
    paired_towers: int = Field(0, ge=0, description="towers of hma, network (`shown`), rule, exploration, if more")
    blocks: int = Field(45, ge=1, le=45, description="blocks tried in a game; the thesis's 45")
    learners: tuple[str, ...] = Field(("hma", "mor", "network"), description="policies that learn, at every size")
    sizes: tuple[int, ...] = Field((100, 1000), min_length=1, description="training samples")
    shown: int = Field(100, ge=20, description="one of `sizes`, for ablations and figure 5-6 (thesis: 100)")
    ppo_sizes: tuple[int, ...] = Field((2500,), description="samples of PPO: checkpoints of one training")
    fixed: tuple[str, ...] = Field(("rule", "exploration"), description="policies without training")
    ablations: tuple[str, ...] = Field((), description="policies that learn, at `shown` only")

    def played(self) -> dict[tuple[str, int], int]:
        """Number of test towers on which each policy plays, by (policy, samples; 0 if it does not learn)."""
        learned = [(policy, size) for policy in self.learners for size in self.sizes]
        learned += [(policy, self.shown) for policy in self.ablations]
        others = [*(("ppo", size) for size in self.ppo_sizes), *((policy, 0) for policy in self.fixed)]
        towers = dict.fromkeys(learned, max(self.towers, self.learner_towers)) | dict.fromkeys(others, self.towers)
        paired = [("hma", self.shown), ("network", self.shown), ("rule", 0), ("exploration", 0)]
        return towers | {key: max(towers[key], self.paired_towers) for key in paired if key in towers}


class SampleChoice(Section):
    """Samples of the base exploration policy."""

    sets: int = Field(3, ge=1, description="training sets; game i uses set i modulo this, to average over sets")
    shift: int = Field(0, ge=0, description="game i uses the set this many later: crosses sets with towers")
    per_tower: int = Field(50, ge=20, description="samples of one tower: a set of 100 is from two (own choice)")
    held_out: int = Field(300, ge=100, description="samples of other towers, for abstractions and their agreement")

    def of_game(self, tower: int) -> int:
        """Number of the training set of the games on a tower."""
        return (tower + self.shift) % self.sets


class ShowcaseChoice(Section):
    """The two pushes of figure 5-8 and the steered push of figure 5-9."""

    samples: int = Field(1000, ge=50, description="training samples of the model that is shown")
    steps: int = Field(30, ge=1, description="steps of 1 mm of figure 5-8's pushes")
    every: int = Field(10, ge=1, description="steps between two runs of NUTS")
    nuts: NutsSettings = NutsSettings()
    steered_blocks: int = Field(3, ge=1, description="free blocks of figure 5-9, on development towers")
    edge: float = Field(8.0, gt=0, le=12.5, description="mm off the centre, contact of the disturbing pushes")
    turned: float = Field(2.0, gt=0, description="mm of yaw·r_g by which they turn a block (5 degrees); own choice")
    disturbed: int = Field(16, ge=1, description="steps in which it must turn, half the way out; own choice")
    # figure 5-9's controller: as in the games, but straying costs 16 times as much, and it never gives up
    steering: ControllerSettings = ControllerSettings(stray=3.0, effort=0.01, give_up=1e6)


class HiddenChoice(Section):
    """Effects absent from training (glued blocks, a slippery layer, a heavier pusher), and the amount of test data."""

    effects: tuple[str, ...] = Field(("glued", "slippery", "heavy_tool"), description="hidden effects that are studied")
    towers: int = Field(3, ge=2, description="towers with the effect: the first half retrains, the others test")
    pushes: int = Field(12, ge=4, description="pushes of blocks with the effect, on all these towers")
    others: int = Field(12, ge=4, description="pushes of other blocks of the same towers, where there are any")
    pusher_mass: float = Field(0.15, gt=0, description="kg of the heavier tool; own choice")
    layer: int = Field(6, ge=0, le=13, description="layer of glued or slippery blocks; own choice: mid-tower")


class ExpertChoice(Section):
    """Numbers of experts of the mixture of regressions that are tried, besides its own range 2 to 11 (thesis)."""

    fewest: int = Field(1, ge=1, description="experts; 1: a single regression")
    most: int = Field(13, ge=2, description="experts; beyond the number that the thesis found")


class Chapter5(Section):
    """Chapter 5: abstractions of a Jenga tower's mechanics, and a robot that plays."""

    setup: Setup = Setup()
    learner: LearnerSettings = LearnerSettings()
    play: PlaySettings = PlaySettings()
    ppo: PpoSettings = PpoSettings()
    towers: TowerChoice = TowerChoice()
    samples: SampleChoice = SampleChoice()
    games: GameChoice = GameChoice()
    showcase: ShowcaseChoice = ShowcaseChoice()
    hidden: HiddenChoice = HiddenChoice()
    experts: ExpertChoice = ExpertChoice()
