"""What differs between worlds of one batch besides the colon."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError


@dataclass(frozen=True)
class Conditions:
    """One value a world.

    Raises:
        InvalidOptionError: when a value is not a number that a world can have.
    """

    friction: Float[np.ndarray, " worlds"]
    """Coulomb coefficient between scope and wall [1]."""
    wall_stiffness: Float[np.ndarray, " worlds"]
    """Normal stiffness of a contact [N/m]."""
    shaft_stiffness: Float[np.ndarray, " worlds"]
    """Bending stiffness of the shaft over the design's [1]."""
    roll: Float[np.ndarray, " worlds"] | None = None
    """Angle of the handle at the start [rad]; zero when None."""

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            if values is None:
                continue
            fine = np.isfinite(values) & ((values >= 0) if name == "friction" else (values > 0) | (name == "roll"))
            if not fine.all():
                raise InvalidOptionError(f"{name} is {values[~fine][0]} in a world: give a finite, positive number.")

    def of(self, rows: np.ndarray) -> "Conditions":
        """Those of some worlds."""
        roll = None if self.roll is None else self.roll[rows]
        return Conditions(self.friction[rows], self.wall_stiffness[rows], self.shaft_stiffness[rows], roll)


@dataclass(frozen=True)
class Snapshot:
    """A scope somewhere in a colon, to begin from."""

    state: Float[np.ndarray, " state"]
    """MuJoCo's integration state."""
    arcs: Float[np.ndarray, " spheres"]
    """Arc length of each sphere [m]."""
    pulls: Float[np.ndarray, "4"]
    """What of the hand's pulls had arrived at the bending section [N]."""
