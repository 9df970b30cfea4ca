"""Energies stored in the bent scope and in the pressed wall, after the simulator paper (its eq. 6 to 8).

E_c = sum 1/2 C_i (theta_i - phi_i)^2 over joints of stiffness C_i bent by theta_i, unloaded at phi_i, less what shaft
hinges soften by (`haustra.models.devices.scope.cable.SOFTENING`); E_b = sum 1/2 k_v d_i^2 over contacts of depth d_i
with a wall of stiffness k_v. Twist, which the paper leaves out, is given apart.
"""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int

_BEND, _TWIST = "scope/bend_", "scope/twist_"


@dataclass(frozen=True)
class Energies:
    """At one instant."""

    bending: float
    """E_c: of the scope's bending joints [J]."""
    twist: float
    """Elastic energy of the scope's twist joints [J]."""
    wall: float
    """E_b: of the pressed wall [J]."""

    @property
    def total(self) -> float:
        """E_total = E_c + E_b [J]."""
        return self.bending + self.wall


class _Springs(NamedTuple):
    """Springs of some joints: rest angles, linear and cubic stiffnesses."""

    where: Int[np.ndarray, " joints"]
    """Indices of the joints' angles among the positions."""
    rest: Float[np.ndarray, " joints"]
    linear: Float[np.ndarray, " joints"]
    cubic: Float[np.ndarray, " joints"]

    @classmethod
    def of(cls, model: mujoco.MjModel, joints: Int[np.ndarray, " joints"]) -> "_Springs":
        where = model.jnt_qposadr[joints]
        return cls(where, model.qpos_spring[where], model.jnt_stiffness[joints], model.jnt_stiffnesspoly[joints, 1])

    def energy(self, qpos: Float[np.ndarray, "*records positions"]) -> Float[np.ndarray, "*records"]:
        square = (qpos[..., self.where] - self.rest) ** 2
        return np.asarray(0.5 * square @ self.linear + 0.25 * square**2 @ self.cubic)


class EnergyMeter:
    """Reads the energies of one compiled scene."""

    def __init__(self, model: mujoco.MjModel, *, wall_stiffness: float | Float[np.ndarray, " geoms"]) -> None:
        """Find the scope's joints; `wall_stiffness` is that of one contact [N/m], or of the contacts of each geom."""
        names = [model.joint(joint).name for joint in range(model.njnt)]
        self._bends, self._twists = (
            _Springs.of(model, np.array([i for i, name in enumerate(names) if name.startswith(prefix)], dtype=int))
            for prefix in (_BEND, _TWIST)
        )
        self._wall_stiffness = wall_stiffness

    def read(self, data: mujoco.MjData) -> Energies:
        """Energies of the state whose contacts were last found."""
        depth = np.maximum(data.contact.includemargin - data.contact.dist, 0.0) * (data.contact.exclude == 0)
        return Energies(
            bending=float(self._bends.energy(data.qpos)),
            twist=float(self._twists.energy(data.qpos)),
            wall=float(0.5 * np.sum(self._stiffness(data) * depth**2)),
        )

    def bending(self, qpos: Float[np.ndarray, "*records positions"]) -> Float[np.ndarray, "*records"]:
        """E_c of the scope's bending joints at generalised positions [J]."""
        return self._bends.energy(qpos)

    def twist(self, qpos: Float[np.ndarray, "*records positions"]) -> Float[np.ndarray, "*records"]:
        """Energy of the scope's twist joints at generalised positions [J]."""
        return self._twists.energy(qpos)

    def _stiffness(self, data: mujoco.MjData) -> float | np.ndarray:
        """Wall stiffness of each contact [N/m]."""
        if isinstance(self._wall_stiffness, np.ndarray):
            return self._wall_stiffness[data.contact.geom].max(axis=1)
        return self._wall_stiffness
