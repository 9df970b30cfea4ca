"""The follower for many worlds acts as the follower of one."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask
from tests.task_bank import DESIGN, short_bank

pytest.importorskip("jax")

from haustra.envs.tasks.device_follower import DeviceFollowerDriver


@pytest.mark.parametrize(("timid", "straighten"), [(False, False), (True, False), (True, True)])
def test_both_followers_act_alike_on_what_they_see(timid, straighten):
    """Over 10 s in two tubes, with retreats: push and roll the same to 0.001 in 995 of 1,000 decisions (a threshold may
    fall on one side in single and on the other in double precision), pulls to 0.005 in the mean: the places ahead that
    they steer for are up to 2.5 mm apart."""
    settings = FollowerSettings(straighten=straighten)
    if timid:
        settings = replace(settings, tip_force_limit=0.5, wall_force_limit=1.0)
    task = ScopeTask(TaskConfig(design=DESIGN, observation="state"), worlds=4, bank=short_bank())
    one, many = FollowerDriver(task, settings=settings), DeviceFollowerDriver(task, settings=settings)
    seen = task.reset(seeds=[1, 2, 3, 4], case=np.array([0, 1, 0, 1]))
    everyone = np.ones(4, bool)
    for driver in (one, many):
        driver.begin(everyone)
    pairs = []
    for step in range(250):
        if step == 125:  # half of them begin anew on the way
            half = np.array([False, True, False, True])
            seen = task.reset(np.flatnonzero(half), [7, 8], case=np.array([0, 1]))
            for driver in (one, many):
                driver.begin(half)
        ours, theirs = one.act(seen), many.act(seen)
        pairs.append((ours, theirs))
        seen = task.step(ours).observation
    task.close()
    ours, theirs = (np.array(side) for side in zip(*pairs, strict=True))
    apart = np.abs(ours - theirs)
    assert (ours[..., 0] < 0).any() and (ours[..., 0] > 0).any(), "they retreat and advance"
    assert (apart[..., :2] < 0.001).mean() > 0.995
    assert apart[..., 2:].mean() < 0.005 < 0.1 * np.abs(ours[..., 3]).mean()
