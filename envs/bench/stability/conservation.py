"""Laws that must hold whatever the setting: energy, momentum, frames, mirrors, units, repeats."""

from haustra.envs.bench.result import Table
from haustra.envs.bench.stability.free import JOINTS, ROD, TIMESTEP, free_bars, momentum_drift
from haustra.envs.bench.stability.part import Order, Part, Progress
from haustra.envs.bench.stability.passive import passive_bars
from haustra.envs.bench.stability.random_runs import prepare_colons
from haustra.envs.bench.stability.symmetry import symmetry_bars
from haustra.models.anatomy.store import load_colon


def conservation(order: Order, progress: Progress) -> Part:
    """The same in quick and full runs."""
    folder = order.folder / "colons"
    prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"), walls=False)
    colon = load_colon(folder / "grown-0")
    bars = free_bars()
    progress(0.2, "free rods")
    bars += passive_bars(colon)
    progress(0.5, "scope at rest in a colon")
    bars += symmetry_bars(colon)
    progress(1.0, "symmetries")
    steps = [TIMESTEP, TIMESTEP / 2, TIMESTEP / 4, TIMESTEP / 8]
    drift = Table(
        "Momentum of a free rod",
        tuple({"timestep_s": step, "drift": momentum_drift(ROD, step)} for step in steps),
        note="Of order one in the time step.",
    )
    text = (
        f"Rods of {JOINTS} joints in empty space, damped as in scenes; scopes in grown colon 0, tangent planes. "
        "Energy counts motion, springs, wall, hand and locks; a rod gains what it rises above its least until then."
    )
    return Part(bars, (drift,), summary=text)
