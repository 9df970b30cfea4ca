"""What a step of one scope against the tabulated lumen costs, in a process of its own with one thread of JAX."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np

from haustra.envs.sim.jax_setup import compute_on_one_thread
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.scripts.bench.accuracy.drive import Script
from haustra.scripts.bench.accuracy.timing import Block, in_turns, processor_seconds

_CALLS = 12
"""Control intervals of one timed block: about as many time steps as of other backends."""

Modelled = tuple[SceneOptions, float | None]
"""How a scope is modelled, and the most of it that gets in [m]: shaft that stays outside is left out; None keeps it."""


def field_costs(colon: Colon, design: ScopeDesign, asked: Sequence[Modelled], script: Script) -> list[float]:
    """Processor time of a step at the end of a script [ms], all in turns; infinite where a world diverged.

    Compilation is not part of it. JAX must be installed.
    """
    context = get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, initializer=compute_on_one_thread) as apart:
        return apart.submit(_costs, colon, design, asked, script).result()


def _costs(colon: Colon, design: ScopeDesign, asked: Sequence[Modelled], script: Script) -> list[float]:
    return in_turns([_pushed(colon, design, options, deepest, script) for options, deepest in asked])


def _pushed(colon: Colon, design: ScopeDesign, options: SceneOptions, deepest: float | None, script: Script) -> Block:
    """Drive one world by the script, and give what steps it on from there again and again."""
    import jax

    from haustra.envs.runs.insertion import CONTROL_INTERVAL
    from haustra.envs.sim.device_arrays import on_device
    from haustra.envs.sim.scope_worlds import JaxScopes
    from haustra.scripts.bench.accuracy.drive_worlds import hands_of

    scene = build_scene(
        colon, None, design, replace(options, wall_law="table", softening=False), show_lumen=False, deepest=deepest
    )
    table = lumen_table(colon, device_radius=scene.cable.radius)
    tables = on_device(stack([table.seen_from(*entry_of(colon))]))
    engine = JaxScopes.of(scene)
    parameters = engine.parameters(scene, 1)
    steps = round(CONTROL_INTERVAL / options.timestep)
    go: Callable = jax.jit(lambda now, hands: engine.steps(tables, parameters, now, hands, steps))
    worlds = engine.begin(parameters, tables)
    for index in range(len(script)):
        worlds = go(worlds, hands_of(script, index))
    hands = hands_of(script, len(script) - 1)
    if not bool(worlds.healthy[0]):
        return lambda: np.inf

    def work() -> None:
        now = worlds
        for _ in range(_CALLS):
            now = jax.block_until_ready(go(now, hands))

    return lambda: processor_seconds(work) / (_CALLS * steps) * 1e3
