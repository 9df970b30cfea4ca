"""A recorded run as cameras see it: where the tip looked from at each record, and where the colon's surface was."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.runs.insertion import Trajectory
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.run_blood import run_blood
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene

Moment: TypeAlias = tuple[Float[np.ndarray, "vertices 3"], CameraPose]
"""Where a surface's vertices are [m], and the camera's pose."""


@dataclass(frozen=True)
class Source:
    """A run in a colon, by name."""

    name: str
    """What clips of it are called by."""
    scene: Scene
    """Colon and scope."""
    moments: "Moments"
    """What was recorded."""


class Moments:
    """Records of one run of a scope in one colon."""

    HANDS = ("push_rate_m_s", "roll_rate_rad_s", *(f"pull_{name}_N" for name in WIRE_NAMES))
    """Names of the hand's inputs, with units."""

    def __init__(self, scene: Scene, trajectory: Trajectory) -> None:
        """Take a scene and what was recorded of a run in it.

        Raises:
            UnsupportedSceneError: when gas has opened or closed the lumen.
        """
        if scene.options.gas is not None:
            raise UnsupportedSceneError("Runs with gas do not record how wide the lumen was: leave --insufflate out.")
        self.scene, self.trajectory, self.colon = scene, trajectory, scene.colon
        self._run = RecordedRun(scene, trajectory)
        self._camera = self._run.model.camera("scope/camera").id

    @property
    def arcs(self) -> Float[np.ndarray, " vertices"]:
        """Arc length of each vertex of the colon's surface [m]."""
        return self._run.arcs

    def __len__(self) -> int:
        """Number of records."""
        return len(self.trajectory.time)

    def hands(self, records: Sequence[int]) -> Float[np.ndarray, "records 6"]:
        """What the hand asked for until those records, in the order of `HANDS`."""
        names = ("scope/push", "scope/roll", *(f"scope/pull_{name}" for name in WIRE_NAMES))
        columns = [self._run.model.actuator(name).id for name in names]
        return self.trajectory.ctrl[np.asarray(records)][:, columns]

    def camera(self, record: int) -> CameraPose:
        """Where the tip's camera was; wire 'up' is up in its picture."""
        run = self._run
        run.place(record)
        mujoco.mj_comPos(run.model, run.data)
        mujoco.mj_camlight(run.model, run.data)
        axes = run.data.cam_xmat[self._camera].reshape(3, 3)  # MuJoCo's camera is turned: its right is wire 'up'
        up, backwards = axes[:, 0], axes[:, 2]
        rotation = np.stack([np.cross(up, backwards), up, backwards], axis=1)
        return CameraPose(run.data.cam_xpos[self._camera].copy(), rotation)

    def vertices(self, record: int) -> Float[np.ndarray, "vertices 3"]:
        """Where the vertices of the colon's surface were, moved on its mesentery and indented by the scope [m]."""
        return self._run.colon(record).lumen.vertices

    def around(
        self, record: int, exposure: float
    ) -> tuple[tuple[np.ndarray, CameraPose], tuple[np.ndarray, CameraPose]]:
        """Vertices [m] and camera when an exposure of that long [s] around a record begins, and when it ends.

        Between records all goes evenly; before the first and after the last nothing moves.
        """
        time = self.trajectory.time

        def at(moment: float) -> Moment:
            after = int(np.clip(np.searchsorted(time, moment), 1, len(time) - 1))
            share = float(np.clip((moment - time[after - 1]) / (time[after] - time[after - 1]), 0.0, 1.0))
            first, last = self.vertices(after - 1), self.vertices(after)
            return first + share * (last - first), self.camera(after - 1).towards(self.camera(after), share)

        return at(time[record] - exposure / 2), at(time[record] + exposure / 2)

    @cached_property
    def blood(self) -> Float[np.ndarray, "places 5"]:
        """Where and since when the wall bled (`haustra.envs.view.run_blood.run_blood`)."""
        return run_blood(self._run)
