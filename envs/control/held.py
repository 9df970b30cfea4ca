"""A hand that does what it was told last: who decides outside a program drives through it."""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from jaxtyping import Float

from haustra.envs.control.follower import Decision, Law


@dataclass(frozen=True)
class HeldHand:
    """What hands are told, until they are told something else."""

    push_rate: float = 0.0
    """Speed at which the hand pushes the shaft in [m/s]."""
    roll_rate: float = 0.0
    """Speed at which the hand turns the shaft [rad/s]."""
    up: float = 0.0
    """Pull of the wire 'up' [N]."""
    left: float = 0.0
    """Pull of the wire 'left' [N]."""
    down: float = 0.0
    """Pull of the wire 'down' [N]."""
    right: float = 0.0
    """Pull of the wire 'right' [N]."""
    steer: ClassVar[str] = "pulls"
    straighten: ClassVar[bool] = False

    @classmethod
    def law(cls) -> Law:
        """What drives by these settings: whoever changes them."""
        return Law(cls, FIRST_MEMORY, rules, senses=False)


class Memory(NamedTuple):
    """What such a hand remembers: nothing."""

    attempts: Float[Any, "*worlds"]
    """Times that it backed off: none are told."""


FIRST_MEMORY = Memory(0.0)
"""Memory of a hand that has not been told anything."""


def rules(
    xp: Any, settings: Any, steering: None, sensed: None, memory: Memory, *, interval: float
) -> tuple[Decision, Memory]:
    """What the settings say; what is sensed is left to who sets them."""
    own = settings
    return Decision(own.push_rate, own.roll_rate, (own.up, own.left, own.down, own.right)), memory
