"""Numbers that stand in two places by turns: what is now, and what a time step makes of it.

A step that turns out unsound is left as it began when places are not changed. What another pass over these numbers
would take, to move them from a place of their own to where they belong, a graphics processor spends on waiting.
"""

from typing import Any

from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.trace import INDEX, Program


class Turns:
    """Two places for the same numbers of one world."""

    def __init__(self, program: Program, home: Lanes, other: Lanes) -> None:
        """Bind them.

        Args:
            program: to write to; one lane wide, since each world changes places by itself.
            home: where the numbers are now, and are brought back to.
            other: the second place, by the same slots.
        """
        self._program, self._home, self._other = program, home, other
        self._away = program.variable(program.index(0), kind=INDEX)

    @property
    def now(self) -> Lanes:
        """Where the numbers are."""
        return self._either(self._home, self._other)

    @property
    def then(self) -> Lanes:
        """Where a step puts what it makes of them."""
        return self._either(self._other, self._home)

    def change(self) -> None:
        """Let what a step made be what is now."""
        self._away.value = 1 - self._away.value

    def bring_back(self, *parts: tuple[Any, Any]) -> None:
        """Bring the numbers of these slots, each from the first up to not including the second, home."""
        program = self._program
        with program.when(self._away.value > 0):
            for first, last in parts:
                with program.loop(first, last) as slot:
                    self._other.fetch(slot + 4)
                    self._home.store(slot, self._other.load(slot))
        self._away.value = program.index(0)

    def _either(self, home: Lanes, away: Lanes) -> Lanes:
        """The one of two that counts."""
        program = self._program
        place = program.builder.select((self._away.value > 0).written, away.place(0), home.place(0))
        return home.at(place)
