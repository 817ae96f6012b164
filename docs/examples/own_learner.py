"""A learner of your own: a search for the damping and stiffness of a compliance in Bend-v1.

Each grip turns with its own moment, b dδ/dt + k δ = M, which has two parameters. The cross-entropy
method draws some of them, keeps the best and draws around these. What it found is then tried with
seeds that it has not seen, beside no compliance at all.

Run: python docs/examples/own_learner.py [FIGURE.png]
"""

import sys

import gymnasium
import matplotlib.pyplot as plt
import numpy as np

from dualbend import COMMAND_PERIOD_S

SETTINGS = (
    'compliance.sensing=["left","right"]',
    "motion.speed_rad_per_s=0.25",
    "motion.settle_s=0.5",
    "motion.hold_s=1.0",
)
ROUNDS, DRAWN, KEPT = 4, 8, 3
SEEDS, UNSEEN = (1, 2), (11, 12, 13)
PITCH = np.array([2, 5])
"""Components of an action: pitch of the left and of the right arm."""
MOMENT = np.array([2, 8])
"""Components of an observation: filtered moment at the left and at the right grip."""


def paid(env: gymnasium.Env, parameters: np.ndarray | None, seed: int) -> float:
    """Return the sum of rewards of an episode; None: no compliance."""
    seen, _ = env.reset(seed=seed)
    action, turn_rad, total, terminated = np.zeros(6), np.zeros(2), 0.0, False
    while not terminated:
        if parameters is not None:
            b, k = np.exp(parameters)
            turn_rad = turn_rad + COMMAND_PERIOD_S / b * (seen[MOMENT] - k * turn_rad)
            action[PITCH] = turn_rad = np.clip(turn_rad, -0.1, 0.1)
        seen, reward, terminated, _, _ = env.step(action)
        total += reward
    return total


def main(figure: str = "") -> dict[str, float]:
    """Search, print each round, and return the mean rewards with unseen seeds."""
    env = gymnasium.make("dualbend.env:dualbend/Bend-v1", settings=SETTINGS)
    rng = np.random.default_rng(1)
    mean, spread = np.log([10.0, 10.0]), np.array([1.0, 1.0])
    rounds = []
    for _ in range(ROUNDS):
        drawn = mean + spread * rng.standard_normal((DRAWN, 2))
        rewards = [np.mean([paid(env, each, seed) for seed in SEEDS]) for each in drawn]
        best = drawn[np.argsort(rewards)[-KEPT:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.05
        b, k = np.exp(mean)
        print(
            f"best {max(rewards):6.1f}, median {np.median(rewards):6.1f}, "
            f"then b = {b:.2f} N m s/rad, k = {k:.2f} N m/rad"
        )
        rounds.append(rewards)
    without, learned = (
        float(np.mean([paid(env, tried, seed) for seed in UNSEEN])) for tried in (None, mean)
    )
    print(f"unseen seeds: without {without:.1f}, learned {learned:.1f}")
    if figure:
        draw(rounds, without, learned, figure)
    return {"without": without, "learned": learned, "b": float(b), "k": float(k)}


def draw(rounds: list[list[float]], without: float, learned: float, figure: str) -> None:
    """Write the rewards of each round, and those with unseen seeds as lines."""
    fig, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
    for i, rewards in enumerate(rounds, 1):
        axes.plot([i] * len(rewards), rewards, "o", color="C0", alpha=0.5)
    axes.plot(range(1, len(rounds) + 1), np.median(rounds, axis=1), color="C0", label="median")
    axes.axhline(learned, color="C2", linestyle="--", label="learned, unseen seeds")
    axes.axhline(without, color="C3", linestyle="--", label="no compliance, unseen seeds")
    axes.set(xlabel="round", ylabel="reward of an episode", xticks=range(1, len(rounds) + 1))
    axes.legend()
    fig.savefig(figure, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
