"""Any device as a Gymnasium environment: its declared controls in, what it is told by out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from haustra.envs.tasks.calls import checked_action, require_no_options
from haustra.envs.tasks.device_task import DeviceRules, DeviceTask
from haustra.envs.tasks.spaces import spaces_of
from haustra.errors import InvalidOptionError
from haustra.fields import read_fields
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.base import Device


class DeviceEnv(gymnasium.Env):
    """One device in grown colons, natively or on MuJoCo Warp, against the lumen's table.

    Actions: one number from -1 to 1 a declared channel, over its range. Observations and reward are those of
    `haustra.envs.tasks.device_task`.
    """

    metadata = {"render_modes": [], "render_fps": 25}  # noqa: RUF012

    def __init__(
        self,
        device: str | Device | None = None,
        *,
        colons: Sequence[Colon] | None = None,
        rules: DeviceRules | dict[str, Any] | None = None,
        render_mode: str | None = None,
        backend: str = "native",
    ) -> None:
        """Take a device, or load one by name or file, or the rules' own, and colons, or grow those of their seeds.

        Raises:
            InvalidOptionError: when pictures are asked for, or the backend is neither 'native' nor 'warp'.
            InvalidDesignError: when the device is not known.
            MissingDependencyError: when what the backend computes with is not installed.
            UnsupportedSceneError: when it cannot meet the lumen's table, or the backend cannot honour it.
        """
        if render_mode is not None:
            raise InvalidOptionError("The environment of any device draws no pictures: leave render_mode out.")
        self.render_mode = None
        self.rules: DeviceRules = read_fields(DeviceRules, rules or {}, "rules")
        given = device if isinstance(device, Device) else None
        if isinstance(device, str):
            self.rules = replace(self.rules, device=device)
        self.task = DeviceTask(self.rules, device=given, colons=colons, backend=backend)
        self.device = self.task.device
        self.observation_space, self.action_space = spaces_of(self.task)
        self._begun = False

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Put the device to the anus of a colon."""
        super().reset(seed=seed)
        require_no_options(options)
        seen = self.task.reset(seeds=None if seed is None else [seed])
        self._begun = True
        return seen["state"][0], self._info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One control interval.

        Raises:
            InvalidOptionError: before the first reset, or when the action is not one number a channel.
        """
        if not self._begun:
            raise InvalidOptionError("The environment was not reset: call reset first.")
        done = self.task.step(checked_action(action, (len(self.device.controls),))[None])
        shown, reward = done.observation["state"][0], float(done.reward[0])
        return shown, reward, bool(done.terminated[0]), bool(done.truncated[0]), self._info()

    def _info(self) -> dict[str, Any]:
        return {name: np.asarray(values)[0].item() for name, values in self.task.info().items()}
