"""Energies stored in the bent scope and in the pressed wall, after the simulator paper (its eq. 6 to 8).

E_c = sum 1/2 C_i (theta_i - phi_i)^2 over joints of stiffness C_i bent by theta_i, unloaded at phi_i, less what shaft
hinges soften by (`haustra.models.devices.scope.cable.SOFTENING`); E_b = sum 1/2 k_v d_i^2 over contacts of depth d_i
with a wall of stiffness k_v. Twist, which the paper leaves out, is given apart.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

_BEND, _TWIST = "scope/bend_", "scope/twist_"


@dataclass(frozen=True)
class Energies:
    """At one instant."""

    bending: float
    """E_c: of the scope's bending joints [J]."""
    twist: float
    """Of its twist joints [J]."""
    wall: float
    """E_b: of the pressed wall [J]."""

    @property
    def total(self) -> float:
        """E_total = E_c + E_b [J]."""
        return self.bending + self.wall


class EnergyMeter:
    """Reads the energies of one compiled scene."""

    def __init__(self, model: mujoco.MjModel, *, wall_stiffness: float | Float[np.ndarray, " geoms"]) -> None:
        """Find the scope's joints; `wall_stiffness` is that of one contact [N/m], or of the contacts of each geom."""
        names = [model.joint(joint).name for joint in range(model.njnt)]
        self._bends, self._twists = (
            np.array([index for index, name in enumerate(names) if name.startswith(prefix)], dtype=int)
            for prefix in (_BEND, _TWIST)
        )
        self._model = model
        self._wall_stiffness = wall_stiffness

    def read(self, data: mujoco.MjData) -> Energies:
        """Energies of the state whose contacts were last found."""
        depth = np.maximum(data.contact.includemargin - data.contact.dist, 0.0) * (data.contact.exclude == 0)
        return Energies(
            bending=self._of_joints(data, self._bends),
            twist=self._of_joints(data, self._twists),
            wall=float(0.5 * np.sum(self._stiffness(data) * depth**2)),
        )

    def _stiffness(self, data: mujoco.MjData) -> float | np.ndarray:
        """Of each contact [N/m]."""
        if isinstance(self._wall_stiffness, np.ndarray):
            return self._wall_stiffness[data.contact.geom].max(axis=1)
        return self._wall_stiffness

    def _of_joints(self, data: mujoco.MjData, joints: np.ndarray) -> float:
        where = self._model.jnt_qposadr[joints]
        angle = data.qpos[where] - self._model.qpos_spring[where]
        linear, cubic = self._model.jnt_stiffness[joints], self._model.jnt_stiffnesspoly[joints, 1]
        return float(0.5 * linear @ angle**2 + 0.25 * cubic @ angle**4)
