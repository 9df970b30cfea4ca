"""What one world of a task sees and does, as spaces of Gymnasium."""

import numpy as np
from gymnasium import spaces

from haustra.envs.tasks.device_task import LARGEST, DeviceTask, entries_of
from haustra.envs.tasks.navigation import action_space, observation_space
from haustra.envs.tasks.scope_task import ScopeTask


def spaces_of(task: ScopeTask | DeviceTask) -> tuple[spaces.Space, spaces.Box]:
    """Observations and actions of one world."""
    if isinstance(task, ScopeTask):
        return observation_space(task.config), action_space(task.config)
    seen = spaces.Box(-LARGEST, LARGEST, (entries_of(task.device),), np.float32)
    return seen, spaces.Box(-1.0, 1.0, (len(task.device.controls),), np.float32)
