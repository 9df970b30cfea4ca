"""What environments are called with: actions, options of reset, and intervals in steps of the physics."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.fields import shown

_ROUNDING = 1e-6
"""Share of a time step by which an interval may differ from a whole number of them."""


def checked_action(action: Any, shape: tuple[int, ...]) -> Float[np.ndarray, "..."]:
    """An action as an array of that shape; entries that are not finite are left to the environment.

    Raises:
        InvalidOptionError: when it is no numbers, or of another shape.
    """
    try:
        found = np.asarray(action, float)
    except (TypeError, ValueError) as error:
        raise InvalidOptionError(f"The action is {shown(action)}; give numbers of shape {shape}.") from error
    if found.shape != shape:
        raise InvalidOptionError(f"The action has shape {found.shape}; give {shape}.")
    return found


def require_no_options(options: Mapping[str, Any] | None, *known: str) -> None:
    """Refuse options of reset besides those that are known.

    Raises:
        InvalidOptionError: naming one that is not.
    """
    for name in options or {}:
        if name not in known:
            raise InvalidOptionError(f"reset has no option {shown(name)}. Known: {', '.join(known) or 'none'}.")


def whole_steps(interval: float, timestep: float) -> int:
    """How many steps of the physics a control interval takes.

    Raises:
        InvalidOptionError: when it is no whole number of them.
    """
    steps = interval / timestep
    if round(steps) < 1 or abs(steps - round(steps)) > _ROUNDING:
        raise InvalidOptionError(
            f"control_interval is {interval} s; give a whole number of the physics' steps of {timestep:g} s."
        )
    return round(steps)
