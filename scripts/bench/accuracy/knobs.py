"""Knobs of MuJoCo that every question turns the same way, one at a time: integrator, solver, cone and so on."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

Tweak = Callable[[mujoco.MjSpec], None]


def unchanged(spec: mujoco.MjSpec) -> None:
    """Leave a scene as it was built."""


@dataclass(frozen=True)
class Knob:
    """One setting that differs from the defaults."""

    setting: str
    group: str
    turn: Tweak


def integrators() -> tuple[Knob, ...]:
    """Every integrator but the default, `implicitfast`."""
    kinds = mujoco.mjtIntegrator
    found = {"Euler": kinds.mjINT_EULER, "discrete": kinds.mjINT_DISCRETE, "RK4": kinds.mjINT_RK4}
    return tuple(Knob(f"integrator={name}", "integrator", _option("integrator", kind)) for name, kind in found.items())


def solvers() -> tuple[Knob, ...]:
    """Solvers, limits on their iterations, and tolerances; the default is CG to 1e-6 with at most 100 iterations."""
    kinds = mujoco.mjtSolver
    names = {"Newton": kinds.mjSOL_NEWTON, "PGS": kinds.mjSOL_PGS}
    return (
        *(Knob(f"solver={name}", "solver", _option("solver", kind)) for name, kind in names.items()),
        *(Knob(f"iterations={count}", "iterations", _option("iterations", count)) for count in (5, 20)),
        *(Knob(f"tolerance={size:g}", "tolerance", _option("tolerance", size)) for size in (1e-8, 1e-4)),
    )


def cones() -> tuple[Knob, ...]:
    """Pyramidal friction cones in place of elliptic ones."""
    return (Knob("cone=pyramidal", "cone", _option("cone", mujoco.mjtCone.mjCONE_PYRAMIDAL)),)


def condims(*sizes: int) -> tuple[Knob, ...]:
    """Contacts of that many dimensions: 1 without friction, 3 with it, 4 and 6 with torsion and rolling."""

    def turn(size: int) -> Tweak:
        def change(spec: mujoco.MjSpec) -> None:
            for each in (*(geom for geom in spec.geoms if geom.priority), *spec.pairs):
                each.condim = size

        return change

    return tuple(Knob(f"condim={size}", "condim", turn(size)) for size in sizes)


def impedance_ratios(*ratios: float) -> tuple[Knob, ...]:
    """Stiffness of friction over that of the normal."""
    return tuple(Knob(f"impratio={ratio:g}", "impratio", _option("impratio", ratio)) for ratio in ratios)


def without_step_damping(relaxation_time: float) -> Knob:
    """Joints with the damping of the design alone, `K tau` instead of `K (tau + h)`, and without armature."""

    def change(spec: mujoco.MjSpec) -> None:
        for joint in spec.joints:
            if joint.name.startswith(("scope/bend", "scope/twist")):
                joint.damping = [joint.stiffness[0] * relaxation_time, 0, 0]
                joint.armature = 0.0

    return Knob("damping=K tau, no armature", "joint damping", change)


def _option(name: str, value: object) -> Tweak:
    def change(spec: mujoco.MjSpec) -> None:
        setattr(spec.option, name, value)

    return change
