"""What any device does to the colon it is in: pressure, pain and the mesentery's extension, as scopes are measured."""

import numpy as np
from jaxtyping import Float

from haustra.envs.runs.measure.containment import lumen_widths
from haustra.envs.runs.measure.injury import at_stations, stations_of
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import DeviceScene
from haustra.models.injury.pain import axis_tensions, pain, pressed_tension
from haustra.models.injury.patch import patch_area
from haustra.models.wall.lumen_table import axis_tables
from haustra.models.wall.moving_colon import mesentery_extension


class DeviceMeter:
    """Tells what forces on a device's bodies mean for the colon it is in."""

    def __init__(self, scene: DeviceScene, colon: Colon) -> None:
        """For that device in that colon."""
        self._stations = len(stations_of(colon))
        patches = [_patch(scene, body) for body in scene.handles.bodies]
        self._width, self._length = np.array(patches).T
        options = scene.options
        self._axis = axis_tables(colon, options.abdomen).mesentery if options.mesentery else None
        if self._axis is not None:
            self._node_arcs = float(self._axis.spacing) * np.arange(len(self._axis.nodes))
            self._node_radius = np.interp(self._node_arcs, *lumen_widths(colon))

    def pressure(self, forces: Float[np.ndarray, "records bodies"]) -> Float[np.ndarray, " records"]:
        """Largest pressure of a body on the patch of wall that it lies on [Pa]."""
        return (forces / patch_area(self._width, self._length)).max(axis=1)

    def extension(
        self, displacement: Float[np.ndarray, "records nodes 7"] | None, time: Float[np.ndarray, " records"]
    ) -> Float[np.ndarray, " records"]:
        """Farthest that the mesentery is drawn out beyond its slack [m]; 0 where the colon is fixed.

        Args:
            displacement: of the nodes of the colon's axis; None where it is fixed.
            time: of each record [s].
        """
        if self._axis is None or displacement is None:
            return np.zeros(len(time))
        return mesentery_extension(np, self._axis, displacement, time).max(axis=-1)

    def pain(
        self,
        forces: Float[np.ndarray, "records bodies"],
        arcs: Float[np.ndarray, "records bodies"],
        displacement: Float[np.ndarray, "records nodes 7"] | None,
        time: Float[np.ndarray, " records"],
    ) -> Float[np.ndarray, "records stations"]:
        """Pain at each station [1] (`haustra.models.injury.pain`).

        Args:
            forces: of the wall on bodies [N].
            arcs: arc lengths of the bodies [m].
            displacement: of the nodes of the colon's axis; None where it is fixed.
            time: of each record [s].
        """
        tension = pressed_tension(np.where(arcs > 0, forces, 0.0), self._width, self._length)
        wall, held = at_stations(tension, arcs, self._stations), np.zeros((len(forces), self._stations))
        if self._axis is not None and displacement is not None:
            along, mesentery = axis_tensions(np, self._axis, displacement, self._node_radius, time)
            along, held = (at_stations(part, self._node_arcs, self._stations) for part in (along, mesentery))
            wall = np.maximum(wall, along)
        return pain(np, wall, held)


def _patch(scene: DeviceScene, body: str) -> tuple[float, float]:
    """Width, and length beyond its round ends, of the patch that a body lies on [m]."""
    if body in scene.handles.patches:
        return scene.handles.patches[body], 0.0
    spheres = [sample for sample in scene.handles.samples if sample.body == body]
    places = np.array([sample.position for sample in spheres])
    return 2 * spheres[-1].radius, float(np.linalg.norm(np.ptp(places, axis=0)))
