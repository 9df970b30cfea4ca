"""Episodes in linear time: a whole control step of all worlds in one launch of one program, on a CPU or a GPU."""

from typing import final

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.conditions import Snapshot
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.pack import structure_of
from haustra.envs.sim.scope_reading import read_chain
from haustra.envs.sim.state import Readings
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.episode import EpisodeRules
from haustra.envs.tasks.episode_program import ACT, BEGIN, DEALT, IN_PROGRAM, REST, TURN, EpisodeProgram
from haustra.envs.tasks.episodes import Drawn, Episodes
from haustra.envs.tasks.moment import Kept
from haustra.models.scene import Scene

_TRUTHS = ("terminated", "truncated", "diverged", "reached", "perforated")


@final
class LinearEpisodes(Episodes):
    """Episodes that the backend's program works out itself; what is drawn for those that begin comes from here."""

    def __init__(self, program: EpisodeProgram, backend: LinearBackend, bank: ColonSet) -> None:
        """Prepare worlds; none has begun.

        Args:
            program: the driver that the backend was made with.
            backend: steps the worlds.
            bank: the colons.
        """
        self._program, self._backend, self._bank = program, backend, bank
        self._rows = program.rows
        self._seen: Readings | None = None
        self._tell()

    @staticmethod
    def program(rules: EpisodeRules, scene: Scene, steps: int) -> EpisodeProgram:
        """The driver that the backend is to be made with, for control steps of so many time steps."""
        coils = structure_of(read_chain(scene, backend=LinearBackend.name)).coils if rules.config.imager else ()
        return EpisodeProgram(rules=rules, steps=steps, coils=tuple(map(int, coils)))

    @property
    def seen(self) -> Readings:
        """What can be read off now."""
        self._seen = self._seen or self._backend.read()
        return self._seen

    def begin(self, drawn: Drawn, starts: tuple[Snapshot, ...] | None = None) -> None:
        """As `Episodes.begin`."""
        assert starts is None, "a start that the program does not know"
        self._deal(drawn, REST)
        self._run()

    def step(
        self,
        action: Float[np.ndarray, "worlds 4"],
        drawn: Drawn | None = None,
        starts: tuple[Snapshot, ...] | None = None,
    ) -> None:
        """As `Episodes.step`."""
        asked = self._backend.ask_driver(0, TURN)
        asked[:TURN, : self._backend.worlds] = np.where(np.isfinite(action), np.clip(action, -1.0, 1.0), np.nan).T
        self._deal(drawn, ACT)
        self._run()

    def grow_older(self, age: Int[np.ndarray, " worlds"]) -> None:
        """As `Episodes.grow_older`."""
        self._backend.tell_driver(Kept._fields.index("age"), age[:, None])

    def _deal(self, drawn: Drawn | None, others: float) -> None:
        """Say which worlds begin, with what, and what the others are to do."""
        backend = self._backend
        last = TURN + 1 if drawn is None else None
        asked = backend.ask_driver(TURN, last)
        asked[TURN, : backend.worlds] = others
        if drawn is None:
            return
        values = backend.deal(drawn.worlds, drawn.case, drawn.conditions)
        values |= {"gain": drawn.gain, "slack": drawn.slack, "valve": self._bank.valves[drawn.case]}
        asked[TURN, drawn.worlds] = BEGIN
        for row, name in enumerate(DEALT, start=TURN + 1):
            asked[row, drawn.worlds] = values[name]

    def _run(self) -> None:
        self._backend.drive(1)
        self._seen = None
        self._tell()

    def _tell(self) -> None:
        told = self._backend.told(self._program.tells)[:, : self._backend.worlds].copy()
        rows = {name: told[rows] for name, rows in self._rows.items()}
        self.parts = {name: np.ascontiguousarray(rows[name].T) for name in IN_PROGRAM if name in rows}
        numbers = {name: rows[name][0].astype(float) for name in self._program.rules.told}
        truths = {name: numbers[name] > 0 for name in _TRUTHS}
        hand = {"tip": rows["tip"].T.astype(float), "push_force": rows["push_force"][0].astype(float)}
        self.told = numbers | truths | hand
