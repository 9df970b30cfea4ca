"""How fast many scopes step at once: worlds against rate, compile time, memory and devices."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertions import InsertionBatch, run_insertions
from haustra.envs.runs.measure.containment import stack_widths
from haustra.envs.sim.device_backends import device_backend
from haustra.envs.sim.scope_bank import ScopeBank
from haustra.envs.sim.scope_values import Parameters
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.sim.state import Controls

Array: TypeAlias = Any
_REPEATS = 3
_STEPS = 200
"""Time steps of one timed call."""
_WARM_UP = 250
"""Control intervals of driving before anything is timed: five seconds, after which scopes lie against the wall."""


@dataclass(frozen=True)
class Rate:
    """One row: that many worlds on that many devices."""

    worlds: int
    devices: int
    steps_per_s: float
    """Physics steps of all worlds in a second; median of three calls."""
    simulated_per_s: float
    """Simulated seconds of all worlds in a second of wall clock."""
    driven_per_s: float
    """The same with the follower's decisions, observations and scores at 50 Hz."""
    compile_s: float
    """Tracing and compiling the physics."""
    first_call_s: float
    """First call after compilation."""
    memory_MB: float
    """Peak of one device since the start; 0 where the device does not say."""
    healthy: float
    """Share of worlds that did not diverge."""
    in_contact: float
    """Share of worlds that touch the wall while they are timed."""


def measure_rates(
    bank: ScopeBank,
    worlds: Sequence[int],
    *,
    backend: str = "jax",
    devices: int = 1,
    progress: Callable[[Rate], None] = lambda rate: None,
) -> list[Rate]:
    """Time the scopes of a bank in its colons, in single precision.

    Args:
        bank: a scope and colons.
        worlds: numbers of worlds to try.
        backend: of `DEVICE_BACKENDS`.
        devices: number of devices that share them.
        progress: called with each row.
    """
    dynamics = device_backend(backend).of(bank.scene)
    tables = bank.tables_on_device()
    mesh = jax.sharding.Mesh(np.array(jax.devices()[:devices]), ("worlds",))
    sharding = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("worlds"))
    rates = []
    for count in worlds:
        rates.append(_measure(bank, dynamics, tables, count, devices, sharding))
        progress(rates[-1])
    return rates


def _measure(bank: ScopeBank, backend: JaxScopes, tables: Any, count: int, devices: int, sharding: Any) -> Rate:
    colons = np.arange(count) % len(bank.names)
    parameters = _share(backend.parameters(bank.scene, count, colon=colons), count, sharding)
    follower = WorldsFollower(FollowerSettings(), bank.tip_links)
    batch = InsertionBatch(backend, follower, tables, stack_widths(bank.colons))
    state = jax.device_put(batch.begin(parameters), sharding)
    state = batch.advance(parameters, *state, count=_WARM_UP)
    worlds = jax.block_until_ready(state)[0]
    began = time.perf_counter()
    jax.block_until_ready(batch.advance(parameters, *state, count=_WARM_UP))
    driven = time.perf_counter() - began
    steady = jnp.full(count, 0.01, worlds.qpos.dtype)
    hands = jax.device_put(Controls(steady, 0 * steady, jnp.zeros((count, 4), worlds.qpos.dtype)), sharding)

    def run(parameters: Parameters, worlds: Any, hands: Controls) -> Any:
        return backend.steps(tables, parameters, worlds, hands, _STEPS)

    began = time.perf_counter()
    compiled = jax.jit(run).lower(parameters, worlds, hands).compile()
    compiling = time.perf_counter() - began
    seconds, after = [], worlds
    for _ in range(_REPEATS + 1):
        began = time.perf_counter()
        after = jax.block_until_ready(compiled(parameters, worlds, hands))
        seconds.append(time.perf_counter() - began)
    taken = float(np.median(seconds[1:]))
    memory = (jax.devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0)
    simulated = backend.timestep * _STEPS * count
    control = round(0.02 / backend.timestep) * backend.timestep
    return Rate(
        worlds=count,
        devices=devices,
        steps_per_s=_STEPS * count / taken,
        simulated_per_s=simulated / taken,
        driven_per_s=control * _WARM_UP * count / driven,
        compile_s=compiling,
        first_call_s=seconds[0],
        memory_MB=memory / 1e6,
        healthy=float(np.asarray(after.healthy).mean()),
        in_contact=float((np.asarray(after.normal).max(axis=1) > 0).mean()),
    )


def measure_insertions(bank: ScopeBank, count: int, *, seconds: float, backend: str = "jax") -> dict[str, Any]:
    """Time that many insertions from the first call to the last score, with friction from 0.03 to 0.1.

    Args:
        bank: a scope and colons, which the insertions share.
        count: how many.
        seconds: simulated time of each [s].
        backend: of `DEVICE_BACKENDS`.
    """
    colons = np.arange(count) % len(bank.names)
    began = time.perf_counter()
    friction = np.linspace(0.03, 0.1, count)
    runs = run_insertions(bank, worlds=count, seconds=seconds, backend=backend, colon=colons, friction=friction)
    taken = time.perf_counter() - began
    reach = runs.tip_arc_max / np.array(bank.lengths)[colons]
    return {
        "count": count,
        "simulated_s_each": seconds,
        "wall_clock_s": taken,
        "outcomes": dict(Counter(outcome.value for outcome in runs.outcome)),
        "reach_mean": float(reach.mean()),
        "reach_max": float(reach.max()),
        "push_force_peak_mean_N": float(runs.push_force_peak.mean()),
        "wall_force_peak_mean_N": float(runs.wall_force_peak.mean()),
    }


def _share(parameters: Parameters, count: int, sharding: Any) -> Parameters:
    """Arrays of one entry a world go to the world's device, the one design of all worlds to every device."""
    everywhere = jax.sharding.NamedSharding(sharding.mesh, jax.sharding.PartitionSpec())
    return jax.tree.map(
        lambda part: jax.device_put(part, sharding if part.ndim == 1 and len(part) == count > 1 else everywhere),
        parameters,
    )


def memory_per_world(rates: Sequence[Rate]) -> float | None:
    """Device memory that a further world takes [MB]: the slope of peaks over worlds on one device.

    None where the device does not say, or fewer than two numbers of worlds were tried.
    """
    known = [(rate.worlds, rate.memory_MB) for rate in rates if rate.devices == 1 and rate.memory_MB > 0]
    worlds, memory = np.array(known, float).reshape(-1, 2).T
    if len(set(worlds)) < 2:
        return None
    return float(np.polyfit(worlds, memory, 1)[0])


def rate_rows(rates: Sequence[Rate]) -> list[dict[str, float]]:
    """Rows as plain JSON values."""
    return [asdict(rate) for rate in rates]
