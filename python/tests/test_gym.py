"""Environments: the checkers of Gymnasium, all three autoreset modes against one world at a time, seeds, failures, states."""

import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from gymnasium.wrappers.vector import RecordEpisodeStatistics  # noqa: E402

from drystone.gym import Env, VectorEnv, cart_pole, drawbridge  # noqa: E402

MAKERS = [cart_pole, drawbridge]
ACTIONS = {cart_pole: 1, drawbridge: 2}


def actions_of(make, steps: int, worlds: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.uniform(-1, 1, (steps, worlds, ACTIONS[make])).astype(np.float32)


@pytest.mark.parametrize("make", MAKERS)
def test_the_checker_of_gymnasium_passes(make) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # An environment that is made by hand has no render modes and no spec, and its observations have no bounds.
        warnings.filterwarnings("ignore", message=".*(render|spec|Box observation space).*")
        check_env(Env(make, max_steps=50), skip_render_check=True)


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_every_mode_gives_the_episodes_of_one_world_at_a_time(make, mode: AutoresetMode) -> None:
    worlds, steps, limit = 3, 90, 25
    actions = actions_of(make, steps, worlds)
    envs = make(worlds, max_steps=limit, autoreset_mode=mode)
    first, _ = envs.reset(seed=7)
    assert envs.observation_space.contains(first)
    alone = [Env(make, max_steps=limit) for _ in range(worlds)]
    expected = [env.reset(seed=7 + k)[0] for k, env in enumerate(alone)]
    over, ends = [False] * worlds, 0
    for step in range(steps):
        observations, rewards, terminated, truncated, infos = envs.step(actions[step])
        assert envs.observation_space.contains(observations)
        for k, env in enumerate(alone):
            if over[k] and mode is AutoresetMode.NEXT_STEP:
                expected[k], reward, flags = env.reset()[0], 0, (False, False)
                over[k] = False
            else:
                expected[k], reward, *flags, _ = env.step(actions[step, k])
                over[k] = any(flags)
                ends += over[k]
                if over[k] and mode is not AutoresetMode.NEXT_STEP:
                    if mode is AutoresetMode.SAME_STEP:
                        assert infos["_final_obs"][k] and np.array_equal(infos["final_obs"][k], expected[k])
                    expected[k] = env.reset()[0]
            assert rewards[k] == pytest.approx(reward) and (terminated[k], truncated[k]) == tuple(flags), (step, k)
        if mode is AutoresetMode.DISABLED and any(over):
            with pytest.raises(RuntimeError, match="is over: reset it by its mask"):
                envs.step(actions[step])
            observations, _ = envs.reset(options={"reset_mask": np.array(over)})
        if mode is not AutoresetMode.NEXT_STEP:
            over = [False] * worlds
        assert np.array_equal(observations, np.array(expected)), step
    assert ends >= 2 * worlds


def test_an_episode_does_not_depend_on_the_others() -> None:
    first = cart_pole(3, max_steps=40, autoreset_mode=AutoresetMode.DISABLED)
    first.reset(seed=[1, 2, 3])
    other = cart_pole(2, max_steps=40, autoreset_mode=AutoresetMode.DISABLED)
    other.reset(seed=[9, 2])
    for episode in range(3):
        # World 1 begins its next episode in both; all else differs.
        a, _ = first.reset(options={"reset_mask": np.array([episode == 1, True, False])})
        b, _ = other.reset(options={"reset_mask": np.array([True, True])})
        assert np.array_equal(a[1], b[1])
    again, _ = first.reset(seed=[1, 2, 3])
    assert not np.array_equal(again[1], a[1]) and not np.array_equal(again[0], again[1])


@pytest.mark.parametrize("make", MAKERS)
def test_a_state_goes_on_to_the_same_bits(make) -> None:
    actions = actions_of(make, 80, 4)
    envs = make(4, max_steps=30)
    envs.reset(seed=3)
    [envs.step(a) for a in actions[:37]]
    state = envs.state()
    rest = [envs.step(a) for a in actions[37:]]
    other = make(4, max_steps=30, num_threads=1)
    other.reset(seed=99)
    other.set_state(state)
    for wanted, a in zip(rest, actions[37:], strict=True):
        for x, y in zip(wanted[:4], other.step(a)[:4], strict=True):
            assert np.array_equal(x, y)
    assert (envs.batch.hash() == other.batch.hash()).all()
    with pytest.raises(ValueError, match="state has 4 worlds: must have 2"):
        make(2).set_state(state)


def test_a_world_that_fails_is_terminated_and_begins_again() -> None:
    envs = cart_pole(3, max_steps=50)
    envs.reset(seed=1)
    act = envs._act

    def bad(batch, actions) -> None:
        act(batch, actions)
        batch.force[1, 0, 0] = np.nan if envs._elapsed[1] == 5 else 0

    envs._act = bad
    ended = 0
    for _ in range(20):
        observations, rewards, terminated, _, infos = envs.step(np.zeros((3, 1), np.float32))
        assert np.isfinite(observations).all()
        if terminated[1]:
            ended += 1
            assert "force" in infos["error"][1] and infos["_error"].tolist() == [False, True, False]
            assert rewards.tolist() == [1, 0, 1]
    assert ended == 3 and not terminated[0]


def test_wrappers_and_wrong_arguments() -> None:
    envs = RecordEpisodeStatistics(cart_pole(4, max_steps=20))
    envs.reset(seed=1)
    for _ in range(65):
        observations, *_ = envs.step(envs.action_space.sample())
    assert len(envs.return_queue) >= 8
    kept = observations.copy()
    envs.step(envs.action_space.sample())
    assert np.array_equal(kept, observations), "observations are the caller's"
    bare = cart_pole(4)
    with pytest.raises(ValueError, match=r"actions has shape \(4,\): must be \(4, 1\)"):
        bare.step(np.zeros(4))
    with pytest.raises(ValueError, match="seed has 2 numbers: must have 4"):
        bare.reset(seed=[1, 2])
    for mask in ([True] * 4, np.ones(3, bool), np.zeros(4, bool), np.ones(4)):
        with pytest.raises(ValueError, match="reset_mask"):
            bare.reset(options={"reset_mask": mask})
    with pytest.raises(ValueError, match=r"observe gives shape \(3,\)"):
        VectorEnv(
            bare.batch,
            action_space=bare.single_action_space,
            observe=lambda batch: np.zeros(3),
            reward=lambda batch, actions: np.zeros(4),
            act=lambda batch, actions: None,
        )
