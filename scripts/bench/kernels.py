"""Rates of the programs of linear time alone on a GPU, from files that a machine without one has made.

`python -m haustra.scripts.bench.kernels pack FILE.npz [moving]` drives 128 scopes in on the CPU and packs their worlds
with the kernel for a GPU; `python -m haustra.scripts.bench.kernels rates FILE.npz ...` repeats these worlds until a
GPU is full and times launches of 40 steps. Files of two versions, run in turn, tell before from after.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.sim.linear.compile import assembled, write_kernel
from haustra.envs.sim.linear.cuda import DeviceArray, Kernel
from haustra.scripts.bench.linear import bank_of, driven

WORLDS = (1_024, 8_192, 32_768, 131_072)
_PACKED, _THREADS, _STEPS, _LAUNCHES = 128, 32, 40, 4
_BY_WORLD = "state", "worlds", "driver", "seen"
"""Arrays that hold worlds side by side, eight on a CPU and a group of threads on a GPU."""
_BY_ROW = "asked", "told"
_ORDER = (
    "state", "worlds", "seen", "room", "design", "structure", "stations", "wall", "axis", "driver", "asked", "told",
    "lookup",
)  # fmt: skip
_MEMORY = 60e9
"""Room that is taken at most [bytes]."""


def pack(path: Path, *, moving: bool) -> None:
    """Drive scopes in for 8 s, and keep their worlds and the kernel."""
    backend, hands = driven(bank_of(80, mesentery=moving), _PACKED, seconds=8.0, real=np.float32)
    backend.step(hands.next(), 2)
    of_kernel = {name: backend._program[name] for name in ("real", "timestep", "angles", "one_design", "moving")}
    text = assembled(write_kernel(**of_kernel, driver=backend._program["driver"]), architecture="sm_90")
    arrays = {}
    for name, held in backend._held.items():
        values = held.read()
        if name in _BY_WORLD:
            side = _THREADS // values.shape[2]
            groups = values.reshape(len(values) // side, side, values.shape[1], values.shape[2])
            values = groups.transpose(0, 2, 1, 3).reshape(len(groups), values.shape[1], _THREADS)
        arrays[name] = values[:, :1] if name in _BY_ROW else values
    layout = backend._layout
    counts = [layout.dofs, layout.bodies, layout.spheres, layout.nodes, backend._places]
    kernel = np.frombuffer(text.encode(), np.uint8)
    np.savez_compressed(path, **arrays, counts=np.array(counts), slots=layout.room, kernel=kernel)


def rates(path: Path) -> list[dict[str, Any]]:
    """Steps a second of a packed kernel at each number of worlds that fits."""
    with np.load(path) as kept:
        packed = dict(kept)
    kernel, slots = Kernel(packed["kernel"].tobytes().decode(), "advance"), int(packed["slots"])
    rows = []
    for worlds in (each for each in WORLDS if each * slots * 4 < _MEMORY):
        arrays = {name: _spread(packed, name, worlds, slots) for name in _ORDER}
        given = [arrays[name] for name in _ORDER]
        least = np.inf
        for launch in range(1 + _LAUNCHES):
            began = time.perf_counter()
            kernel(given, [*map(int, packed["counts"]), _STEPS, worlds, 0, worlds], threads=worlds, group=_THREADS)
            kernel.wait()
            least = min(least, time.perf_counter() - began) if launch else least
        sound = bool(np.isfinite(arrays["state"].get(len(packed["state"]))).all())
        size = 4e-3 * (packed["state"].shape[1] + slots)
        million = worlds * _STEPS / least / 1e6
        rows.append({"file": path.name, "worlds": worlds, "million_steps_per_s": million, "kB": size, "sound": sound})
    return rows


def _spread(packed: dict[str, np.ndarray], name: str, worlds: int, slots: int) -> DeviceArray:
    """An array of so many worlds, the packed ones over and over."""
    if name == "room":
        return DeviceArray(np.zeros((worlds // _THREADS, slots, _THREADS), np.float32))
    values = packed[name]
    if name in _BY_WORLD:
        return DeviceArray(np.tile(values, (worlds // _THREADS // len(values), 1, 1)))
    return DeviceArray(np.zeros((len(values), worlds), np.float32) if name in _BY_ROW else values)


if __name__ == "__main__":
    if sys.argv[1] == "pack":
        pack(Path(sys.argv[2]), moving="moving" in sys.argv[3:])
    else:
        for name in sys.argv[2:]:
            for row in rates(Path(name)):
                print(json.dumps(row), flush=True)
