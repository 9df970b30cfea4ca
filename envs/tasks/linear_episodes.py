"""Episodes in linear time: a whole control step of all worlds in one launch of one program, on a CPU or a GPU."""

import math
from typing import final

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.runs.measure.containment import station_widths
from haustra.envs.sim.conditions import Snapshot
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.pack import structure_of
from haustra.envs.sim.scope_reading import read_chain
from haustra.envs.sim.state import Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.coverage import CELL
from haustra.envs.tasks.episode import EpisodeRules
from haustra.envs.tasks.episode_program import ACT, BEGIN, DEALT, IN_PROGRAM, REST, EpisodeProgram
from haustra.envs.tasks.episodes import Drawn, Episodes, InPlace
from haustra.envs.tasks.moment import Kept
from haustra.envs.tasks.ray_program import lookup_of
from haustra.envs.tasks.sight import Sight

_CELLS = 128
"""Rows of cells are counted out by so many: banks whose longest colons differ by less share a program."""
_TRUTHS = ("terminated", "truncated", "diverged", "reached", "perforated")


@final
class LinearEpisodes(Episodes):
    """Episodes that the backend's program works out itself; what is drawn for those that begin comes from here."""

    def __init__(
        self,
        rules: EpisodeRules,
        bank: ColonSet,
        sight: Sight,
        backend: str,
        *,
        worlds: int,
        threads: int,
        steps: int,
        starts: tuple[Snapshot, ...] | None = None,
    ) -> None:
        """Compile, or read what was compiled before; no world has begun.

        Args:
            rules: of all episodes.
            bank: the colons.
            sight: rays into them.
            backend: 'linear' or 'linear-gpu'.
            worlds: how many.
            threads: of the CPU.
            steps: time steps of a control step.
            starts: where scopes begin in each colon; at the start depth when None.

        Raises:
            MissingDependencyError: when there is no such device.
            UnsupportedSceneError: when the scene has what the backend cannot honour.
        """
        chain = read_chain(bank.scene, backend=LinearBackend.name)
        coils = tuple(structure_of(chain).coils.tolist()) if rules.config.imager else ()
        cells = _CELLS * math.ceil(bank.lengths.max() / (CELL * _CELLS)) if rules.covers else 0
        view = bank.design.tip.field_of_view_deg
        about = {"rows_of_cells": cells, "field_of_view_deg": view} if rules.covers else {}
        self._program = EpisodeProgram(rules=rules, steps=steps, coils=coils, **about)
        self._rows, self._bank = self._program.rows, bank
        begin = None if starts is None else np.stack([start.state for start in starts])
        self.backend = self._linear = LinearBackend(
            bank.scene,
            bank.tables,
            worlds=worlds,
            threads=threads,
            device="cuda" if backend == "linear-gpu" else "cpu",
            driver=self._program,
            width=station_widths(bank.tables, bank.widths),
            colons=[case.colon() for case in bank.cases] if bank.options.gas else (),
            lookup=lookup_of(sight, begin) if "lumen" in self._rows or rules.covers else None,
        )
        self._seen: Readings | None = None
        self._told: dict[str, np.ndarray] | None = None

    @property
    def _table(self) -> dict[str, np.ndarray]:
        """Rows of what was told last, fetched once."""
        if self._told is None:
            told = self._linear.told(self._program.tells)[:, : self._linear.worlds].copy()
            self._told = {name: told[rows] for name, rows in self._rows.items()}
        return self._told

    @property
    def told(self) -> dict[str, np.ndarray]:
        """As `Episodes.told`."""
        rows = self._table
        numbers = {name: rows[name][0].astype(float) for name in self._program.rules.told}
        truths = {name: numbers[name] > 0 for name in _TRUTHS}
        places = {"tip": rows["tip"].T.astype(float), "push_force": rows["push_force"][0].astype(float)}
        return numbers | truths | places

    @property
    def parts(self) -> seen_by.Observation:
        """As `Episodes.parts`."""
        return {name: np.ascontiguousarray(self._table[name].T) for name in IN_PROGRAM if name in self._rows}

    @property
    def seen(self) -> Readings:
        """What can be read off now."""
        self._seen = self._seen or self._linear.read()
        return self._seen

    def begin(self, drawn: Drawn) -> None:
        """As `Episodes.begin`."""
        self._deal(drawn, REST)
        self._run()

    def step(self, action: Float[np.ndarray, "worlds actions"], drawn: Drawn | None = None) -> None:
        """As `Episodes.step`."""
        turn = self._program.turn
        asked = self._linear.ask_driver(0, turn)
        asked[:turn, : self._linear.worlds] = np.where(np.isfinite(action), np.clip(action, -1.0, 1.0), np.nan).T
        self._deal(drawn, ACT)
        self._run()

    @property
    def in_place(self) -> InPlace:
        """As `Episodes.in_place`."""
        columns, rows = self._linear.columns, self._rows
        return InPlace(
            action=columns("asked", slice(0, self._program.turn)),
            observation={name: columns("told", rows[name]) for name in IN_PROGRAM if name in rows},
            reward=columns("told", rows["reward"]),
            terminated=columns("told", rows["terminated"]),
            truncated=columns("told", rows["truncated"]),
            told={name: columns("told", rows[name]) for name in self._program.rules.told},
        )

    def advance(self, drawn: Drawn | None = None) -> Bool[np.ndarray, " worlds"]:
        """As `Episodes.advance`."""
        self._deal(drawn, ACT)
        self._run()
        return self._linear.told(1)[0, : self._linear.worlds] > 0

    def grow_older(self, age: Int[np.ndarray, " worlds"]) -> None:
        """As `Episodes.grow_older`."""
        self._linear.tell_driver(Kept._fields.index("age"), age[:, None].astype(float))

    def _deal(self, drawn: Drawn | None, others: float) -> None:
        """Say which worlds begin, with what, and what the others are to do."""
        linear, turn = self._linear, self._program.turn
        asked = linear.ask_driver(turn, turn + 1 if drawn is None else None)
        asked[turn, : linear.worlds] = others
        if drawn is None:
            return
        values = linear.deal(drawn.worlds, drawn.case, drawn.conditions)
        values |= {"gain": drawn.gain, "slack": drawn.slack, "bears": drawn.bears}
        values |= {"valve": self._bank.valves[drawn.case], "case": drawn.case}
        asked[turn, drawn.worlds] = BEGIN
        for row, name in enumerate(DEALT, start=turn + 1):
            asked[row, drawn.worlds] = values[name]

    def _run(self) -> None:
        own = self._rows.get("gas")
        if own is None:
            self._linear.drive(1)
        else:
            self._let_gas(self._linear.columns("told", own))
        self._seen = self._told = None

    def _let_gas(self, shown: Float[np.ndarray, "worlds 3"]) -> None:
        """A control step in which worlds that act let gas in and out, and what is shown of the gas then."""
        linear, gas, turn = self._linear, self._linear.gas, self._program.turn
        assert gas is not None, "a gas action without gas"
        asked, does = (linear.ask_driver(row, row + 1)[row, : linear.worlds] for row in (turn - 1, turn))
        share = np.where(does == ACT, np.clip(np.nan_to_num(asked), -1.0, 1.0), 0.0).astype(float)
        gas.asked = share * self._bank.options.gas_flow
        linear.drive(1)
        acted = does != REST
        shown[acted] = seen_by.arrayed(seen_by.gas(gas.tip_pressure, gas.volume, share))[acted]
