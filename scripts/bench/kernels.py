"""Rates of the programs of linear time alone on a GPU, from files that a machine without one has made.

`python -m haustra.scripts.bench.kernels pack FILE.npz [moving] [designs] [groups=1,8,32] [stages]` drives 128 scopes in
on the CPU and packs their worlds with kernels for a GPU: for blocks of so many worlds each, and with each stage of a
step done twice, so that what the step takes longer is that stage's time. `python -m haustra.scripts.bench.kernels
rates FILE.npz ...` repeats these worlds until a GPU is full and times launches of 40 steps, `load` only lets the driver
finish the kernels, which it keeps. Files of two versions, run in turn, tell before from after. `worlds=32768` asks for
so many worlds only, `rooms=16384` lets so many run at a time at most, `steps=4` makes launches as short, and
`registers=128,168` lets a thread have so many registers at most, where 0 leaves it as it was written.
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


def pack(path: Path, *, moving: bool, designs: bool, groups: tuple[int, ...], stages: bool) -> None:
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
    counts = [layout.dofs, layout.bodies, layout.spheres, layout.nodes, backend._places]
    np.savez_compressed(path, **kept, counts=np.array(counts), slots=layout.room, by_world=by_world)


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
    for name in [each for each in packed if each.startswith("kernel ")]:
        kernel, (_, group, *stage) = _kernel(packed[name], registers), name.split()
        for worlds in counts:
            # Few worlds are not stepped by full warps, nor many by single threads; stages are those of a full GPU.
            if worlds // int(group) > 8_192 or (stage and worlds != 32_768):
                continue
            rate = _rate(packed, kernel, (worlds, rooms, steps), int(group))
            about = {"file": path.name, "group": int(group), "twice": stage, "steps": steps, "registers": registers}
            yield about | rate


def _kernel(text: np.ndarray, registers: int) -> Kernel:
    """What was packed, finished by the driver, with so many registers a thread at most."""
    written = text.tobytes().decode()
    if registers:
        written = re.sub(r"\n\)\n(\.maxnreg \d+\n)?\{\n", f"\n)\n.maxnreg {registers}\n{{\n", written, count=1)
    return Kernel(written, "advance")


def _rate(packed: dict[str, np.ndarray], kernel: Kernel, counts: tuple[int, int, int], group: int) -> dict[str, Any]:
    worlds, rooms, steps = counts
    groups = min(worlds // group, kernel.resident(group), rooms // group)
    room = DeviceArray(np.zeros((groups, int(packed["slots"]), group), np.float32))
    held = {name: _spread(packed, name, worlds, group) for name in _ORDER if name in packed}
    arrays = {name: (held | {"room": room})[name] for name in _ORDER}
    given, least = list(arrays.values()), np.inf
    for launch in range(1 + _LAUNCHES):
        began = time.perf_counter()
        kernel(given, [*map(int, packed["counts"]), steps, worlds, 0, worlds], groups=groups, group=group)
        kernel.wait()
        least = min(least, time.perf_counter() - began) if launch else least
    sound = bool(np.isfinite(arrays["state"].get(_PACKED // group)).all())
    size = 4e-3 * (packed["state"].shape[1] + int(packed["slots"]) * groups * group / worlds)
    return {
        "worlds": worlds,
        "million_steps_per_s": worlds * steps / least / 1e6,
        "kB": size,
        "at_once": groups * group,
        "sound": sound,
    }


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
        pack(Path(given[0]), groups=named("groups", _FULL), **about)
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
