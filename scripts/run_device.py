"""`haustra run` of a device that is no scope."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from haustra.errors import InvalidOptionError
from haustra.scripts.run import AROUND

if TYPE_CHECKING:
    from haustra.envs.learning.policy import MlpPolicy
    from haustra.models.devices.base import Device

_ALWAYS = ("colon", "output", "device", "seconds", "friction", "fixed", "wall", "error", "film", "json")
_TABLE = ("wall_law", "wall_stiffness", "elasticity", "timestep", "gravity")
_PATIENT = ("insufflate", "gas_flow", "gas_start", *AROUND)
"""Options of `haustra run` that all devices honour; `start` is honoured by those that stand in the colon."""


def run_any(asked: Any, device: "Device", policy: "MlpPolicy | None" = None) -> dict[str, Any]:
    """Run any device, by its own driver or a policy, and write the folder; `asked` is a `haustra.scripts.run.Run`.

    Raises:
        InvalidOptionError: naming an option that this device does not honour.
    """
    from haustra.envs.learning.pilot import Pilot, require_drivable
    from haustra.envs.runs.device_run import DeviceRun, run_device
    from haustra.envs.runs.error import half_step, own_error
    from haustra.envs.view.device_folder import write_device_run
    from haustra.files import prepare_folder
    from haustra.models.anatomy.store import load_colon
    from haustra.models.device_scene import device_options
    from haustra.models.scene import SceneOptions
    from haustra.models.wall.pieces.folder import wall_of
    from haustra.scripts.console import progress_bar
    from haustra.scripts.wall import wall_bar

    stands, learned = "start_depth" in device.usual, () if policy is None else ("driver",)
    _require_honoured(asked, device, (*_ALWAYS, *_TABLE, *_PATIENT, *(("start",) if stands else ()), *learned))
    changed = {name: value for name in ("friction", *_TABLE) if (value := getattr(asked, name)) is not None}
    changed |= asked.patient_options()
    changed["mesentery"] = not asked.fixed
    if asked.start is not None:
        changed["start_depth"] = asked.start
    options = device_options(device, **changed)
    colon = load_colon(asked.colon)
    if policy is not None:
        require_drivable(policy, device)
    folder, wall = prepare_folder(asked.output), None
    if options.wall_law == "pieces":
        with wall_bar() as tell_wall:
            wall = wall_of(asked.colon, colon, asked.wall, progress=tell_wall)

    def drive(what: str, options: SceneOptions) -> DeviceRun:
        by = {}
        if policy is not None:
            by = {"driver": asked.driver, "pilot": Pilot(policy, device, length=colon.centreline.length)}
        with progress_bar(what, asked.seconds, unit="s") as advance:

            def tell(time: float, arc: float) -> None:
                advance(time, f"tip at {arc:.2f} m")

            return run_device(device, colon, options, seconds=asked.seconds, wall=wall, progress=tell, **by)

    run, error = drive("simulate", options), None
    if asked.error:
        error = own_error(run, {name: drive(name, finer) for name, finer in half_step(options).items()})
    if not asked.film:
        return write_device_run(folder, colon=colon, run=run, error=error)
    with progress_bar("film", 1, unit="films") as advance:
        tell = lambda done, total: advance(done / total, f"{done} of {total} pictures")  # noqa: E731
        return write_device_run(folder, colon=colon, run=run, error=error, film=tell)


def _require_honoured(asked: Any, device: "Device", honoured: tuple[str, ...]) -> None:
    for entry in fields(asked):
        value = getattr(asked, entry.name)
        usual = value == entry.default or value is None or value is False
        if entry.name not in honoured and not usual:
            raise InvalidOptionError(
                f"A device of kind '{device.kind}' does not honour --{entry.name.replace('_', '-')}: leave it out."
            )
