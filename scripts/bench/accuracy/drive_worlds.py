"""The same scripts through the backend of many worlds, in JAX: one world, in single or double precision."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.sim.scope_bank import build_bank
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import SceneOptions, entry_of
from haustra.scripts.bench.accuracy.drive import Script, Track
from haustra.scripts.bench.accuracy.timing import processor_seconds


def replay_in_field(
    script: Script, colon: Colon, design: ScopeDesign, options: SceneOptions, *, double: bool = False
) -> Track:
    """Drive one world by a script against the tabulated lumen. Compilation is not part of the cost."""
    with jax.enable_x64(double):
        return _replay(
            script,
            colon,
            design,
            replace(options, wall_law="table", softening=False),
            np.float64 if double else np.float32,
        )


def _replay(script: Script, colon: Colon, design: ScopeDesign, options: SceneOptions, kind: type) -> Track:
    bank = build_bank([colon], design, options)
    engine = JaxScopes.of(bank.scene)
    tables, parameters = bank.tables_on_device(kind), engine.parameters(bank.scene, 1, kind=kind)
    steps = round(CONTROL_INTERVAL / options.timestep)
    go = jax.jit(lambda now, hands: engine.steps(tables, parameters, now, hands, steps))
    look = jax.jit(lambda now: engine.read(parameters, tables, now))
    worlds = engine.begin(parameters, tables)
    jax.block_until_ready(go(worlds, hands_of(script, 0, kind)))
    entry, axes = entry_of(colon)
    rows, spent = [], 0.0
    for index in range(len(script)):
        hands, before = hands_of(script, index, kind), worlds

        def advance(hands: Controls = hands, before=before) -> None:
            nonlocal worlds
            worlds = jax.block_until_ready(go(before, hands))

        spent += processor_seconds(advance)
        if not bool(worlds.healthy[0]):
            break
        seen = look(worlds)
        normal = np.asarray(worlds.normal[0], float)
        tip = entry + axes @ np.asarray(seen.tip[0], float)
        rows.append(
            (*tip, float(seen.insertion[0]), float(seen.push_force[0]), normal.sum(), float((normal > 0).sum()))
        )
    table = np.array(rows).reshape(-1, 7)
    return Track(
        tip=table[:, :3],
        insertion=table[:, 3],
        push=table[:, 4],
        wall=table[:, 5],
        contacts=float(table[:, 6].mean()) if len(table) else 0.0,
        cost=spent / (max(1, len(rows)) * CONTROL_INTERVAL),
    )


def hands_of(script: Script, index: int, kind: type = np.float32) -> Controls:
    """Inputs of one world at one control interval of a script."""
    return Controls(
        jnp.array([script.push_rate[index]], kind),
        jnp.array([script.roll_rate[index]], kind),
        jnp.array(script.pulls[index][None], kind),
    )
