"""Train a linear policy that balances a pole on a cart, by random search with numpy alone, and draw its curve.

    python examples/cartpole.py [FOLDER]

Each generation tries directions around the best policy so far, forwards and backwards, all at once in worlds beside each other, and follows
those that did better. The same seed gives the same curve, to the last bit of the physics, on any machine.
"""

import sys
import time
from pathlib import Path

import numpy as np

from drystone.gym import VectorEnv, cart_pole

DIRECTIONS, BEST, SPREAD, STEP, GENERATIONS, MOST = 32, 8, 0.03, 0.05, 12, 500
# Roughly the size of each observation, so that all count alike.
SCALE = np.array([1.0, 1.0, 0.1, 0.5])


def play(envs: VectorEnv, policies: np.ndarray, seeds: list[int]) -> np.ndarray:
    """Points of one episode in each world: of one policy for all, or of a policy each."""
    observations, _ = envs.reset(seed=seeds)
    points, is_over = np.zeros(envs.num_envs), np.zeros(envs.num_envs, bool)
    for _ in range(MOST):
        actions = np.clip((policies * observations / SCALE).sum(axis=1, keepdims=True), -1, 1)
        observations, rewards, terminated, truncated, _ = envs.step(actions.astype(np.float32))
        points += rewards * ~is_over
        is_over |= terminated | truncated
        if is_over.all():
            break
    return points


def train(seed: int = 0) -> tuple[np.ndarray, list[float]]:
    """The policy, and the mean points of the policy of each generation over 16 starts."""
    rng = np.random.default_rng(seed)
    envs, tests = (cart_pole(count, max_steps=MOST) for count in (2 * DIRECTIONS, 16))
    policy, curve = np.zeros(4), []
    for generation in range(GENERATIONS + 1):
        curve.append(float(play(tests, policy, [1000 * generation + k for k in range(16)]).mean()))
        directions = rng.standard_normal((DIRECTIONS, 4))
        tried = policy + SPREAD * np.concatenate([directions, -directions])
        # All worlds begin in the same way, so that only their policies differ.
        points = play(envs, tried, [generation] * envs.num_envs)
        there, back = points[:DIRECTIONS], points[DIRECTIONS:]
        best = np.argsort(-np.maximum(there, back))[:BEST]
        spread = points[np.concatenate([best, best + DIRECTIONS])].std()
        policy = policy + STEP * (there[best] - back[best]) @ directions[best] / (BEST * max(spread, 1e-9))
    return policy, curve


def curve_svg(curve: list[float]) -> str:
    """The curve as a picture."""
    width, height, left, bottom = 520, 300, 60, 40
    across = (width - left - 20) / max(1, len(curve) - 1)
    up = (height - bottom - 20) / MOST
    places = " ".join(f"{left + across * k:.1f},{height - bottom - up * y:.1f}" for k, y in enumerate(curve))
    marks = [
        f'<text x="{left - 8}" y="{height - bottom - up * y + 4:.1f}" text-anchor="end">{y}</text>'
        f'<path d="M{left} {height - bottom - up * y:.1f}H{width - 20}" stroke="#ddd"/>'
        for y in range(0, MOST + 1, 100)
    ]
    names = [
        f'<text x="{left + across * k:.1f}" y="{height - bottom + 18}" text-anchor="middle">{k}</text>'
        for k in range(0, len(curve), 5)
    ]
    title = f'<text x="{left}" y="12">steps for which the pole stands, by generation</text>'
    line = f'<polyline points="{places}" fill="none" stroke="#08306b" stroke-width="2"/>'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" font-size="12">'
    return "\n".join([head, title, *marks, *names, line, "</svg>", ""])


def main(folder: Path) -> None:
    begin = time.perf_counter()
    policy, curve = train()
    path = folder / "cartpole.svg"
    path.write_text(curve_svg(curve))
    print(f"policy {policy.round(3).tolist()} after {time.perf_counter() - begin:.1f} s")
    print(f"{curve[0]:.0f} steps at first, {curve[-1]:.0f} of {MOST} at the end; the curve is {path}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
