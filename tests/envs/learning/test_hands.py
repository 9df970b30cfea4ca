"""A policy at the handles of a batch sees and does what it sees and does in a single run."""

import numpy as np
import pytest

from haustra.envs.control.held import HeldHand
from haustra.envs.learning.hands import BatchHands
from haustra.envs.learning.insertion import run_policy
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.sim.conditions import Conditions
from haustra.envs.tasks.ray_program import LumenSight, lookup_of
from haustra.envs.tasks.sight import Sight
from haustra.models.scene import Scene, entry_of
from haustra.models.wall.lumen_table import stack
from tests.envs.learning.test_insertion import CONFIG, SETTINGS, policy_of, scene  # noqa: F401
from tests.task_bank import short_bank

DECISIONS = 15


def test_a_batch_goes_as_single_runs_do(scene: Scene) -> None:  # noqa: F811
    """Hands of a batch rest until their first decision; what differs besides is precision."""
    policy, case = policy_of(CONFIG), short_bank().cases[0]
    batch = LinearInsertions(
        scene,
        stack([case.tables]),
        [scene.colon],
        worlds=2,
        settings=HeldHand(),
        sees=LumenSight(),
        lookup=lookup_of(Sight([case])),
    )
    one = np.ones(2)
    batch.begin(np.zeros(2, int), Conditions(0.05 * one, 1500.0 * one, one))
    hand = BatchHands(batch, policy, SETTINGS)
    assert hand.every == 2
    tips = []
    ran = batch.run(
        seconds=0.04 * (DECISIONS + 1), watch=lambda: tips.append(batch.backend.read().tip), every=2, hand=hand
    )
    assert ran.simulated == pytest.approx(0.04 * (DECISIONS + 1))
    run = run_policy(scene, policy, SETTINGS, seconds=0.04 * DECISIONS)
    origin, axes = entry_of(scene.colon)
    alone = (run.trajectory.tip[1::2] - origin) @ axes
    for world in range(2):
        np.testing.assert_allclose(np.array(tips)[1:, world], alone, atol=5e-4)
    assert np.linalg.norm(alone[-1] - alone[0]) > 0.01
