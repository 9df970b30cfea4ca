"""Withdrawal: it begins in the caecum, what is seen is paid, and it ends at the anus."""

import gymnasium
import numpy as np

import haustra.envs
from haustra.envs.tasks.navigation import NavigationEnv
from tests.task_bank import short_bank


def test_a_withdrawal_sees_more_and_more_and_ends_at_the_anus(tmp_path, monkeypatch):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path))
    assert haustra.envs
    made = gymnasium.make("Haustra/Withdrawal-v0", bank=short_bank(), observation="state").unwrapped
    assert isinstance(made, NavigationEnv) and made.config.weights.coverage == 100.0
    _, info = made.reset(seed=0, options={"case": 0})
    start = made.task.seen.tip_arc[0]
    assert start > 0.22
    covered, total, done = [], 0.0, False
    for _ in range(300):
        _, reward, done, _, info = made.step(np.array([-1.0, 0.0, 0.0, 0.0]))
        covered.append(info["coverage"])
        total += reward
        if done:
            break
    assert done and info["reached"] and info["tip_arc"] <= 0.04
    assert covered[-1] > covered[0] > 0.05
    assert total > 50 * (covered[-1] - covered[0])
    made.reset(seed=1, options={"case": 0})
    assert made.task.seen.tip_arc[0] == start
