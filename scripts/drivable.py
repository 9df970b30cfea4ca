"""What is driven, and where: options that `haustra drive` and `haustra record` share."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from haustra.errors import InvalidOptionError
from haustra.fields import number, texts, whole


@dataclass(frozen=True, kw_only=True)
class Drivable:
    """Colon, device and conditions."""

    colon: Path
    """Folder of a colon, from `haustra colon import` or `haustra colon grow`."""
    device: str = "adult"
    """Name of a shipped device (adult, paediatric, those in assets/devices) or a TOML file."""
    preset: Literal["fast", "balanced"] = "balanced"
    """How finely the scope is modelled."""
    fixed: bool = False
    """Let the colon stand fixed in space instead of swinging, stretching and pleating on its mesentery."""
    gas: bool = True
    """Fill the colon with gas, which the hand lets in and sucks out; scopes only."""
    posture: Literal["supine", "prone", "left", "right"] = "supine"
    """How the patient lies at the start."""
    mobile: tuple[str, ...] = texts(most=2, default=())
    """Segments that hang on a mesentery of their own in this patient: descending, ascending."""
    adhesions: tuple[str, ...] = texts(most=2, default=())
    """Segments that have grown to what is beside them: sigmoid, transverse."""
    friction: float | None = number("1", 0.0, 2.0, default=None)
    """Coulomb's coefficient between device and wall at the start [1]; the sourced default when not given."""
    wall_stiffness: float | None = number("N/m", 50.0, 1e5, default=None)
    """Normal stiffness of a contact with the wall at the start [N/m]; the sourced default when not given."""
    task: str | None = None
    """Rules of an episode to drive, so that it can be learned from: a folder of a policy, whose task it is, or
    'insertion'. Device, gas and conditions are then the task's."""
    seed: int = whole(0, 2**31 - 1, default=0)
    """Seed of what an episode draws."""

    def configuration(self, driver: str = "follower") -> dict[str, Any]:
        """What `haustra.envs.console.vehicles.make_vehicle` makes, with that driver to help.

        Raises:
            InvalidOptionError: naming an option that this device does not honour.
        """
        from dataclasses import asdict, replace

        from haustra.envs.control.laws import DRIVERS
        from haustra.models.devices.base import load_device
        from haustra.models.devices.scope.interface import Scope
        from haustra.models.presets import find_preset
        from haustra.models.wall.abdomen import Abdomen

        if self.task is not None or driver not in DRIVERS:
            return self._episode(driver)
        device = load_device(self.device)
        changed = {name: value for name in ("friction", "wall_stiffness") if (value := getattr(self, name)) is not None}
        abdomen = Abdomen(self.posture, self.mobile, self.adhesions)
        if not isinstance(device, Scope):
            if driver != "follower":
                raise InvalidOptionError(
                    f"A device of kind '{device.kind}' has a driver of its own: leave --driver out."
                )
            if abdomen != Abdomen() or self.preset != "balanced":
                raise InvalidOptionError(
                    f"A device of kind '{device.kind}' honours neither a preset nor posture, mobile segments and "
                    "adhesions: leave them out."
                )
            changed["mesentery"] = not (self.fixed or device.has_treads)
            return {"kind": "device", "device": device.describe(), "options": changed}
        gas = {"gas": _SET_POINT} if self.gas else {}
        options = find_preset(self.preset).apply(law="table")
        options = replace(options, mesentery=not self.fixed, abdomen=abdomen, **gas, **changed)
        return {"kind": "scope", "design": asdict(device.design), "options": asdict(options), "driver": driver}

    def _episode(self, driver: str) -> dict[str, Any]:
        from dataclasses import replace

        from haustra.envs.control.laws import DRIVERS
        from haustra.envs.learning.policy import load_policy, policy_folder
        from haustra.envs.tasks.config import TaskConfig

        for name in ("friction", "wall_stiffness"):
            if getattr(self, name) is not None:
                raise InvalidOptionError(f"An episode draws its {name} by its seed: leave --{name} out.")
        source = self.task if driver in DRIVERS else driver
        if source == "insertion" and driver in DRIVERS:
            task = replace(TaskConfig(), mesentery=not self.fixed)
        else:
            task = load_policy(policy_folder(str(source))).config
        if self.device != "adult":
            task = replace(task, design=self.device)
        return {"kind": "episode", "task": task.to_json(), "seed": self.seed, "policy": driver}


_SET_POINT = 3333.0
"""Pressure at the tip up to which the insufflator lets gas in [Pa]: 25 mmHg, as in colonoscopy."""


def require_extra(name: str, modules: tuple[str, ...]) -> None:
    """Refuse to begin without the packages of an extra.

    Raises:
        MissingDependencyError: with the command that installs them.
    """
    from importlib.util import find_spec

    from haustra.errors import MissingDependencyError

    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        raise MissingDependencyError(f"This needs {', '.join(missing)}: 'pip install haustra[{name}]'.")


Tell = Callable[[float, str], None]
