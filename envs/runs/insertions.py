"""Many insertions at once on MuJoCo Warp: scopes driven into colons by the lumen follower, scored as they go."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.containment import LumenWidths, most_skipped, outside, stack_widths
from haustra.envs.runs.measure.load import largest_load, largest_pain
from haustra.envs.runs.outcome import ending, given_up
from haustra.envs.runs.tally import Insertions, Measured, Tally, counted
from haustra.envs.sim.device_arrays import tree_where
from haustra.envs.sim.precision import precise
from haustra.envs.sim.scope_colon_set import ScopeColonSet
from haustra.envs.sim.scope_values import Parameters, State
from haustra.envs.sim.state import Readings
from haustra.envs.sim.warp_setup import use_warp
from haustra.models.wall import moving_colon
from haustra.models.wall.lumen_table import Tables, pick

if TYPE_CHECKING:
    from haustra.envs.sim.warp_scopes import WarpScopes

Array: TypeAlias = Any
_CHUNK = 50
"""Control intervals in one call: a second of simulated time between two reports of progress."""


class InsertionBatch:
    """One scope, stacked colons, many worlds: compiled once, run as often as wanted."""

    def __init__(self, backend: "WarpScopes", follower: WorldsFollower, tables: Tables, widths: LumenWidths) -> None:
        """Prepare; nothing is compiled before the first run.

        Args:
            backend: the scope.
            follower: who drives.
            tables: of all colons (`stack`), seen from their entries.
            widths: of the same colons (`stack_widths`).
        """
        self._backend, self._follower, self._tables = backend, follower, tables
        self._widths = LumenWidths(*(jnp.asarray(part, tables.points.dtype) for part in widths))
        self._steps = max(1, round(CONTROL_INTERVAL / backend.timestep))
        self.advance = jax.jit(self._advance, static_argnames="count")

    def begin(self, parameters: Parameters) -> tuple[State, Any, Tally]:
        """All scopes at the start, nothing scored."""
        worlds = len(parameters.friction)
        zero = jnp.zeros_like(parameters.friction)
        none = jnp.zeros(worlds, jnp.int32)
        start = zero + parameters.scope.start
        scores = dict.fromkeys(Tally._fields, zero) | {"tip_arc_max": start, "intervals": none, "ended": none}
        tally = Tally(**scores)
        return self._backend.begin(parameters, self._tables), self._follower.begin(worlds, zero.dtype), tally

    def run(
        self, parameters: Parameters, *, seconds: float, progress: Callable[[float], None] = lambda time: None
    ) -> Insertions:
        """Drive all worlds for up to `seconds` of simulated time; `progress` is told the time [s]."""
        worlds, drive, tally = self.begin(parameters)
        intervals = round(seconds / (self._steps * self._backend.timestep))
        for first in range(0, intervals, _CHUNK):
            count = min(_CHUNK, intervals - first)
            worlds, drive, tally = self.advance(parameters, worlds, drive, tally, count=count)
            over = np.asarray((tally.ended > 0) | ~worlds.healthy)
            progress((first + count) * self._steps * self._backend.timestep)
            if over.all():
                break
        return self._finish(parameters, worlds, drive, tally)

    def _advance(self, parameters: Parameters, worlds: State, drive: Any, tally: Tally, *, count: int):
        tables = pick(self._tables, parameters.colon)
        widths = LumenWidths(*(part[parameters.colon] for part in self._widths))
        interval = self._steps * self._backend.timestep

        def one(_: Any, now: tuple[State, Any, Tally]) -> tuple[State, Any, Tally]:
            worlds, drive, tally = now
            seen = self._backend.read(parameters, self._tables, worlds)
            hands, decided = self._follower.act(parameters, tables, seen, worlds.time, drive, interval=interval)
            stepped = self._backend.steps(self._tables, parameters, worlds, hands, self._steps)
            # A world that has ended stays as it is, as a single run would.
            running = (tally.ended == 0) & stepped.healthy
            worlds = tree_where(running, stepped, worlds)._replace(healthy=stepped.healthy)
            drive = tree_where(running, decided, drive)
            after = self._backend.read(parameters, self._tables, worlds)
            ended = self._ended(parameters, tables, widths, worlds, after)
            ended = given_up(jnp, ended, self._follower.gives_up(drive))
            hand, harm = (after.push_force, after.torque), self._harm(parameters, tables, widths, after)
            measured = Measured(after.tip_arc, after.insertion, *hand, after.link_forces.max(axis=1), *harm)
            return worlds, drive, tree_where(running, counted(jnp, tally, measured, ended), tally)

        return jax.lax.fori_loop(0, count, one, (worlds, drive, tally))

    def _harm(self, parameters: Parameters, tables: Tables, widths: LumenWidths, seen: Readings) -> tuple:
        """Largest load over strength, and worst pain, and where each is."""
        scope, own = parameters.scope, tables.mesentery
        diameter, tip = 2 * scope.radius, scope.tip_place[:, :1, 2]
        lengths = jnp.concatenate([scope.links.offset[:, 1:, 2], tip], axis=1)
        load = largest_load(jnp, seen, tip_links=len(self._backend.bend_dofs[0]), diameter=diameter, lengths=lengths)
        if own is None:
            return *load, *largest_pain(jnp, seen, diameter=diameter, lengths=lengths)
        arcs = own.spacing[:, None] * np.arange(own.nodes.shape[1])
        radius = jax.vmap(jnp.interp)(arcs, widths.arcs, widths.width)
        return *load, *largest_pain(jnp, seen, diameter=diameter, lengths=lengths, own=own, radius=radius)

    @precise
    def _ended(
        self, parameters: Parameters, tables: Tables, widths: LumenWidths, worlds: State, seen: Readings
    ) -> Array:
        """Which runs end now, and why; tables and widths are those of each world."""
        scope, behind = parameters.scope, self._backend.behind(parameters)
        apart = outside(
            jnp,
            widths,
            moving_colon.axis_at(jnp, tables, seen.displacement, widths.arcs),
            self._backend.shape(parameters, worlds),
            behind=behind,
            inside=behind < seen.insertion[:, None],
            tip_arc=seen.tip_arc,
            radius=scope.radius,
            moves=seen.displacement is not None,
        )
        moves, inside = seen.displacement is not None, behind < seen.insertion[:, None]
        return ending(
            jnp,
            outside=apart,
            skipped=most_skipped(jnp, seen.link_arcs, behind, inside) if moves else jnp.zeros_like(apart),
            arc=seen.tip_arc,
            length=(tables.step * (tables.count - 1))[:, 0].astype(worlds.qpos.dtype),
            insertion=seen.insertion,
            modelled=scope.length,
        ).astype(jnp.int32)

    def _finish(self, parameters: Parameters, worlds: State, drive: Any, tally: Tally) -> Insertions:
        return Insertions.of(
            tally,
            healthy=np.asarray(worlds.healthy),
            attempts=np.asarray(drive.attempts),
            simulated=np.asarray(worlds.time),
            insertion=np.asarray(parameters.scope.start + worlds.qpos[:, 0]),
        )


def run_insertions(
    bank: ScopeColonSet,
    *,
    worlds: int,
    seconds: float,
    settings: Any = None,
    progress: Callable[[float], None] = lambda time: None,
    **changed: Any,
) -> Insertions:
    """Drive that many scopes of a bank for up to `seconds` of simulated time, in single precision.

    Args:
        bank: a scope and colons.
        worlds: how many.
        seconds: [s].
        settings: of the driver (`haustra.envs.control.follower.Law`), by default the lumen follower's.
        progress: told the simulated time [s].
        changed: what differs from the bank's scene: entries of `Parameters`, one number or one a world.

    Raises:
        InvalidOptionError: when something that cannot differ is to.
        MissingDependencyError: when Warp is not installed.
        UnsupportedSceneError: when the scope has what this backend cannot honour.
    """
    use_warp()  # first: without Warp, MJX says so on stdout
    from haustra.envs.sim.warp_scopes import WarpScopes

    dynamics = WarpScopes.of(bank.scene)
    follower = WorldsFollower(settings or FollowerSettings(), bank.tip_links)
    batch = InsertionBatch(dynamics, follower, bank.tables_on_device(), stack_widths(bank.colons))
    parameters = dynamics.parameters(bank.scene, worlds, **changed)
    return batch.run(parameters, seconds=seconds, progress=progress)
