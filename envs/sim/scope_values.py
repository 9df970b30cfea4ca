"""What many scopes are made of: designs, parameters and states."""

from typing import Any, NamedTuple, TypeAlias

from haustra.envs.sim.serial_chain import Links
from haustra.models.wall.moving_colon import AxisDisplacement

Array: TypeAlias = Any


class Scope(NamedTuple):
    """Numbers of one design, or of one a world: leading axis 1 or worlds. Scopes of one kind differ in these only."""

    links: Links
    stiffness: Array
    """(any, dofs) of the springs [N m/rad]."""
    damping: Array
    armature: Array
    rest: Array
    """(any, dofs) angles at rest [rad]."""
    low: Array
    high: Array
    """(any, dofs) stops [rad]."""
    arms: Array
    """(any, 4, dofs) length of each wire per angle [m/rad]."""
    behind: Array
    """(any, joints) distance of each joint from the tip [m]."""
    lock_stiffness: Array
    lock_damping: Array
    """(any, 2 joints) of the locks of the shaft outside [N m/rad], [N m s/rad]."""
    sample_place: Array
    """(any, points, 3) spheres, in their links' frames [m]."""
    radius: Array
    """(any,) of the spheres [m]."""
    tip_place: Array
    """(any, 1, 3) in the last link's frame [m]."""
    pull_per_angle: Array
    """(any,) pull that bends the bending section by an angle [N/rad]."""
    length: Array
    """(any,) of the modelled scope [m]."""
    start: Array
    """(any,) depth of the tip at the start [m]."""
    pull_limit: Array
    """(any,) largest pull of one wire [N]."""
    bend_limit: Array
    """(any,) smallest of the bending section's limits [rad]."""
    wire_friction: Array
    """(any,) Coulomb coefficient between wire and sheath [1]."""
    cubic: Array
    """(any, dofs) of the springs' torque stiffness q + cubic q^3 [N m/rad^3]."""
    ring: Array
    """(any, joints) by how much of its stiffness a stiffening ring that is turned on command stiffens a joint [1]."""
    wire_hysteresis: Array
    """(any,) part of a pull that is lost in the bending section itself [1]."""
    wire_radius: Array
    """(any,) distance of each wire from the axis [m]."""
    wire_slack: Array
    """(any,) length that a wheel takes up before a wire pulls [m]."""
    wire_compliance: Array
    """(any,) stretch of a wire per newton of pull [m/N]."""


class Parameters(NamedTuple):
    """What may differ from world to world; numbers have shape (worlds,)."""

    scope: Scope
    colon: Array
    """Which of the stacked colons."""
    stiffness: Array
    """Stiffness of the wall [N/m]."""
    damping_time: Array
    """Damping over stiffness of the wall [s]."""
    friction: Array
    """Coulomb coefficient [1]."""
    bending: Array
    """EI of the shaft over that of the design [1]."""
    tip_bending: Array
    """EI of the bending section over that of the design [1]."""
    torsion: Array
    """GJ over that of the design [1]."""
    push_limit: Array
    """Largest push of the hand [N]."""
    torque_limit: Array
    """Largest torque of the hand [N m]."""
    gravity: Array
    """(worlds, 3) in each colon's own frame [m/s^2]."""


class State(NamedTuple):
    """State of all worlds; leading axis: worlds."""

    qpos: Array
    qvel: Array
    hand: Array
    """(worlds, 2): where the hand aims, along [m] and about the shaft [rad]."""
    arcs: Array
    """(worlds, points + 1): arc length of each sphere, and of the tip [m]."""
    normal: Array
    """(worlds, points): force of the wall on each sphere at the end of the last step [N]."""
    healthy: Array
    """(worlds,): false once a world has diverged; it then stays as it was last sound."""
    time: Array
    """(worlds,) [s]."""
    pulls: Array
    """(worlds, 4): what of the hand's pulls arrived at the bending section last [N]."""
    warm: Array | None = None
    """(worlds, dofs) accelerations from which MuJoCo's solver begins; None where there is no such solver."""
    displacement: AxisDisplacement | None = None
    """Where the colons have moved to; None where they are fixed in space."""
