"""What a colon lies in: how the patient lies, what has grown to what, a hand on the belly, what holds it in, breath.

A colon that was imaged was in balance on the patient's back: its shape at rest is that of the posture `SCANNED`. In
another one what weighs is the same, and pulls another way: the load of the axis is its weight times the change of
gravity's direction. Coordinates are as in CT: x to the patient's left, y to the back, z to the head (LPS).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.fields import number, require_declared, texts

DOWN = {"supine": (0.0, 1.0, 0.0), "prone": (0.0, -1.0, 0.0), "left": (1.0, 0.0, 0.0), "right": (-1.0, 0.0, 0.0)}
"""Direction of gravity for a patient who lies on the back, on the front, on the left and on the right side."""
SCANNED = "supine"
"""Posture in which colons were imaged; grown ones are like those."""
FALL = 9.81
"""Gravity [m/s^2]."""
MOBILE = ("descending", "ascending")
"""Segments that hang on a mesentery of their own in some people: a third and two thirds (Phillips 2015)."""
ADHERENT = ("sigmoid", "transverse")
"""Segments whose mesentery may have grown to what is beside it: the sigmoid's in a sixth (Saunders 1995)."""


@dataclass(frozen=True)
class Abdomen:
    """The patient around a colon that moves; by default nothing of it differs from when the colon was imaged."""

    posture: Literal["supine", "prone", "left", "right"] = "supine"
    """How the patient lies: on the back (supine), on the front (prone), on the left or on the right side."""
    mobile: tuple[str, ...] = texts(most=2, default=())
    """Which of the descending and ascending colon hang on a mesentery of their own; otherwise they have grown to the
    back wall."""
    adhesions: tuple[str, ...] = texts(most=2, default=())
    """Which of the sigmoid and transverse colon have grown to what is beside them, half-way."""
    pressed: Literal["none", "sigmoid", "transverse"] = "none"
    """Segment on which an assistant's hand presses through the belly, at half of its length."""
    hand: float = number("N", 0.0, 100.0, default=20.0)
    """Force of the assistant's hand towards the back, on a colon that has not moved [N]; engineering choice, a firm
    press that a forearm holds for minutes. It presses the belly in until that bears it."""

    envelope: bool = False
    """Let the abdominal wall and the organs around hold the colon in (`haustra.models.wall.surroundings`)."""
    breathing: bool = False
    """Let quiet breath move what the colon hangs on, most below the diaphragm."""
    rooted: bool = False
    """Let mesenteries hang from their roots, which run straight from end to end of their segments; otherwise from where
    the colon lay when it was imaged, so that a loop that is straightened further than its mesentery is high is held."""
    loops_touch: bool = False
    """Let loops of the colon press on each other where they meet (`haustra.models.wall.loops`)."""
    torsion: bool = True
    """Let the colon's tube resist that it is twisted about its axis."""

    @property
    def surrounds(self) -> bool:
        """Whether nodes of the axis feel anything that others do not: `haustra.models.wall.surroundings`."""
        return self.envelope or self.breathing or self.pressed != "none"

    def left_out(self) -> dict[str, str]:
        """What of the patient is left out, by name, and what that means."""
        asked = {
            "loops of colon against each other": (self.loops_touch, "they pass through each other"),
            "abdominal wall and organs around": (self.envelope, "nothing stands in the way of a colon that moves out"),
            "breathing": (self.breathing, "what the colon hangs on stands still"),
            "roots of mesenteries": (self.rooted, "loops are held back alike whichever way they move"),
            "torsion of the colon": (self.torsion, "it twists without resistance where nothing holds it upright"),
            "mobile descending and ascending colon": (self.mobile, "both have grown to the back wall"),
            "adhesions": (self.adhesions, "sigmoid and transverse colon hang on their mesenteries throughout"),
            "a hand on the belly": (self.pressed != "none", "nobody presses"),
        }
        return {name: why for name, (there, why) in asked.items() if not there}

    def __post_init__(self) -> None:
        require_declared(self)
        for name, known in (("mobile", MOBILE), ("adhesions", ADHERENT)):
            if wrong := set(getattr(self, name)) - set(known):
                raise InvalidOptionError(f"{name} names {min(wrong)}; give some of {', '.join(known)}.")


def turned_weight(posture: str, weight: Float[np.ndarray, " nodes"]) -> Float[np.ndarray, "nodes 3"]:
    """Load of weights [N] that were in balance when the colon was imaged, in a posture [N]."""
    return weight[:, None] * (np.array(DOWN[posture]) - np.array(DOWN[SCANNED]))
