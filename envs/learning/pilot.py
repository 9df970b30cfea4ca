"""A policy that drives any device in a single run, at its own pace."""

from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.tasks.device_task import commands_of, entries_of, seen_by_device
from haustra.errors import InvalidOptionError
from haustra.models.devices.base import Device, DeviceReadings

_ROUNDING = 1e-6
"""Time by which a decision may come early, a tolerance [s]."""


def require_drivable(policy: MlpPolicy, device: Device) -> None:
    """Refuse a device that a policy cannot drive.

    Raises:
        InvalidOptionError: when the policy was trained for a device with other controls or readings, or these are in
            the patient's axes: episodes begin at the origin, along z, and a run does not.
    """
    if device.in_patient_axes:
        raise InvalidOptionError(
            f"'{device.name}' is moved in the patient's axes, which no policy sees: let its own driver drive it."
        )
    if policy.drives is None or policy.widths != (entries_of(device), len(device.controls)):
        raise InvalidOptionError(f"The policy was not trained for a device like '{device.name}': name another.")


class Pilot:
    """Decides once in each of the policy's control intervals of one run, and holds its commands in between."""

    def __init__(self, policy: MlpPolicy, device: Device, *, length: float) -> None:
        """Drive this device in a colon of that length [m].

        Raises:
            InvalidOptionError: as `require_drivable`.
        """
        require_drivable(policy, device)
        self._policy, self._device, self._length = PolicyDriver(policy), device, length
        self._interval, self._next = policy.interval, 0.0
        self._commands = commands_of(device, np.zeros((1, len(device.controls))))

    def __call__(self, seen: DeviceReadings, own: dict[str, Any]) -> Float[np.ndarray, "1 channels"]:
        """Commands now, by what every device tells and by its own readings."""
        if seen.time[0] >= self._next - _ROUNDING:
            shown = seen_by_device(self._device, seen, own, np.full(1, self._length))
            self._commands = commands_of(self._device, self._policy.act({"state": shown}))
            self._next = float(seen.time[0]) + self._interval
        return self._commands
