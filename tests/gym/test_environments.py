"""Environments of Gymnasium: its own checker, experts, seeds, and what is not free is not done."""

import warnings

import numpy as np
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.errors import InputError

gymnasium = pytest.importorskip("gymnasium")
from rrtik_ompl.gym import PickPlace, Reach, expert  # noqa: E402

pytestmark = pytest.mark.kernels
NAMES = ("rrtik/Reach-v0", "rrtik/PickPlace-v0")


@pytest.fixture(scope="module", params=NAMES)
def env(request):
    return gymnasium.make(request.param)


def test_it_passes_gymnasiums_own_checker_without_a_warning(env):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


@pytest.mark.parametrize("seed", range(3))
def test_the_expert_ends_an_episode_well_and_touches_nothing(env, seed):
    _, info = env.reset(seed=seed)
    steps = 0
    for action in expert(env):
        assert not info["is_success"]
        observation, reward, terminated, truncated, info = env.step(action)
        assert env.observation_space.contains(observation)
        assert reward <= 0.0
        assert not info["collision"]
        steps += 1
    assert (terminated, truncated, info["is_success"]) == (True, False, True)
    assert steps <= env.spec.max_episode_steps // 2


def test_an_episode_depends_on_the_seed_and_the_actions_alone(env):
    episodes = []
    for _ in range(2):
        rows = [env.reset(seed=7)[0]]
        env.action_space.seed(7)
        rows += [env.step(env.action_space.sample())[0] for _ in range(10)]
        episodes.append(np.array(rows))
        env.reset(seed=8)
    np.testing.assert_array_equal(*episodes)
    assert not np.array_equal(env.reset(seed=9)[0], episodes[0][0])


def test_whatever_it_is_told_the_arm_is_free_by_coal(env):
    env.reset(seed=3)
    env.action_space.seed(3)
    arm = env.unwrapped
    stopped = 0
    for _ in range(60):
        before = arm.q
        action = env.action_space.sample()
        action[1:3] = 1.0  # down
        info = env.step(action)[-1]
        assert arm.world.contacts(arm.q) == ()
        assert arm.world.robot.limit_fault(arm.q) == ""
        assert np.abs(arm.q - before).max() <= arm.increment + 1e-12
        stopped += info["collision"]
    assert stopped


@pytest.mark.parametrize(
    ("action", "said"),
    [
        (lambda n: np.zeros(n - 1), "action: expected an array of shape"),
        (lambda n: np.zeros((n, 1)), "action: expected an array of shape"),
        (lambda n: [np.nan] * n, "action: every number must be finite"),
        (lambda _: "left", "action: expected numbers"),
        (lambda _: None, "action: "),
    ],
)
def test_an_action_that_is_none_is_refused_in_a_line_and_moves_nothing(env, action, said):
    env.reset(seed=1)
    arm = env.unwrapped
    before = arm.q
    with pytest.raises(InputError, match=said):
        arm.step(action(env.action_space.shape[0]))
    assert np.array_equal(arm.q, before)


@pytest.mark.parametrize("environment", [Reach, PickPlace])
def test_before_the_first_episode_it_says_what_to_call(environment):
    env = environment()
    for called in (lambda: env.step(env.action_space.sample()), lambda: next(expert(env))):
        with pytest.raises(InputError, match=r"no episode has begun; call reset\(\) first"):
            called()


def test_a_thing_is_taken_only_where_it_is_grasped_and_stays_where_it_is_let_go():
    env = PickPlace()
    first, _ = env.reset(seed=0)
    close, open_ = (np.append(np.zeros(5), told).astype(np.float32) for told in (-1.0, 1.0))
    observation, *_, info = env.step(close)
    assert not info["held"]
    assert observation[5] < first[5]
    assert np.array_equal(observation[6:13], first[6:13])
    env.step(open_)

    env.reset(seed=0)
    for action in expert(env):
        *_, info = env.step(action)
        if info["held"] and env.world.robot.fk(env.q).translation[2] > 0.055:
            break
    up, *_ = env.step(np.zeros(6, dtype=np.float32))
    dropped, *_, info = env.step(open_)
    assert not info["held"]
    assert not info["is_success"]
    assert dropped[6:13] == pytest.approx(up[6:13], abs=1e-6)
    with pytest.raises(InputError, match=r"it begins where the episode does; call reset\(\)"):
        next(expert(env))


@pytest.mark.parametrize(
    ("task", "said"),
    [("titan4_drawer", "section random:"), (3, "Task.load"), ("panda_shelf", "is a problem, not a task")],
)
def test_tasks_that_are_no_environment_are_refused_in_a_line(task, said):
    with pytest.raises(InputError, match=said):
        PickPlace(task)


def test_a_world_of_ones_own_is_an_environment():
    env = Reach(rrtik.World(rrtik.load_robot("planar3")), increment=0.1)
    observation, _ = env.reset(seed=0)
    assert observation[3:6] == pytest.approx(np.array(env.robot.fk(env.q).translation), abs=1e-6)
    with pytest.raises(InputError, match="use World"):
        Reach(7)
    with pytest.raises(InputError, match="an environment of rrtik_ompl, got str"):
        expert("rrtik/Reach-v0")
