"""How far runs of devices other than scopes are off by their time step: ranges that were measured over many colons.

`haustra bench device-errors` drives shipped devices through grown colons at their time step and at half of it, and
writes assets/device_accuracy.toml.
"""

import tomllib
from functools import cache
from pathlib import Path

from haustra.assets import asset
from haustra.errors import HaustraError
from haustra.models.accuracy import LEAST_COLONS, NOT_MEASURED, NumericalError
from haustra.models.device_scene import device_options
from haustra.models.devices.base import Device
from haustra.models.scene import SceneOptions
from haustra.models.wall.elasticity import LINEAR

Entries = dict[tuple[str, bool], NumericalError]
"""Errors by kind of device, and whether colons move."""


def stated_device_error(device: Device, options: SceneOptions, colon: str) -> NumericalError:
    """What was measured for devices of this kind with those options; `NOT_MEASURED` where that is nothing.

    Args:
        device: the device.
        options: of its scene: by the table, linear, at the usual time step of its kind.
        colon: kind of colon, of `haustra.models.accuracy.KINDS`.
    """
    usual = options.wall_law == "table" and options.elasticity == LINEAR
    usual = usual and options.timestep == device_options(device).timestep
    if not usual or colon != "grown":
        return NOT_MEASURED
    return measured_devices().get((device.kind, options.mesentery), NOT_MEASURED)


def load_device_errors(path: Path) -> Entries:
    """Read measured errors; nobody pushes these devices, so that there is none of a push.

    Raises:
        HaustraError: when an entry lacks a key or a source, spans too few colons, or has an impossible range.
    """
    found = {}
    for values in tomllib.loads(path.read_text(encoding="utf-8")).get("measured", ()):
        try:
            (least, most), (nearest, furthest) = values["wall_force"], values["tip_mm"]
            known = 0 <= least <= most < float("inf") and 0 <= nearest <= furthest < float("inf") and values["source"]
            if not known or values["colons"] < LEAST_COLONS:
                raise ValueError("ranges from low to high, a source and enough colons")
            stated = NumericalError((least, most), (None, None), (nearest, furthest), measured_on=values["source"])
            found[values["device"], values["mesentery"]] = stated
        except (KeyError, TypeError, ValueError) as error:
            raise HaustraError(
                f"{path.name}: an entry lacks {error}: measure again (`haustra bench device-errors`)."
            ) from error
    return found


@cache
def measured_devices() -> Entries:
    """Every entry of assets/device_accuracy.toml."""
    return load_device_errors(asset("device_accuracy.toml"))
