"""Question: how does cost grow with the colon's length, the wall's pieces, contacts, and worlds?"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS, build_bank
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import PRESETS
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.accuracy.places import Place, grown
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import in_turns, processor_seconds, stepping
from haustra.scripts.bench.result import Table, Value
from haustra.scripts.bench.throughput import measure_rates, rate_rows

RATE = 0.04
"""At which the shaft is pushed in [m/s]."""


def answer(effort: Effort) -> Answer:
    """One table for each thing that grows."""
    place, design = grown(effort), find_design("adult")
    seconds = 3.0 if effort.quick else 8.0
    tables = [_lengths(place, design, effort, seconds), _pieces(place, design, effort, seconds)]
    tables.append(_contacts(place, design, effort, 6.0 if effort.quick else 20.0))
    tables.append(_worlds(place, design, effort))
    return Answer(tables=tables)


def _pushed(
    place: Place, wall: Wall, design: ScopeDesign, options: SceneOptions, seconds: float, deepest: float | None = None
) -> NativeEngine:
    engine = NativeEngine(build_scene(place.colon, wall, design, options, show_lumen=False, deepest=deepest))
    for _ in range(round(seconds / CONTROL_INTERVAL)):
        engine.step(Controls(RATE, 0.0), round(CONTROL_INTERVAL / options.timestep))
    return engine


def _lengths(place: Place, design: ScopeDesign, effort: Effort, seconds: float) -> Table:
    wall, options = place.wall("prism"), PRESETS["balanced"].apply()
    engines = {}
    for reach in (0.4, 0.8, 1.2, None):
        effort.tell(f"growth: {reach or 'all'} m of colon")
        engines[reach or place.colon.centreline.length] = _pushed(place, wall, design, options, seconds, reach)
    rows = _timed(engines, "length_within_reach_m")
    note = "The same push; wall and shaft beyond reach are left out, as in runs."
    return Table("Cost against the length of colon within reach", rows, note)


def _pieces(place: Place, design: ScopeDesign, effort: Effort, seconds: float) -> Table:
    options = PRESETS["balanced"].apply()
    walls = {"prism, 0.8 mm": place.wall("prism")}
    if not effort.quick:
        walls |= {"coacd, 1.5 mm": place.wall("coacd"), "prism, 1.5 mm": place.coarse_wall()}
    engines = {name: _pushed(place, wall, design, options, seconds) for name, wall in walls.items()}
    rows = tuple({**row, "pieces": len(walls[str(row["wall"])].pieces)} for row in _timed(engines, "wall"))
    return Table("Cost against the wall's pieces", rows, "The same push, all pieces in the scene.")


def _timed(engines: dict, name: str) -> tuple[dict[str, Value], ...]:
    costs = in_turns([stepping(engine.model, engine.data) for engine in engines.values()])
    return tuple(
        {
            name: key,
            "cost_processor_s_per_s": cost,
            "dofs": engine.model.nv,
            "pieces": engine.scene.pieces,
            "contacts": engine.read().contacts,
        }
        for (key, engine), cost in zip(engines.items(), costs, strict=True)
    )


def _contacts(place: Place, design: ScopeDesign, effort: Effort, seconds: float) -> Table:
    """Steps of one insertion, sorted by how many contacts they had."""
    effort.tell("growth: contacts")
    wall, options = place.wall("prism"), PRESETS["balanced"].apply()
    engine = NativeEngine(build_scene(place.colon, wall, design, options, show_lumen=False))
    steps, found = round(CONTROL_INTERVAL / options.timestep), []
    for _ in range(round(seconds / CONTROL_INTERVAL)):
        spent = processor_seconds(lambda: engine.step(Controls(RATE, 0.0), steps))
        found.append((engine.data.ncon, spent / CONTROL_INTERVAL))
    contacts, costs = np.array(found).T
    edges = np.unique(np.quantile(contacts, [0, 0.25, 0.5, 0.75, 1]))
    rows: list[dict[str, Value]] = []
    for low, high in pairwise(edges):
        chosen = (contacts >= low) & (contacts <= high)
        rows.append(
            {"contacts_from": int(low), "to": int(high), "cost_processor_s_per_s": float(np.median(costs[chosen]))}
        )
    slope, base = np.polyfit(contacts, costs, 1)
    note = f"Straight line: {base:.3g} + {slope:.3g} for each contact."
    return Table("Cost against contacts", tuple(rows), note)


def _worlds(place: Place, design: ScopeDesign, effort: Effort) -> Table:
    """The backend of many worlds on one thread of this machine's processor."""
    effort.tell("growth: worlds")
    bank = build_bank([place.colon], design, BATCH_OPTIONS)
    counts: Sequence[int] = (1, 8) if effort.quick else (1, 8, 64)
    return Table("Cost against worlds (linear time, one thread)", tuple(rate_rows(measure_rates(bank, counts))))
