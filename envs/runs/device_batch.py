"""Runs of one device in many colons at once, natively: what its own driver makes of each."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from haustra.envs.runs.device_run import HEADWAY, PATIENCE, Records, ended, time_is_up
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.device_burden import DeviceMeter
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import build_device_scene, device_tables, pose_in
from haustra.models.devices.base import Device
from haustra.models.scene import SceneOptions


def run_devices(
    device: Device,
    colons: Sequence[Colon],
    options: SceneOptions,
    *,
    seconds: float,
    starts: Sequence[float] | None = None,
    patience: float = PATIENCE,
) -> list[tuple[Outcome, Records]]:
    """Let a device's own driver drive it in each colon for up to `seconds`, as `run_device` does in one.

    Args:
        device: the device.
        colons: where.
        options: of all scenes.
        seconds: simulated time [s].
        starts: distance of the tip from the anus at first in each colon [m]; that of the options when None.
        patience: a run that comes no further for so long is stuck, and ends [s].

    Raises:
        InvalidDesignError: when the device does not fit where it is to begin.
        UnsupportedSceneError: naming what the device or its scene does not honour.
    """
    if options.gas is not None:
        raise UnsupportedSceneError("Many runs at once do not honour the option gas: run them one by one.")
    count = len(colons)
    each = [replace(options, start_depth=start) for start in starts] if starts else [options] * count
    poses = [pose_in(colon, device, one) for colon, one in zip(colons, each, strict=True)]
    scene = build_device_scene(device, options)
    tables = device_tables(scene, list(colons), poses)
    backend = NativeDevice(scene, tables, worlds=count, starts=[pose.arc for pose in poses])
    backend.reset(
        np.arange(count),
        np.arange(count),
        friction=np.full(count, float(options.friction)),
        wall_stiffness=np.full(count, float(options.wall_stiffness)),
    )
    meter = DeviceMeter(scene, colons[0])  # patches of wall are the device's, whatever colon it is in
    steps = max(1, round(CONTROL_INTERVAL / options.timestep))
    rows: list[list[dict[str, Any]]] = [[] for _ in range(count)]
    outcomes: list[Outcome | None] = [None] * count
    furthest, since, memory = np.full(count, -np.inf), np.zeros(count), np.zeros(count)
    seen = backend.read()
    for _ in range(round(seconds / (steps * options.timestep))):
        commands, memory = device.drive(np, seen, memory)
        healthy = backend.step(commands, steps)
        seen, own = backend.read(), backend.readings()
        told = {name: getattr(seen, name) for name in ("time", "tip", "tip_arc", "wall_force", "deepest")} | own
        forces = backend.body_forces()
        told |= {"wall_force_sum": forces.sum(axis=1), "wall_pressure": meter.pressure(forces)}
        for world in [number for number, outcome in enumerate(outcomes) if outcome is None]:
            if not healthy[world]:
                outcomes[world] = Outcome.DIVERGED
                continue
            row = {name: values[world] for name, values in told.items()}
            rows[world].append(row)
            outcomes[world] = ended(row, colons[world].centreline.length)
            if row["tip_arc"] > furthest[world] + HEADWAY:
                furthest[world], since[world] = row["tip_arc"], row["time"]
            if outcomes[world] is None and row["time"] - since[world] > patience:
                outcomes[world] = Outcome.STUCK
        backend.healthy &= np.array([outcome is None for outcome in outcomes])  # what has ended costs nothing
        if not backend.healthy.any():
            break
    records = [{name: np.array([row[name] for row in own]) for name in own[0]} if own else {} for own in rows]
    return [(outcome or time_is_up(kept), kept) for outcome, kept in zip(outcomes, records, strict=True)]
