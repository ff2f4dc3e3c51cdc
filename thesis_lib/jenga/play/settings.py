"""Settings of all of chapter 5: towers, numbers of samples, policies."""

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.jenga.learners.settings import LearnerSettings, NutsSettings
from thesis_lib.jenga.play.controller_settings import ControllerSettings, PlaySettings
from thesis_lib.jenga.play.ppo_settings import PpoSettings
from thesis_lib.jenga.tower.settings import Setup


class TowerChoice(Section):
    """Seeds of towers.  Development, training, held-out and test towers are different ones everywhere."""

    development: int = Field(5, ge=1, le=5, description="towers 0, 1, ... on which settings were fixed, scanned")
    test: int = Field(3, ge=1, description="towers of the study that are scanned, too")
    scanned: int = Field(45, ge=3, le=45, description="blocks of each tower that are scanned, evenly spread")
    compared: int = Field(15, ge=2, le=45, description="of them on tower 0 also finer, reduced and pulled out")
    first_test: int = Field(100, ge=100, description="seed of the first test tower")
    first_training: int = Field(1000, ge=1000, description="seed of the first tower of training samples")
    first_held_out: int = Field(50_000, ge=50_000, description="seed of the first tower of held-out pushes")


class GameChoice(Section):
    """Games of the study; each is a file of its own, so that an interrupted study goes on where it was."""

    towers: int = Field(2, ge=1, description="test towers, the same for all policies")
    learner_towers: int = Field(0, ge=0, description="towers of `learners` and `ablations`, if more than `towers`")
    paired_towers: int = Field(0, ge=0, description="towers of hma, network (`shown`) and rule, if more than those")
    blocks: int = Field(45, ge=1, le=45, description="blocks tried in a game; the thesis's 45")
    learners: tuple[str, ...] = Field(("hma", "mor", "network"), description="policies that learn, at every size")
    sizes: tuple[int, ...] = Field((100, 1000), min_length=1, description="training samples")
    shown: int = Field(100, ge=20, description="of `sizes`: of the ablations and of figure 5-6 (100 in the thesis)")
    ppo_sizes: tuple[int, ...] = Field((1000, 2500), description="samples of PPO: checkpoints of one training")
    fixed: tuple[str, ...] = Field(("rule", "always_push", "exploration", "oracle"), description="without training")
    ablations: tuple[str, ...] = Field(("hma_without_cost",), description="policies that learn, at `shown` only")

    def played(self) -> dict[tuple[str, int], int]:
        """On how many test towers each policy plays, by (policy, samples; 0: does not learn)."""
        learned = [(policy, size) for policy in self.learners for size in self.sizes]
        learned += [(policy, self.shown) for policy in self.ablations]
        others = [*(("ppo", size) for size in self.ppo_sizes), *((policy, 0) for policy in self.fixed)]
        towers = dict.fromkeys(learned, max(self.towers, self.learner_towers)) | dict.fromkeys(others, self.towers)
        paired = [("hma", self.shown), ("network", self.shown), ("rule", 0)]
        return towers | {key: max(towers.get(key, 0), self.paired_towers) for key in paired}


class SampleChoice(Section):
    """Samples of the base exploration policy."""

    sets: int = Field(3, ge=1, description="training sets; game i uses set i modulo this, so that luck averages out")
    shift: int = Field(0, ge=0, description="game i uses the set that many later: crosses training sets with towers")
    per_tower: int = Field(50, ge=20, description="samples of one tower: a set of 100 has seen two (own choice)")
    held_out: int = Field(300, ge=100, description="samples of other towers, for abstractions and their agreement")

    def of_game(self, tower: int) -> int:
        """Number of the training set of the games on a tower."""
        return (tower + self.shift) % self.sets


class ShowcaseChoice(Section):
    """The two pushes of figure 5-8 and the steered one of figure 5-9."""

    samples: int = Field(1000, ge=50, description="that train the model which is shown")
    steps: int = Field(30, ge=1, description="steps of 1 mm of figure 5-8's pushes")
    every: int = Field(10, ge=1, description="steps between two runs of NUTS")
    nuts: NutsSettings = NutsSettings()
    steered_blocks: int = Field(3, ge=1, description="free blocks of the tower of figure 5-9")
    edge: float = Field(8.0, gt=0, le=12.5, description="mm off the centre, contact of the disturbing pushes")
    disturbed: int = Field(8, ge=1, description="steps pushed there before the controller takes over")
    # figure 5-9's controller: as in the games, but straying costs 16 times as much, and it never gives up
    steering: ControllerSettings = ControllerSettings(stray=3.0, effort=0.01, give_up=1e6)


class HiddenChoice(Section):
    """What the learner has never seen (glued blocks, a slippery layer, a heavier pusher), and how much is measured."""

    effects: tuple[str, ...] = Field(("glued", "slippery", "heavy_tool"), description="hidden effects that are studied")
    towers: int = Field(3, ge=2, description="towers with the effect; the first half relearns, the others judge")
    pushes: int = Field(12, ge=4, description="pushes of blocks with the effect, on all these towers")
    others: int = Field(12, ge=4, description="pushes of other blocks of the same towers, where there are any")
    pusher_mass: float = Field(0.15, gt=0, description="kg of the heavier tool; own choice")
    layer: int = Field(6, ge=0, le=13, description="glued blocks and slippery layer; own choice: amid the tower")


class ExpertChoice(Section):
    """How many experts a mixture of regressions needs: numbers that are tried beside its own, 2 to 11 (thesis)."""

    fewest: int = Field(1, ge=1, description="experts; 1: a single regression")
    most: int = Field(13, ge=2, description="experts; more than the thesis found, so that more could be found")


class Chapter5(Section):
    """Abstractions of a Jenga tower's mechanics, and a robot that plays."""

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
