"""Many insertions at once in linear time: scopes driven into colons by the lumen follower, on a CPU or a GPU."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.insertion_program import InsertionProgram, Sees
from haustra.envs.runs.measure.containment import lumen_widths, station_widths
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.gas import INTERVAL
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.scope_values import Scope
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import Tables

_CHUNK = 50
"""Control intervals in one call: a second of simulated time between two reports of progress."""


@runtime_checkable
class Hand(Protocol):
    """Who decides outside the program, through hands that hold what they are told (`HeldHand`)."""

    @property
    def every(self) -> int:
        """Control intervals between two decisions; nothing moves before the first."""
        ...

    def __call__(self) -> None:
        """Tell all hands what to do until the next decision."""
        ...


class LinearInsertions:
    """Scopes of one kind in stacked colons, compiled once, run as often as wanted."""

    def __init__(
        self,
        scene: Scene,
        tables: Tables,
        colons: Sequence[Colon],
        *,
        worlds: int,
        settings: Any,
        threads: int = 1,
        device: Literal["cpu", "cuda"] = "cpu",
        real: type = np.float32,
        scopes: Scope | None = None,
        sees: Sees | None = None,
        lookup: Float[np.ndarray, " numbers"] | None = None,
    ) -> None:
        """Compile, or read what was compiled before.

        Args:
            scene: scope and options, built with wall_law "table" for any of the colons.
            tables: the colons, seen from their entries and stacked.
            colons: the same colons.
            worlds: how many.
            settings: of the driver, or a sequence of each world's, which all are of one kind, straighten or do not, and
                steer alike.
            threads: of a CPU.
            device: threads of the CPU, or the first NVIDIA GPU.
            real: precision.
            scopes: one design a world, as `LinearBackend`.
            sees: what is looked for after every launch, for a hand outside the program.
            lookup: what that takes, as `LinearBackend`.

        Raises:
            InvalidDesignError: when wheels steer wires that do not stretch.
            InvalidOptionError: when followers are too unlike for one batch, or designs do not fit.
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        each = list(settings) if isinstance(settings, Sequence) else [settings] * worlds
        if len({(type(one), one.straighten, one.steer) for one in each}) > 1:
            raise InvalidOptionError(
                "Drivers of one batch are of one kind, all straighten, or none does, and steer alike: make two batches."
            )
        self._kept: Float[np.ndarray, "worlds slots"] | None = None
        self._settings, self._start = each, scene.options.start_depth if scopes is None else scopes.start
        self._steps = max(1, round(CONTROL_INTERVAL / scene.options.timestep))
        self.interval = self._steps * scene.options.timestep
        self.program = program = InsertionProgram(
            law=each[0].law(),
            straighten=each[0].straighten,
            wheels=each[0].steer == "wheels",
            moves=tables.mesentery is not None,
            steps=self._steps,
            interval=self.interval,
            longest=float(np.ceil((tables.step * (tables.count - 1)).max())),  # whole metres: few programs
            sees=sees,
        )
        arrangement: dict[str, Any] = {"threads": threads, "device": device, "real": real, "scopes": scopes}
        arrangement |= {"wheels": program.wheels}
        self.backend = LinearBackend(
            scene,
            tables,
            worlds=worlds,
            driver=program,
            width=station_widths(tables, map(lumen_widths, colons)),
            lookup=lookup,
            colons=colons,
            **arrangement,
        )

    def begin(
        self, case: Int[np.ndarray, " worlds"], conditions: Conditions, given: Mapping[str, Any] | None = None
    ) -> None:
        """Lay all scopes at the start of their colons, nothing scored.

        Args:
            case: which colon each world has.
            conditions: of each world.
            given: more numbers of worlds, by the names of `haustra.envs.sim.linear.layout.WORLD`; `gravity` in each
                colon's own frame (worlds, 3) [m/s^2].
        """
        backend, worlds = self.backend, np.arange(self.backend.worlds)
        backend.reset(worlds, case, conditions)
        for name, values in (given or {}).items():
            backend.load(values) if name == "gravity" else backend.give(name, values)
        backend.tell_driver(0, self.program.numbers_of(self._settings, self._start))
        self._kept = None

    def run(
        self,
        *,
        seconds: float,
        progress: Callable[[float], None] = lambda time: None,
        watch: Callable[[], None] = lambda: None,
        every: int = _CHUNK,
        hand: Hand | None = None,
    ) -> Insertions:
        """Drive all worlds for up to `seconds` of simulated time.

        Args:
            seconds: [s].
            progress: told the time now and then [s].
            watch: called after every `every` control intervals.
            every: control intervals between two calls of it.
            hand: decides where the settings hold what they are told.
        """
        intervals = round(seconds / self.interval)
        for first in range(0, intervals, every):
            count = min(every, intervals - first)
            self._drive(first, first + count, hand)
            watch()
            progress((first + count) * self.interval)
            tally = self.program.tally_of(self.driver_numbers())
            if ((tally.ended > 0) | ~self.backend.alive).all():
                break
        seen, numbers, gas = self.backend.read(), self.driver_numbers(), self.backend.gas
        return Insertions.of(
            self.program.tally_of(numbers),
            healthy=self.backend.alive,
            attempts=self.program.memory_of(numbers).attempts,
            simulated=seen.time,
            insertion=seen.insertion,
            gas=gas and (gas.pressure_peak, gas.volume),
        )

    def told(self) -> Float[np.ndarray, "rows worlds"]:
        """Numbers told after the last launch: `haustra.envs.runs.insertion_program.TOLD`, then what is seen."""
        return self.backend.told(self.program.tells)[:, : self.backend.worlds].copy()

    def driver_numbers(self) -> Float[np.ndarray, "worlds slots"]:
        """What the drivers keep of each world, read once after every launch."""
        if self._kept is None:
            self._kept = self.backend.driver_numbers()
        return self._kept

    def _drive(self, first: int, last: int, hand: Hand | None) -> None:
        """From one control interval to another, stopping where it is a hand's turn, or gas moves."""
        turns = [] if hand is None else [hand.every]
        if self.backend.gas is not None:
            turns.append(max(1, round(INTERVAL / self.interval)))
        while first < last:
            count = min([last - first, *(turn - first % turn for turn in turns)])
            self.backend.drive(count)
            self._kept = None
            first += count
            if hand is not None and first % hand.every == 0:
                hand()
