"""`haustra run` of a device that is no scope."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from haustra.errors import InvalidOptionError

if TYPE_CHECKING:
    from haustra.models.devices.base import Device

_ALWAYS = ("colon", "output", "device", "seconds", "friction", "fixed", "json")
_TABLE = ("wall_law", "wall_stiffness", "timestep", "gravity")
_STANDING = ("wall_law", "wall", "start")
"""Options of `haustra run` that devices honour: those that meet the lumen's table, and those that meet pieces."""


def run_any(asked: Any, device: "Device") -> dict[str, Any]:
    """Run any device by its own driver and write the folder; `asked` is a `haustra.scripts.run.Run`.

    Raises:
        InvalidOptionError: naming an option that this device does not honour.
    """
    from haustra.envs.runs.device_run import run_device
    from haustra.envs.view.device_folder import write_device_run
    from haustra.files import prepare_folder
    from haustra.models.anatomy.store import load_colon
    from haustra.models.device_scene import device_options
    from haustra.scripts.console import progress_bar

    on_table = "table" in device.walls
    _require_honoured(asked, device, (*_ALWAYS, *(_TABLE if on_table else _STANDING)))
    if not 0 < asked.seconds <= 36000:
        raise InvalidOptionError(f"--seconds is {asked.seconds}; give a time between 0 and 36000 s.")
    changed = {name: value for name in ("friction", *_TABLE) if (value := getattr(asked, name)) is not None}
    options = device_options(**changed) if on_table else None
    colon, folder = load_colon(asked.colon), prepare_folder(asked.output)
    with progress_bar("simulate", asked.seconds, unit="s") as advance:

        def tell(time: float, arc: float) -> None:
            advance(time, f"tip at {arc:.2f} m")

        if options is None:
            run = _standing(asked, device, colon, tell)
        else:
            run = run_device(device, colon, options, seconds=asked.seconds, progress=tell)
    return write_device_run(folder, colon=colon, run=run)


def _standing(asked: Any, device: "Device", colon: Any, tell: Any) -> Any:
    """A device that stands in a wall of pieces."""
    from haustra.envs.runs.tracked_drive import run_tracked
    from haustra.models.wall.pieces.folder import wall_of

    wall = wall_of(asked.colon, colon, asked.wall)
    return run_tracked(
        device, colon, wall, seconds=asked.seconds, arc=asked.start, friction=asked.friction, progress=tell
    )


def _require_honoured(asked: Any, device: "Device", honoured: tuple[str, ...]) -> None:
    for entry in fields(asked):
        value = getattr(asked, entry.name)
        usual = value == entry.default or value is None or value is False
        if entry.name not in honoured and not usual:
            raise InvalidOptionError(
                f"A device of kind '{device.kind}' does not honour --{entry.name.replace('_', '-')}: leave it out."
            )
    if asked.wall_law is not None and asked.wall_law not in device.walls:
        raise InvalidOptionError(
            f"A device of kind '{device.kind}' cannot meet wall law '{asked.wall_law}'. It can meet: "
            f"{', '.join(device.walls)}."
        )
