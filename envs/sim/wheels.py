"""Steering by the hand wheels: travel of wire in, pulls out, with the slack and stretch that wires have."""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.physics.wires import wheel_pulls
from haustra.errors import InvalidDesignError
from haustra.models.devices.scope.cable import Cable
from haustra.models.devices.scope.wires import WIRE_NAMES, WireSet, travel_of_wheels

_LARGEST_GAIN = 2.0
"""Largest h^2 k / (I + h c) of wires against the bending section: an explicit spring is stable up to 4, and opposite
wires may be tight at once; engineering choice of a factor two below."""


class Wheels:
    """The wheels of one compiled scope."""

    def __init__(self, model: mujoco.MjModel, cable: Cable, wires: WireSet) -> None:
        """Learn the wires' stretch.

        Raises:
            InvalidDesignError: when wires do not stretch, or so little that the time step is too long for them.
        """
        require_stretch(wires.compliance)
        self._wires = wires
        self._arms = wire_arms(model)
        joints = [f"scope/bend_y_{index:03d}" for index, cell in enumerate(cable.cells) if cell.steerable]
        dofs = [model.joint(name).dofadr[0] for name in joints]
        step = model.opt.timestep
        inertia = model.dof_armature[dofs] + step * np.reshape(model.dof_damping, (model.nv, -1))[dofs, 0]
        gain = float((step * wires.routing_radius) ** 2 / wires.compliance * (1 / inertia).sum())
        if gain > _LARGEST_GAIN:
            raise InvalidDesignError(
                f"Wires that stretch by {wires.compliance:.2g} m/N are too stiff for steps of {step} s: "
                f"give wires.compliance of at least {wires.compliance * gain / _LARGEST_GAIN:.2g}, or shorter steps."
            )

    def pulls(self, data: mujoco.MjData, wheels: Float[np.ndarray, "2"]) -> Float[np.ndarray, "4"]:
        """Pull of each wire at the wheels [N], for the travel of wire that both wheels have taken up [m]."""
        return pulls_at(self._wires, wheels, self._arms @ data.qpos)


def wire_arms(model: mujoco.MjModel) -> Float[np.ndarray, "4 joints"]:
    """Length of each wire's path per angle of each joint [m/rad]: a tendon's own length is that of the step before."""
    arms = np.zeros((len(WIRE_NAMES), model.nv))
    for wire, name in enumerate(WIRE_NAMES):
        tendon = model.tendon(f"scope/wire_{name}").id
        wraps = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        arms[wire, model.jnt_dofadr[model.wrap_objid[wraps]]] = model.wrap_prm[wraps]
    return arms


def pulls_at(wires: WireSet, wheels: Float[np.ndarray, "2"], longer: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
    """Pull of each wire at the wheels [N].

    Args:
        wires: that stretch.
        wheels: wire that they have taken up, towards up and left [m].
        longer: how much longer each wire's path is than in the straight section [m].
    """
    stretch = travel_of_wheels(wheels) - wires.slack + longer
    return wheel_pulls(np, stretch, compliance=wires.compliance, limit=wires.pull_limit)


def require_stretch(compliance: Any) -> None:
    """Refuse wires whose pull does not follow from what their wheels take up; `compliance` of one design, or of many.

    Raises:
        InvalidDesignError: when wires do not stretch.
    """
    if np.any(np.asarray(compliance) <= 0):
        raise InvalidDesignError(
            "Wheels cannot steer wires that do not stretch: give wires.compliance (1.7 m of steel: 6e-5 m/N)."
        )
