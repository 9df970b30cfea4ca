"""Any device with controls, driven live on MuJoCo's CPU engine."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.console.scope_vehicle import LENS_SIZE
from haustra.envs.console.vehicle import Condition, Lever, Look, Repeating, Surroundings, digest
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.sim.device_native import NativeDevice
from haustra.envs.view.picture.lens import equidistant_lens
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import DeviceScene, build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import Device
from haustra.models.injury.perforation import link_load
from haustra.models.wall.lumen_table import axis_tables, stack


class DeviceVehicle(Repeating):
    """A device on the backend 'native'."""

    kind = "device"
    backend = "native"

    def __init__(self, colon: Colon, device: Device, changed: dict[str, Any]) -> None:
        """Build the scene with some options changed, and compile.

        Raises:
            UnsupportedSceneError: naming what the device or its scene does not honour.
        """
        options = device_options(device, **changed)
        scene = build_device_scene(device, options, pose=pose_in(colon, device, options))
        tables = device_tables(scene, [colon])
        self.given = colon
        self._device, self._changed = device, dict(changed)
        self.around = device_surroundings(colon, scene)
        self._scene, self._native = scene, NativeDevice(scene, tables)
        self._steps = max(1, round(CONTROL_INTERVAL / options.timestep))
        self.interval = self._steps * options.timestep
        self.levers = tuple(Lever(one.name, one.unit, one.low, one.high) for one in device.controls)
        self.conditions = Condition("friction", "1", 0.0, 2.0), Condition("wall_stiffness", "N/m", 50.0, 1e5)
        self._now = np.array([options.friction, options.wall_stiffness])
        self._memory, self._stations = np.zeros(1), stations_of(colon)
        self._thick = scene.groups == scene.groups[-1]
        self._seen, self._done = self._native.read(), []

    def configuration(self) -> dict[str, Any]:
        """Design and changed options."""
        return {"kind": self.kind, "device": self._device.describe(), "options": self._changed}

    def restart(self) -> None:
        """Put the device back to where it began."""
        options, none = self._scene.options, np.zeros(1, int)
        self._now, self._memory = np.array([options.friction, options.wall_stiffness]), np.zeros(1)
        contact = {"friction": self._now[:1].copy(), "wall_stiffness": self._now[1:].copy()}
        self._native.reset(none, none, **contact)
        self._seen = self._native.read()

    def advance(self, levers: Float[np.ndarray, " levers"]) -> bool:
        """Advance by one control step."""
        sound = bool(self._native.step(levers[None], self._steps)[0])
        self._seen = self._native.read()
        return sound

    def look(self) -> Look:
        """What all devices tell, and this one's own readings."""
        seen, native = self._seen, self._native
        force, arc = float(seen.wall_force[0]), float(seen.tip_arc[0])
        row = {
            "time": float(seen.time[0]),
            "tip": seen.tip[0],
            "tip_frame": seen.tip_frame[0],
            "tip_arc": arc,
            "wall_force": force,
            "load": float(link_load(np, np.array([force]), 0.0, True, 2 * self.around.radius)[0]),
            "load_arc": arc,
            "deepest": float(seen.deepest[0]),
            **{name: float(value[0]) for name, value in native.readings().items()},
            "digest": digest(*native.positions(), *native.velocities(), *_given(native.displacement)),
        }
        pressed = np.where(np.abs(self._stations - arc) <= 0.01, force, 0.0)
        frame = {"shape": native.spheres()[0][self._thick], "pressed": pressed, "pain": np.zeros(len(self._stations))}
        if native.displacement is not None:
            frame["displacement"] = native.displacement[0]
        return Look(row, frame)

    def assist(self) -> Float[np.ndarray, " levers"]:
        """What the device's own driver commands."""
        commands, self._memory = self._device.drive(np, self._seen, self._memory)
        return np.array([one.limited(float(value)) for one, value in zip(self.levers, commands[0], strict=True)])

    def change(self, name: str, number: float) -> None:
        """Set a condition: from the next step on."""
        self._now[[one.name for one in self.conditions].index(name)] = number
        self._native.set_contact(*self._now)

    def now(self) -> Float[np.ndarray, " conditions"]:
        """Conditions as they are."""
        return self._now.copy()


def device_surroundings(colon: Colon, scene: DeviceScene) -> Surroundings:
    """The colon of a device."""
    options = scene.options
    tables = stack([axis_tables(colon, options.abdomen)]) if options.mesentery else None
    lens = equidistant_lens(scene.device.view_deg, LENS_SIZE)
    return Surroundings(colon, tables, np.zeros(3), np.eye(3), scene.handles.samples[-1].radius, lens)


def _given(values: np.ndarray | None) -> Iterator[np.ndarray]:
    if values is not None:
        yield values
