"""Laws that must hold whatever the setting: energy, momentum, frames, mirrors, units, repeats."""

import mujoco

from haustra.models.anatomy.store import load_colon
from haustra.scripts.bench.result import Table
from haustra.scripts.bench.stability.free import JOINTS, ROD, TIMESTEP, free_bars, momentum_drift
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.passive import passive_bars
from haustra.scripts.bench.stability.random_runs import prepare_colons
from haustra.scripts.bench.stability.symmetry import mirror_bars, symmetry_bars


def conservation(order: RunOptions, progress: Progress) -> Part:
    """Judge free rods, passive scopes and symmetries, in quick and full runs alike."""
    folder = order.folder / "colons"
    prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"), walls=False)
    colon = load_colon(folder / "grown-0")
    criteria = free_bars()
    progress(0.2, "free rods")
    criteria += passive_bars(colon)
    progress(0.5, "scope at rest in a colon")
    mirrors, handed = mirror_bars(colon)
    criteria += symmetry_bars(colon) + mirrors
    progress(1.0, "symmetries")
    steps = [TIMESTEP, TIMESTEP / 2, TIMESTEP / 4, TIMESTEP / 8]
    drift = Table(
        "Momentum of a free rod",
        tuple(
            {
                "timestep_s": step,
                "drift": momentum_drift(ROD, step),
                "without_armature": momentum_drift(ROD, step, armature=False),
                "runge_kutta": momentum_drift(ROD, step, integrator=mujoco.mjtIntegrator.mjINT_RK4),
            }
            for step in steps
        ),
        note="Of order one in the time step, with armature or without: the step's error, not the model's.",
    )
    text = (
        f"Rods of {JOINTS} joints in empty space, damped as in scenes; scopes in grown colon 0, tangent planes. "
        "Energy counts motion, springs, wall, hand and locks; a rod gains what it rises above its least until then."
    )
    return Part(criteria, (drift, handed), summary=text)
