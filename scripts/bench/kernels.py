"""Rates of the programs of linear time alone on a GPU, from files that a machine without one has made.

`python -m haustra.scripts.bench.kernels pack FILE.npz [moving] [designs] [groups=1,8,32] [teams=8,16] [stages]` drives
128 scopes in on the CPU and packs their worlds with kernels for a GPU: for blocks of so many worlds each, for teams of
so many threads, each with one world, and with each stage of a step done twice, so that what the step takes longer is
that stage's time. `python -m haustra.scripts.bench.kernels
rates FILE.npz ...` repeats these worlds until a GPU is full and times launches of 40 steps, `load` only lets the driver
finish the kernels, which it keeps. Files of two versions, run in turn, tell before from after. `worlds=32768` asks for
so many worlds only, `rooms=16384` lets so many run at a time at most, `steps=4` makes launches as short, and
`registers=128,168` lets a thread have so many registers at most, where 0 leaves it as it was written. `apart` is by how
much joints' positions differ from those of the first kernel of the file after as many steps [rad, m].
"""

import json
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.sim.linear import compile as compiling
from haustra.envs.sim.linear.axis import Axis
from haustra.envs.sim.linear.cuda import DeviceArray, Kernel
from haustra.envs.sim.linear.layout import Layout
from haustra.envs.sim.linear.pack import pack_design
from haustra.envs.sim.linear.program import ScopeProgram
from haustra.scripts.bench.linear import bank_of, driven

WORLDS = (512, 1_024, 2_048, 8_192, 32_768, 131_072)
_PACKED, _STEPS, _LAUNCHES, _FULL = 128, 40, 4, 32
_BY_WORLD = "state", "worlds", "driver", "seen"
"""Arrays that hold worlds side by side, as many as a block has."""
_BY_ROW = "asked", "told"
_ORDER = (
    "state", "worlds", "seen", "room", "design", "structure", "stations", "wall", "axis", "driver", "asked", "told",
    "lookup", "widths",
)  # fmt: skip
STAGES = {
    "shape": (Axis, "shape"),
    "outwards": (ScopeProgram, "_outwards"),
    "inwards": (ScopeProgram, "_inwards"),
    "axis": (Axis, "_outwards"),
}
"""Stages of a step that may be done twice without changing it, and where they are written down."""


@contextmanager
def twice(stage: str) -> Iterator[None]:
    """Let programs that are written meanwhile do a stage two times, with the same outcome."""
    owner, name = STAGES[stage]
    once = getattr(owner, name)

    def both(*given: Any) -> Any:
        once(*given)
        return once(*given)

    setattr(owner, name, both)
    try:
        yield
    finally:
        setattr(owner, name, once)


def pack(
    path: Path, *, moving: bool, designs: bool, groups: tuple[int, ...], teams: tuple[int, ...], stages: bool
) -> None:
    """Drive scopes in for 8 s, and keep their worlds and the kernels."""
    bank = bank_of(80, mesentery=moving)
    backend, hands = driven(bank, _PACKED, seconds=8.0, real=np.float32, designs=designs)
    backend.step(hands.next(), 2)
    names = "real", "timestep", "angles", "one_design", "moving"
    about = {name: backend._program[name] for name in names} | {"driver": backend._program["driver"]}
    write = compiling.write_kernel.__wrapped__
    kept: dict[str, Any] = {}
    for group in groups:
        kept[f"kernel {group}"] = _bytes_of(write(group=group, **about))
    for stage in STAGES if stages else ():
        if moving or STAGES[stage][0] is ScopeProgram:
            with twice(stage):
                kept[f"kernel {_FULL} {stage}"] = _bytes_of(write(group=_FULL, **about))
    by_world = (*_BY_WORLD, "design") if designs else _BY_WORLD
    for name, held in backend._held.items():
        values = held.read()
        if name in by_world:
            values = np.swapaxes(values, 1, 2).reshape(-1, values.shape[1])
        kept[name] = values[:, :1] if name in _BY_ROW else values
    layout = replace(backend._layout, by_turns=True)
    for team in teams:
        kept[f"kernel team-{team}"] = _bytes_of(write(group=1, abreast=team, **about))
        own = replace(layout, abreast=team, by_turns=False)
        kept[f"slots team-{team}"] = own.padded(own.room)
        kept[f"state team-{team}"] = _side_by_side(kept["state"], layout, own)
        packed = pack_design(backend._scope, backend._chain, own).astype(np.float32)
        kept[f"design team-{team}"] = packed if designs else packed[0]
    counts = [layout.dofs, layout.bodies, layout.spheres, layout.nodes, backend._places]
    np.savez_compressed(path, **kept, counts=np.array(counts), slots=layout.room, by_world=by_world)


def _side_by_side(states: np.ndarray, plain: Layout, own: Layout) -> np.ndarray:
    """States of worlds as a team has them."""
    found = np.zeros((len(states), own.state), np.float32)
    found[:, : own.axis] = states[:, : own.axis]
    own.axes(found)[:] = plain.axes(states)
    return found


def _bytes_of(text: str) -> np.ndarray:
    return np.frombuffer(compiling.assembled(text, architecture="sm_90").encode(), np.uint8)


def rates(path: Path, counts: tuple[int, ...], rooms: int, steps: int, registers: int = 0) -> Iterator[dict[str, Any]]:
    """Steps a second of packed kernels at each of these numbers of worlds that fits, in so many rooms at most.

    Args:
        path: of what was packed.
        counts: of worlds.
        rooms: to work in, at most.
        steps: of a launch.
        registers: of a thread, at most; as it was written when 0.
    """
    with np.load(path) as kept:
        packed = dict(kept)
    first: dict[int, np.ndarray] = {}
    for name in [each for each in packed if each.startswith("kernel ")]:
        kernel, (_, kind, *stage) = _kernel(packed[name], registers), name.split()
        team = int(kind.removeprefix("team-")) if kind.startswith("team-") else 1
        group = 1 if team > 1 else int(kind)
        own = packed | {each: packed[f"{each} {kind}"] for each in ("slots", "state", "design") if team > 1}
        for worlds in counts:
            # Few worlds are not stepped by full warps, nor many by single threads; stages are those of a full GPU.
            if worlds // group > 8_192 or (stage and worlds != 32_768):
                continue
            rate, joints = _rate(own, kernel, (worlds, rooms, steps), (group, team))
            apart = float(np.abs(joints - first.setdefault(worlds, joints)).max())
            about = {"file": path.name, "group": group, "team": team, "twice": stage, "steps": steps}
            yield about | {"registers": registers, "apart": apart} | rate


def _kernel(text: np.ndarray, registers: int) -> Kernel:
    """What was packed, finished by the driver, with so many registers a thread at most."""
    written = text.tobytes().decode()
    if registers:
        written = re.sub(r"\n\)\n(\.maxnreg \d+\n)?\{\n", f"\n)\n.maxnreg {registers}\n{{\n", written, count=1)
    return Kernel(written, "advance")


def _rate(
    packed: dict[str, np.ndarray], kernel: Kernel, counts: tuple[int, int, int], threads: tuple[int, int]
) -> tuple[dict[str, Any], np.ndarray]:
    (worlds, rooms, steps), (group, team) = counts, threads
    size = max(group, team)
    groups = min(worlds // group, kernel.resident(size), rooms // group)
    room = DeviceArray(np.zeros((groups, int(packed["slots"]), group), np.float32))
    held = {name: _spread(packed, name, worlds, group) for name in _ORDER if name in packed}
    arrays = {name: (held | {"room": room})[name] for name in _ORDER}
    given, least = list(arrays.values()), np.inf
    for launch in range(1 + _LAUNCHES):
        began = time.perf_counter()
        kernel(given, [*map(int, packed["counts"]), steps, worlds, 0, worlds], groups=groups, group=size)
        kernel.wait()
        least = min(least, time.perf_counter() - began) if launch else least
    state = arrays["state"].get(_PACKED // group)
    joints = np.swapaxes(state[:, : int(packed["counts"][0])], 1, 2).reshape(_PACKED, -1)
    size = 4e-3 * (packed["state"].shape[1] + int(packed["slots"]) * groups * group / worlds)
    found = {
        "worlds": worlds,
        "million_steps_per_s": worlds * steps / least / 1e6,
        "kB": size,
        "at_once": groups * group,
        "sound": bool(np.isfinite(state).all()),
    }
    return found, joints


def _spread(packed: dict[str, np.ndarray], name: str, worlds: int, group: int) -> DeviceArray:
    """An array of so many worlds, the packed ones over and over."""
    values = packed[name]
    if name in packed["by_world"]:
        blocks = np.swapaxes(values.reshape(-1, group, values.shape[1]), 1, 2)
        return DeviceArray(np.tile(blocks, (worlds // len(values), 1, 1)))
    return DeviceArray(np.zeros((len(values), worlds), np.float32) if name in _BY_ROW else values)


def _main(verb: str, *given: str) -> None:
    def named(name: str, *usual: int) -> tuple[int, ...]:
        found = [each.removeprefix(f"{name}=") for each in given if each.startswith(f"{name}=")]
        return tuple(map(int, found[0].split(","))) if found else usual

    if verb == "pack":
        about = {name: name in given for name in ("moving", "designs", "stages")}
        pack(Path(given[0]), groups=named("groups", _FULL), teams=named("teams"), **about)
        return
    counts, (rooms,), (steps,) = named("worlds", *WORLDS), named("rooms", max(WORLDS)), named("steps", _STEPS)
    for path, most in product((each for each in given if "=" not in each), named("registers", 0)):
        if verb == "load":
            with np.load(path) as kept:
                for name in (each for each in kept if each.startswith("kernel ")):
                    _kernel(kept[name], most)
            continue
        for row in rates(Path(path), counts, rooms, steps, most):
            sys.stdout.write(json.dumps(row) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    _main(*sys.argv[1:])
