"""What goes into a scope that is stepped and what is read off it: one definition for all backends.

A backend of many scopes has one leading axis, the worlds. A backend of one scope has none, and its numbers are plain.
Both records are trees to JAX.
"""

from typing import Any, NamedTuple, get_type_hints

import numpy as np
from jaxtyping import Float, Real

from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.wires import WIRE_NAMES

SLACK = np.zeros(len(WIRE_NAMES))
"""Pulls of one scope's wires at rest [N]."""
SLACK.setflags(write=False)  # every caller's default

SPEED_LIMIT = 1e4
"""A generalised speed above this [rad/s or m/s] is divergence."""


class Controls(NamedTuple):
    """What the hands and the wheels ask for, until the next call."""

    push_rate: Real[Any, "*worlds"]
    """Speed at which the hand pushes the shaft in [m/s]."""
    roll_rate: Real[Any, "*worlds"]
    """Speed at which the hand turns the shaft [rad/s]."""
    pulls: Real[Any, "*worlds 4"] = SLACK
    """Pull of each wire at the handle: up, left, down, right [N]."""
    wheels: Real[Any, "*worlds 2"] = None
    """Wire that the wheels have taken up, towards up and towards left [m]; steers instead of `pulls` unless None, and
    then slack and stretch of the wires count too. One scope on MuJoCo's CPU engine, or any in linear time."""

    def checked(self) -> "Controls":
        """These controls, once their arrays are known to have the shapes said here.

        Raises:
            InvalidOptionError: naming the first that has not.
        """
        return _checked(self)


class Readings(NamedTuple):
    """What can be read off at one instant; None stands for what a backend does not measure."""

    time: Real[Any, "*worlds"]
    """Simulated time [s]."""
    insertion: Real[Any, "*worlds"]
    """Length of scope past the anus [m]."""
    roll: Real[Any, "*worlds"]
    """Angle of the handle [rad]."""
    hand_lead: Real[Any, "*worlds"]
    """How far the position that the hand aims at is ahead of the shaft [m]."""
    tip: Float[Any, "*worlds 3"]
    """Position of the tip [m]: of many scopes from the entry, of one scope in the coordinates of its scene."""
    tip_frame: Float[Any, "*worlds 3 3"]
    """Columns: the directions of wires 'up' and 'left', and the viewing direction."""
    bend: Float[Any, "*worlds 2"]
    """Angle of the bending section towards wires 'up' and 'left' [rad]."""
    push_force: Real[Any, "*worlds"]
    """Force of the hand along the shaft; positive pushes [N]."""
    torque: Real[Any, "*worlds"]
    """Torque of the hand about the shaft [N m]."""
    link_forces: Float[Any, "*worlds links"]
    """Resultant normal force of the wall on each link, from the handle to the tip [N]."""
    link_arcs: Float[Any, "*worlds links"] = None
    """Arc length of the centreline next to the middle of each link [m]; negative before the anus."""
    tip_arc: Real[Any, "*worlds"] = None
    """Arc length of the centreline next to the tip [m]; None of one scope."""
    tip_force: Float[Any, "*worlds 3"] = None
    """Resultant normal force of the wall on the bending section and tip, in the tip's frame [N]; None of one scope."""
    deepest: Real[Any, "*worlds"] = None
    """Largest depth of the scope in the wall [m]; None of one scope."""
    coils: Float[Any, "*worlds coils 3"] = None
    """Places of the shaft `haustra.envs.sim.coils.COIL_DISTANCES` behind the tip [m]: of many scopes from the entry, of
    one in the coordinates of its scene; those outside the anus are of no meaning while shaft there is left out."""
    displacement: Float[Any, "*worlds nodes 7"] = None
    """Poses of the colon's axis (`haustra.models.wall.moving_colon.AxisDisplacement`): of many scopes seen from the
    entry, of one in the coordinates of its scene; None of a colon that is fixed, and of the native backend of many
    scopes."""
    pulls: Float[Any, "*worlds 4"] = None
    """Pull of each wire at the handle: up, left, down, right [N]; None of many scopes."""
    contacts: Real[Any, "*worlds"] = None
    """Contacts with the wall that carry force; None of many scopes."""
    energies: Any = None
    """`haustra.envs.sim.energy.Energies`, stored in the bent scope and in the pressed wall; None of many scopes."""
    way: Float[Any, "*worlds stations 3"] = None
    """Where the stations of the colon's centreline are now [m]; None of many scopes, and of a colon that is fixed."""
    wall_force_sum: Real[Any, "*worlds"] = None
    """Sum of the wall's normal forces [N]: unlike those on links, it does not depend on how long links are; None of
    many scopes but in linear time."""

    def checked(self) -> "Readings":
        """These readings, once their arrays are known to have the shapes said here.

        Raises:
            InvalidOptionError: naming the first that has not.
        """
        return _checked(self)


_AXES = {
    kind: [None if shape is Any else shape.dim_str.split()[1:] for shape in get_type_hints(kind).values()]
    for kind in (Controls, Readings)
}
"""Axes of each field behind the worlds; None of what is no array. Read once: controls are checked at every call."""


def _checked(record: Any) -> Any:
    """The record itself; all its arrays have the same worlds."""
    worlds = np.shape(record[0])
    for name, axes, value in zip(record._fields, _AXES[type(record)], record, strict=True):
        if value is None or axes is None:
            continue
        shape = np.shape(value)
        own = shape[len(worlds) :]
        fits = shape[: len(worlds)] == worlds and len(own) == len(axes)
        if not fits or any(axis.isdecimal() and int(axis) != size for axis, size in zip(axes, own, strict=True)):
            wanted = " ".join(map(str, (*worlds, *axes)))
            raise InvalidOptionError(f"The {type(record).__name__} have {name} of shape {shape}: give ({wanted}).")
    return record


def refuse_others(inputs: Controls, worlds: int, *, wheels: bool = False) -> None:
    """Refuse controls that are not of many worlds, steered by pulls, or by wheels where those are honoured.

    Raises:
        InvalidOptionError: saying which they are not.
    """
    if np.shape(inputs.checked().push_rate) != (worlds,):
        raise InvalidOptionError(f"The Controls are of shape {np.shape(inputs.push_rate)}: give one a world, {worlds}.")
    if inputs.wheels is not None and not wheels:
        raise InvalidOptionError("These worlds are steered by pulls: leave wheels out, or use the backend 'linear'.")
