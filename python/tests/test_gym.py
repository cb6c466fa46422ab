"""Environments: the checkers of Gymnasium, all three autoreset modes against one world at a time, seeds, failures, states."""

import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from gymnasium.wrappers.vector import RecordEpisodeStatistics  # noqa: E402

import drystone  # noqa: E402
from drystone.gym import Env, VectorEnv, cart_on_drawbridge, cart_pole, drawbridge, maze  # noqa: E402

MAKERS = [cart_pole, drawbridge, maze, cart_on_drawbridge]
ACTIONS = {cart_pole: 1, drawbridge: 2, maze: 2, cart_on_drawbridge: 2}


def actions_of(make, steps: int, worlds: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    return rng.uniform(-1, 1, (steps, worlds, ACTIONS[make])).astype(np.float32)


@pytest.mark.parametrize("make", MAKERS)
def test_the_checker_of_gymnasium_passes(make) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # An environment that is made by hand has no spec, and its observations have no bounds.
        warnings.filterwarnings("ignore", message=".*(render|spec|Box observation space).*")
        check_env(Env(make, max_steps=50), skip_render_check=True)


def test_gymnasium_makes_environments_by_name() -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space.*")
        env = gymnasium.make("drystone/CartPole-v0", max_steps=7)
        envs = gymnasium.make_vec("drystone/CartPole-v0", num_envs=3, max_steps=7)
    assert isinstance(envs.unwrapped, VectorEnv) and envs.num_envs == 3
    first, _ = env.reset(seed=4)
    firsts, _ = envs.reset(seed=4)
    assert np.array_equal(first, firsts[0])
    for step in range(7):
        one, many = env.step(np.zeros(1, np.float32)), envs.step(np.zeros((3, 1), np.float32))
        assert np.array_equal(one[0], many[0][0]) and one[3] == many[3][0] == (step == 6)
    for name in ("Drawbridge", "Maze", "CartOnDrawbridge"):
        assert gymnasium.spec(f"drystone/{name}-v0").vector_entry_point


def test_pictures_of_environments() -> None:
    assert cart_pole(2).render() is None and Env(cart_pole).render() is None
    envs = cart_pole(2, render_mode="rgb_array")
    assert envs.render_mode == "rgb_array" and envs.metadata["render_fps"] == 50
    envs.reset(seed=1)
    try:
        pictures = envs.render()
    except drystone.AdapterError as error:
        pytest.skip(str(error))
    assert len(pictures) == 2 and pictures[0].shape == (480, 640, 3) and pictures[0].dtype == np.uint8
    assert Env(cart_pole, render_mode="rgb_array").render().shape == (480, 640, 3)


def test_actions_set_ctrl_by_default() -> None:
    batch = drystone.Batch(drystone.Scene.find("drawbridge"), 2)
    space = gymnasium.spaces.Box(-0.5, 0.5, (2,), np.float32)
    options = {"observe": lambda batch: batch.position[:, 1], "reward": lambda batch, actions: np.zeros(2)}
    envs = VectorEnv(batch, action_space=space, **options)
    envs.reset(seed=1)
    actions = np.array([[0.1, 0.2], [0.3, 0.4]], np.float32)
    envs.step(actions)
    assert np.array_equal(batch.ctrl, actions)
    for name, value, line in [
        ("action_space", gymnasium.spaces.Box(-1, 1, (3,)), "action_space has shape (3,): must be (2,), or act be given"),
        ("max_steps", 0, "max_steps = 0: must be 1 or more"),
        ("frame_skip", 1.5, "frame_skip = 1.5: must be a whole number"),
        ("render_mode", "human", "render_mode = 'human': must be one of rgb_array"),
        ("autoreset_mode", "next", "autoreset_mode = 'next': must be one of AutoresetMode.NEXT_STEP, "),
        ("batch", 3, "batch is int: must be Batch"),
    ]:
        with pytest.raises(ValueError) as caught:
            VectorEnv(**{"batch": batch, "action_space": space, **options, name: value})
        assert str(caught.value).startswith(line), caught.value
    wrong = VectorEnv(batch, action_space=space, **{**options, "reward": lambda batch, actions: 0.0})
    wrong.reset()
    with pytest.raises(ValueError, match=r"^reward gives shape \(\): must be \(2,\)$"):
        wrong.step(actions)
    for seed, line in [(-1, "seed = -1: must be 0 or more"), ("a", "seed = 'a': must be a whole number"), ([1.5, 2], "seed = 1.5")]:
        with pytest.raises(ValueError) as caught:
            envs.reset(seed=seed)
        assert str(caught.value).startswith(line)
    for state in (b"", b"x", 3, envs.state()[:-5]):
        with pytest.raises(ValueError, match="^state: must be the bytes of `state`, unchanged$"):
            envs.set_state(state)


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
    at_once = cart_pole(2, max_steps=50, autoreset_mode=AutoresetMode.SAME_STEP)
    at_once.reset(seed=1)
    at_once.batch.gravity[1] = (0, -1e30, 0)
    _, _, terminated, _, infos = at_once.step(np.zeros((2, 1), np.float32))
    assert terminated.tolist() == [False, True] and infos["_final_info"].tolist() == [False, True]
    # As Gymnasium's own vector environments group it.
    assert "gravity" in infos["final_info"]["error"][1] and infos["final_info"]["_error"].tolist() == [False, True]
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


def test_a_board_tilts_as_wanted_and_the_ball_rolls_that_way() -> None:
    envs = maze(2, board="easy")
    first, _ = envs.reset(seed=1)
    assert np.allclose(first[:, 4:6], 0, atol=1e-6) and not np.array_equal(first[0], first[1])
    steepest = np.radians(8)
    for _ in range(8):
        observations, *_ = envs.step(np.array([[1, 0], [0, 0.5]], np.float32))
    assert observations[0, 4] == pytest.approx(steepest, abs=2e-3) and observations[0, 5] == pytest.approx(0, abs=2e-3)
    assert observations[1, 5] == pytest.approx(steepest / 2, abs=2e-3)
    assert observations[0, 0] > first[0, 0] + 0.01 and observations[1, 1] > first[1, 1] + 0.005


def test_a_controller_wins_the_easy_board() -> None:
    from drystone.gym import _Board

    board, envs = _Board("easy"), maze(1, board="easy", max_steps=1200)
    observations, _ = envs.reset(seed=3)
    total = 0.0
    for _ in range(1200):
        at, speed = observations[0, :2], observations[0, 2:4]
        place = np.floor(at[::-1] / board.cell + 0.5 * board.size).astype(int)
        ways = [place + step for step in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))]
        inside = [way for way in ways if (way >= 0).all() and (way < board.size).all()]
        aim = board.middle(min(inside, key=lambda way: board.left[tuple(way)]))
        slope = (9 * (aim - at) - 5 * speed) / 7
        observations, rewards, terminated, _, _ = envs.step(np.clip(np.degrees(slope) / 8, -1, 1)[None].astype(np.float32))
        total += rewards[0]
        if terminated[0]:
            break
    assert terminated[0] and rewards[0] == pytest.approx(1, abs=0.01)
    with pytest.raises(ValueError, match="^board: \"esy\" is neither a board nor a file; did you mean \"easy\"\\?"):
        maze(1, board="esy")


def test_a_cart_that_lowers_the_bridge_crosses_it_and_one_that_does_not_does_not() -> None:
    envs = cart_on_drawbridge(2, max_steps=400, autoreset_mode=AutoresetMode.DISABLED)
    envs.reset(seed=1)
    total, crossed = np.zeros(2), np.zeros(2, bool)
    for step in range(300):
        # The first one lowers the deck, then drives; the second one drives at once with the deck up.
        ahead = 1.0 if step > 120 else 0.0
        _, rewards, terminated, _, _ = envs.step(np.array([[-1, ahead], [1, 1]], np.float32))
        total += rewards
        crossed |= terminated
        if crossed.any():
            break
    assert crossed.tolist() == [True, False] and total[0] > 15
