"""PPO: reward by hand, the environment on a real tower, learning on a toy, files."""

import numpy as np
import pytest
import torch
from tower_for_tests import FREE_BLOCK, SEED, STUCK_BLOCK, Settled

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.jenga.play.policies import Push, Retract
from thesis_lib.jenga.play.ppo import read_policy, train_ppo, write_policy
from thesis_lib.jenga.play.push_env import (
    DAMAGED,
    FELL,
    GOAL,
    LONGEST,
    REASONS,
    RETRACTED,
    SEEN_LIMIT,
    Episode,
    PushEnv,
    as_action,
    observation,
    perturbation,
    step_reward,
)
from thesis_lib.jenga.play.settings import EpisodeSettings, PpoSettings, RewardSettings
from thesis_lib.jenga.robot.samples import F_N, TOWER
from thesis_lib.jenga.tower.tower import TowerError

STRAIGHT, RETREAT = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
CONTEXT = np.array([8.0, 1.0])


# -- reward and scaling ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("millimetres", "degrees", "p"), [(20, 0, 0.4), (0, 30, 0.4), (5, 3, 0.1), (1, 15, 0.2)])
def test_perturbation_takes_the_worse_of_displacement_and_turn(millimetres, degrees, p):
    assert perturbation(1e-3 * millimetres, np.radians(degrees), RewardSettings()) == pytest.approx(p)


@pytest.mark.parametrize(
    ("progress", "p", "fell", "reward"),
    [
        (1.0, 0.0, False, 0.1),
        (1.0, 0.08, False, 0.1),  # D1 has not begun
        (0.0, 0.24, False, -0.1),  # half way up
        (1.0, 0.4, False, -0.1),  # all the way: as much as twice the progress
        (0.0, 0.41, False, -100.2),
        (0.0, 0.0, True, -100.0),
        (-2.0, 0.0, False, -0.2),  # a block that springs back
    ],
)
def test_reward_of_a_step(progress, p, fell, reward):
    assert step_reward(progress, p, fell, RewardSettings()) == pytest.approx(reward)


def test_observations_never_leave_their_space():
    wild = observation(np.full(7, 1e6), CONTEXT)
    assert (wild[:7] == SEEN_LIMIT).all() and PushEnv().observation_space.contains(wild)


def test_actions_are_scaled_cut_and_end_above_the_threshold():
    settings = EpisodeSettings(offset=8.0, heading=0.15, retract=0.5)
    assert as_action(np.array([-0.5, 1.0, 0.5]), settings) == Push(-4.0, 0.15)
    assert as_action(np.array([9.0, -9.0, -9.0]), settings) == Push(8.0, -0.15)
    assert isinstance(as_action(np.array([0.0, 0.0, 0.51]), settings), Retract)


# -- the environment on a real tower -----------------------------------------------------------------------------------


class OneTower(PushEnv):
    """The tower of the tests, whatever seed is asked for."""

    asked: tuple[int, ...] = ()

    def build(self, seed):
        self.asked += (seed,)
        return Settled.get()


def pushed(env: PushEnv, block: int, action=STRAIGHT, longest: int = 60):
    """Rewards of one episode, in which `action` is repeated."""
    env.reset(options={"block": block})
    rewards = []
    for _ in range(longest):
        _, reward, ended, cut, _ = env.step(action)
        rewards.append(reward / env.reward.scale)
        if ended or cut:
            return rewards
    raise AssertionError("the episode does not end")


@pytest.fixture(scope="module")
def env():
    made = OneTower()
    made.reset(seed=0)
    return made


def test_a_free_block_gains_its_way_and_the_bonus(env):
    rewards = pushed(env, FREE_BLOCK)
    done, settings = env.episodes[-1], env.reward
    assert (done.block, done.tower, REASONS[done.reason]) == (FREE_BLOCK, SEED, "goal")
    assert done.samples == len(rewards) and done.reward == pytest.approx(sum(rewards))
    way = (sum(rewards) - settings.extraction) / settings.progress
    goal = 1e3 * env.setup.robot.goal
    assert goal - 1.0 < way < goal + 3.0  # mm: it may have moved at first contact, and steps are 1 mm


def test_dragging_the_tower_costs_more_than_it_gains_and_ends_the_push(env):
    rewards = np.array(pushed(env, STUCK_BLOCK))
    assert REASONS[env.episodes[-1].reason] == "tower dragged"
    assert rewards[-1] == pytest.approx(-env.reward.fall, abs=0.5)
    # it moves with the tower, which at first is progress and in the end is not
    assert rewards[:15].sum() > 0.0 > rewards[-6:-1].sum()
    state = env._robot.state()
    limit, seen = env.reward.distance, state[TOWER]
    assert limit < seen < limit + 3.0  # mm


def test_retracting_ends_at_once_and_gains_nothing(env):
    assert pushed(env, STUCK_BLOCK, RETREAT) == [0.0]
    assert env.episodes[-1].reason == RETRACTED and env.episodes[-1].samples == 1


def test_the_longest_push_ends_an_episode(env):
    env.reset(options={"block": FREE_BLOCK})
    env._robot.steps = round(env.setup.robot.longest_push / env.setup.robot.step) - 1
    _, _, ended, cut, info = env.step(STRAIGHT)
    assert ended and not cut and info["reason"] == REASONS[LONGEST]


def test_a_fall_is_punished_and_followed_by_a_new_tower():
    env = OneTower()
    env.reset(seed=0, options={"block": FREE_BLOCK})
    assert len(env.asked) == 1 and env.asked[0] >= 2000
    tower = env._robot.tower
    tower.data.geom_xpos[tower.core[FREE_BLOCK + 1], 2] -= 0.05  # a neighbour is where a fall would end
    tower.step = lambda n=1: None  # and stays there
    _, reward, ended, _, info = env.step(STRAIGHT)
    assert ended and info["reason"] == REASONS[FELL]
    assert reward / env.reward.scale == pytest.approx(-env.reward.fall, abs=2.0)
    env.reset()
    assert len(env.asked) == 2 and env.asked[1] != env.asked[0]


def test_a_breakdown_is_cut_short_without_blame(env, monkeypatch):
    env.reset(options={"block": FREE_BLOCK})
    monkeypatch.setattr(env._robot.tower, "step", raised)
    _, reward, ended, cut, info = env.step(STRAIGHT)
    assert cut and not ended and reward == 0.0 and info["reason"] == "broke down"


def raised(n=1):
    raise TowerError("made up")


def test_damage_forfeits_the_bonus(env):
    env.reset(options={"block": FREE_BLOCK})
    limits = env._robot.tower.robot_settings
    env._robot.tower.perturbation = lambda block, since: (limits.damage_distance + 1e-3, 0.0)
    while not env.step(STRAIGHT)[2]:
        pass
    assert env.episodes[-1].reason == DAMAGED and env.episodes[-1].reward < env.reward.extraction


def test_towers_that_cannot_be_used_are_left_out_until_there_are_too_many():
    class Bad(OneTower):
        bad = 1

        def build(self, seed):
            tower = super().build(seed)
            return tower if len(self.asked) > self.bad else raised()

    env = Bad()
    env.reset(seed=0)
    assert len(env.asked) == 2
    env.asked, env.bad = (), 9
    with pytest.raises(TowerError):
        env.reset(seed=0)


@pytest.mark.filterwarnings("error")
def test_gymnasium_accepts_the_environment():
    from gymnasium.utils.env_checker import check_env

    check_env(OneTower(), skip_render_check=True)


# -- training on a toy -------------------------------------------------------------------------------------------------


class Toy(PushEnv):
    """Blocks that are free or stuck, as the force says: a push gains 1 or loses 1, and 5 of them are an episode."""

    def reset(self, *, seed=None, options=None):
        import gymnasium

        gymnasium.Env.reset(self, seed=seed)
        self.stuck, self.gained, self.steps = bool(self.np_random.integers(2)), 0.0, 0
        return self.look(), {}

    def look(self):
        return observation(reading(self.stuck), CONTEXT)

    def step(self, action):
        self.steps += 1
        retreat = isinstance(as_action(action, self.settings), Retract)
        reward = 0.0 if retreat else (-1.0 if self.stuck else 1.0)
        self.gained += reward
        ended = retreat or self.steps == 5
        if ended:
            reason = RETRACTED if retreat else GOAL
            self.episodes.append(Episode(2000, int(self.stuck), self.steps, self.gained, reason))
        return self.look(), reward, ended, False, {}


def reading(stuck: bool) -> np.ndarray:
    state = np.zeros(7)
    state[F_N] = 4.0 if stuck else 0.0
    return state


LEARNS = PpoSettings(rate=3e-3, segment=2000)


@pytest.fixture(scope="module")
def toy():
    lines = []
    policies = train_ppo([100, 4000], LEARNS, seed=1, environment=Toy, device="cpu", say=lines.append)
    return policies, lines


@pytest.mark.slow
def test_it_learns_when_to_push_and_when_to_retract(toy):
    policies, lines = toy
    rewards = policies[4000].episodes["reward"].to_numpy()
    # at best 5 from free blocks and 0 from stuck ones: 2.5 in the mean, less what exploration costs
    assert rewards[:50].mean() < 1.0 and rewards[-200:].mean() > 1.8
    assert isinstance(policies[4000].act(reading(True), CONTEXT), Retract)
    assert isinstance(policies[4000].act(reading(False), CONTEXT), Push)
    done = int(lines[-1].split()[1])
    assert 3950 < done <= 4000  # rollouts of equal length leave some out


def test_no_policy_has_seen_more_samples_than_it_says(toy):
    for samples, policy in toy[0].items():
        assert policy.samples == samples
        assert policy.episodes["samples"].max() <= samples
        assert policy.episodes["samples"].is_monotonic_increasing
    early, late = toy[0].values()
    assert early.episodes.equals(late.episodes.iloc[: len(early.episodes)])  # one training
    assert not np.array_equal(weights(early), weights(late))


def weights(policy) -> np.ndarray:
    return np.concatenate([part.ravel() for layer in policy.layers for part in layer])


def test_a_file_holds_the_policy_and_nothing_that_runs(toy, tmp_path):
    policy = toy[0][100]
    path = tmp_path / "policy.pt"
    write_policy(policy, path)
    again = read_policy(path)
    state = np.random.default_rng(0).normal(size=7)
    assert again.act(state, CONTEXT) == policy.act(state, CONTEXT)
    assert again.samples == 100 and again.episodes.equals(policy.episodes)
    with pytest.raises(UserError):
        read_policy(tmp_path / "none.pt")
    path.write_bytes(b"not a policy")
    with pytest.raises(CorruptFileError):
        read_policy(path)
    torch.save({"schema": 2, "evil": pytest.raises}, path)  # a pickle of code
    with pytest.raises(CorruptFileError):
        read_policy(path)


def test_it_plays_what_the_library_would_play(toy):
    from stable_baselines3 import PPO

    policy = toy[0][100]
    layers = {"net_arch": list(LEARNS.hidden)}
    model = PPO("MlpPolicy", Toy(), policy_kwargs=layers, device="cpu", n_steps=2, batch_size=2)
    model.policy.load_state_dict(policy.state["policy"])
    rng = np.random.default_rng(0)
    for _ in range(20):
        state = 3.0 * rng.normal(size=7)
        action, _ = model.predict(observation(state, CONTEXT), deterministic=True)
        played, wanted = policy.act(state, CONTEXT), as_action(action, LEARNS.episode)
        assert type(played) is type(wanted)
        if isinstance(played, Push):
            assert played.offset == pytest.approx(wanted.offset, abs=1e-4)
            assert played.heading == pytest.approx(wanted.heading, abs=1e-5)


@pytest.mark.parametrize("checkpoints", [[], [1], [100, 50], [100, 100]])
def test_impossible_checkpoints_are_refused(checkpoints):
    with pytest.raises(UserError, match="checkpoints"):
        train_ppo(checkpoints, environment=Toy)


@pytest.mark.slow
def test_training_on_towers_runs_and_repeats():
    settings = PpoSettings(rollout=40)
    first, again = (train_ppo([40], settings, seed=3, device="cpu")[40] for _ in range(2))
    np.testing.assert_array_equal(weights(first), weights(again))
    assert (first.episodes["tower"] >= 2000).all()
