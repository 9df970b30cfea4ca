"""A uniform scope held at its handle end, all joints free: what cantilever theory speaks of."""

from typing import Any

import mujoco
import numpy as np

from haustra.errors import HaustraError
from haustra.models.devices.scope.cable import Cable, add_scope
from haustra.models.devices.scope.cells import cut_into_cells
from haustra.models.devices.scope.design import BendingLimits, ScopeDesign, ScopeSection, ScopeTip
from haustra.models.devices.scope.stops import apply_stops
from haustra.models.devices.scope.wires import WireSet

EI = 0.03
"""Flexural rigidity [N m^2]."""
LENGTH = 0.5
"""Without the rigid tip [m]."""
TIP = 0.005
"""Length of the rigid tip [m]."""
_STILL = 1e-8
"""Joint speed below which nothing moves [rad/s]."""


def uniform_design(**changes: Any) -> ScopeDesign:
    """A scope of one stiffness, nearly critically damped in its first mode, so that it settles soon."""
    half = ScopeSection(length=LENGTH / 2, flexural_rigidity=EI, torsional_rigidity=13 * EI)
    values = {
        "name": "uniform rod",
        "diameter": 0.0128,
        "mass_per_length": 0.3,
        "relaxation_time": 0.3,
        "shaft": (half,),
        "bending": half,
        "limits": BendingLimits(up=300.0, left=300.0, down=300.0, right=300.0),
        "wires": WireSet(routing_radius=0.005, pull_limit=100.0),
        "tip": ScopeTip(length=TIP, field_of_view_deg=140.0),
    }
    return ScopeDesign(**{**values, **changes})


def clamped(
    design: ScopeDesign, joints: int, *, twist_hinges: int = 0, timestep: float = 0.004
) -> tuple[mujoco.MjSpec, Cable]:
    """Spec and cable of the rod along z with its handle end at the origin, held by stiff hands.

    Raises:
        HaustraError: when that many joints of one length do not fit into the design's sections.
    """
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = timestep
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    cells = cut_into_cells(design, shaft_cell=LENGTH / joints, bending_cell=LENGTH / joints)
    if len(cells) != joints:
        raise HaustraError(f"A clamped rod of {joints} joints came out with {len(cells)}: give an even number.")
    cable = add_scope(
        spec,
        design,
        cells,
        entry=np.zeros(3),
        frame=np.eye(3),
        inserted=design.length,
        twist_hinges=twist_hinges,
        push_limit=1e5,
        torque_limit=1e5,
        timestep=timestep,
    )
    apply_stops(spec, spec.compile(), timestep=timestep)
    for name in ("scope/push", "scope/roll"):  # a clamp, not a hand
        spec.joint(name).stiffness = [1e7, 0, 0]
        spec.joint(name).damping = [1e5, 0, 0]
    return spec, cable


def settle(model: mujoco.MjModel, data: mujoco.MjData, *, seconds: float = 20.0) -> None:
    """Step until nothing moves.

    Raises:
        HaustraError: when it still does after that much simulated time.
    """
    for _ in range(int(seconds / model.opt.timestep / 100)):
        mujoco.mj_step(model, data, 100)
        if np.abs(data.qvel).max() < _STILL:
            return
    raise HaustraError(f"The rod still moves at {np.abs(data.qvel).max():.2e} rad/s after {seconds} s.")
