"""One insertion in linear time: the follower and the scope step within one program, and each decision leaves a row."""

import time
from typing import Any

import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import CONTROL_INTERVAL, Insertion, Progress, Trajectory
from haustra.envs.runs.insertion_program import InsertionProgram
from haustra.envs.runs.measure.containment import lumen_widths, station_widths
from haustra.envs.runs.measure.injury import InjuryMeter
from haustra.envs.runs.outcome import outcome_of
from haustra.envs.sim.gas import gas_pressures
from haustra.envs.sim.linear.backend import Row
from haustra.envs.sim.linear.layout import WORLD
from haustra.envs.sim.linear.single import LinearSingle
from haustra.models.scene import Scene, entry_of
from haustra.models.wall.lumen_table import Tables, lumen_table, stack
from haustra.models.wall.moving_colon import POSE

_ALIVE = WORLD.index("alive")


def run_linear_insertion(
    scene: Scene,
    *,
    seconds: float,
    settings: Any = None,
    progress: Progress | None = None,
) -> Insertion:
    """`haustra.envs.runs.insertion.run_insertion` on the backend 'linear'.

    The tip's arc length is the one that the wall's table is looked up at, where the native backend takes the nearest
    station of the centreline.

    Raises:
        InvalidDesignError: when wheels steer wires that do not stretch.
        UnsupportedSceneError: when the backend cannot honour the scene.
    """
    settings = settings or FollowerSettings()
    table = lumen_table(
        scene.colon,
        device_radius=scene.cable.radius,
        with_mesentery=scene.options.mesentery,
        abdomen=scene.options.abdomen,
    )
    tables = stack([table.seen_from(*entry_of(scene.colon))])
    backend, program = driven_scope(
        scene, tables, settings, steps=max(1, round(CONTROL_INTERVAL / scene.options.timestep))
    )
    interval = program.interval
    most = max(0, round(seconds / interval))
    record, done, healthy, ended = backend.many.record(), 0, True, 0
    ending, furthest = program.slot_of("ended"), program.slot_of("tip_arc_max")
    began = time.perf_counter()
    while done < most and not ended:
        backend.many.drive(1)
        row = record.note()
        healthy = row.worlds[_ALIVE] > 0
        if not healthy:
            break
        ended = int(row.driver[ending])
        done += 1
        if progress and done % 25 == 0:
            progress(done * interval, float(row.driver[furthest]))
    recorded = _trajectory(backend, program, record.rows(done)) if done else _nothing(backend, program)
    now = backend.rows()
    attempts = int(program.memory_of(now.driver).attempts[0])
    return Insertion(
        outcome=outcome_of(ended, healthy=bool(healthy), attempts=attempts),
        trajectory=recorded,
        shape=backend.shape(),
        tip_frame=backend.readings(now).tip_frame[0],
        wall_clock=time.perf_counter() - began,
        attempts=attempts,
        settings=settings,
        colon=backend.colon(),
        backend=backend.name,
        gas=backend.gas and backend.gas.record(done),
    )


def driven_scope(scene: Scene, tables: Tables, settings: Any, *, steps: int) -> tuple[LinearSingle, InsertionProgram]:
    """A scope that is driven within its program, and what drives it: `many.drive(count)` decides `count` times.

    Args:
        scene: the scene.
        tables: the colon's, seen from its entry and stacked.
        settings: of the driver (`haustra.envs.control.follower.Law`).
        steps: time steps between two decisions.

    Raises:
        InvalidDesignError: when wheels steer wires that do not stretch.
        UnsupportedSceneError: when the backend cannot honour the scene.
    """
    program = InsertionProgram(
        law=settings.law(),
        straighten=settings.straighten,
        wheels=settings.steer == "wheels",
        moves=scene.options.mesentery,
        steps=steps,
        interval=steps * scene.options.timestep,
        longest=float(np.ceil(tables.step[0] * (tables.count[0] - 1))),
        measures_outside=True,
    )
    width = station_widths(tables, [lumen_widths(scene.colon)])
    backend = LinearSingle(scene, driver=program, tables=tables, width=width, wheels=program.wheels)
    backend.many.tell_driver(0, program.numbers_of([settings], scene.options.start_depth))
    return backend, program


def _trajectory(backend: LinearSingle, program: InsertionProgram, rows: Row) -> Trajectory:
    """Everything that rows hold."""
    scene, seen, memory = backend.scene, backend.readings(rows), program.memory_of(rows.driver)
    worst = seen.link_forces.argmax(axis=1)
    normals = backend.many.normals(rows.state)
    begun = np.concatenate([[scene.options.start_depth], seen.insertion[:-1]])
    places, turns = backend.poses(rows, scene.blocks)
    injury = InjuryMeter(scene)
    burden = injury.measure(seen, gas_pressures(backend.gas, len(rows.state), injury.stations))
    return Trajectory(
        time=seen.time,
        qpos=backend.many.joints(rows.state),
        ctrl=backend.controls(rows, begun),
        tip=seen.tip,
        insertion=seen.insertion,
        tip_arc=seen.tip_arc,
        push_force=seen.push_force,
        torque=seen.torque,
        wall_force=seen.link_forces.max(axis=1),
        wall_force_link=scene.cable.node_distances[worst],
        contacts=(normals > 0).sum(axis=1).astype(float),
        scope_energy=backend.bending_energy(rows),
        wall_energy=backend.wall_energy(rows),
        outside=program.outside_of(rows.driver),
        asked_up=memory.bend_up,
        asked_left=memory.bend_left,
        bend_up=seen.bend[:, 0],
        bend_left=seen.bend[:, 1],
        colon_moved=backend.colon_moved(rows),
        wall_force_sum=normals.sum(axis=1),
        coils=seen.coils,
        **burden._asdict(),
        displacement=seen.displacement if scene.options.mesentery else np.zeros((len(seen.time), 0, POSE)),
        mocap_pos=places,
        mocap_quat=turns,
    )


def _nothing(backend: LinearSingle, program: InsertionProgram) -> Trajectory:
    """Trajectory without records, of a run that diverged at once."""
    one = _trajectory(backend, program, backend.rows())
    return Trajectory(**{name: values[:0] for name, values in vars(one).items()})
