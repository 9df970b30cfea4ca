"""Which number lies where: slots of states, parameters, designs and tables, in programs and in arrays alike."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

DOF = ("x", "y", "z", "stiffness", "damping", "armature", "rest", "low", "high", "up", "left", "down", "right",
       "behind", "lock_stiffness", "lock_damping", "cubic", "ring")  # fmt: skip
"""Numbers of each joint in a design: axis, spring, stops, arms of the wires, its lock outside, spring's cube, and by
how much of its stiffness a stiffening ring that is turned stiffens it."""

BODY = ("offset", "mass", "centre", "across", "along")
"""Numbers of each link in a design: place on its parent's axis [m], mass, centre of mass, moments of inertia."""

SCOPE = ("radius", "start", "tip", "pull_limit", "wire_friction", "wire_hysteresis", "length", "pull_per_angle",
         "bend_limit", "wire_radius", "wire_slack", "wire_compliance")  # fmt: skip
"""Numbers of a whole design."""

WORLD = ("one", "bending", "tip_bending", "torsion", "ring", "stiffness", "damping_time", "friction", "push_limit",
         "torque_limit", "gravity_x", "gravity_y", "gravity_z", "step", "first", "count", "device_radius",
         "first_node", "spacing", "pleating", "pressure_lost",
         "push_rate", "roll_rate", "up", "left", "down", "right", "alive", "begins", "start_roll",
         "gas_load", "gas_load_arc", "gas_pain", "gas_pain_arc",
         "wall_straight", "wall_bent", "wall_sideways", "wall_fixed", "wall_per_diameter",
         "wall_contact_length")  # fmt: skip
"""Numbers of a world: what scales joints, how far a stiffening ring is turned on command (0 to 1), its wall, hand and
colon, what hands ask, whether it is stepped, whether its scope is to be laid straight before that, how it is turned
then [rad], what gas alone does to it, and what its wall bears (`haustra.models.injury.perforation.Strength`). Of each
wire hands ask a pull [N], or, where wheels steer, how much of it is taken up [m]."""

BEGUN = ("step", "first", "count", "device_radius", "first_node", "spacing", "pleating", "pressure_lost",
         "gravity_x", "gravity_y", "gravity_z", "bending", "ring", "stiffness", "friction", "start_roll", "alive",
         "begins")  # fmt: skip
"""Those of them that a world which begins anew is given."""

AXIS = ("place", "y", "z", "turn", "tangent", "tangent_y", "tangent_z", "upright", "closing", "closing_y", "closing_z",
        "width", "way", "way_x", "way_y", "way_z", "length", "tension", "torsion", "bending", "slack", "hold",
        "support", "drag", "load", "load_y", "load_z", "turn_drag")  # fmt: skip
"""Numbers of each node of the axis of a colon that moves: a row of `haustra.models.wall.mesentery.Mesentery`."""

AROUND = ("room", "room_front", "room_feet", "room_left", "room_back", "room_head", "sway", "front", "firm", "dome",
          "breaths", "left", "left_y", "left_z", "back", "back_y", "back_z", "head", "head_y", "head_z")  # fmt: skip
"""What is behind those where there is an envelope or breath; from 'front' on the same at all nodes of a colon."""

ROOT = ("root", "root_y", "root_z", "_")
"""What is behind those where mesenteries hang from their roots, and what fills a four."""

LOOPS = ("girth", "touch", "between", "_")
"""What is last where loops touch: thickness of each node for others, stiffness, spacing, and what fills a four."""

STATION = 16
"""Numbers of a row of a colon's station: point and least radius, first normal and width, second normal, and tangent,
each of four."""
LEAST = 3
"""Where the least radius is."""


@dataclass(frozen=True)
class Layout:
    """Slots of one scope's state and of the room to work in; counts are numbers, or values of a program."""

    dofs: Any
    bodies: Any
    spheres: Any
    nodes: Any = 0
    """Nodes of the axis of a colon that moves."""
    wheels: bool = False
    """Whether wheels steer, so that wires are springs."""
    abreast: int = 1
    """Nodes of one axis that stand side by side; their numbers then lie by what they are, and else by node."""
    surrounded: bool = False
    """Whether nodes feel an envelope or breath (`haustra.models.wall.surroundings`)."""
    rooted: bool = False
    """Whether mesenteries hang from their roots (`haustra.models.wall.mesentery`)."""
    touching: bool = False
    """Whether loops of the colon touch each other (`haustra.models.wall.loops`)."""
    moving: bool = False
    """Whether the colon moves, so that there are nodes."""
    by_turns: bool = False
    """Whether what a time step changes of the chain is written beside what it was (`envs.sim.linear.turns`)."""

    @property
    def columns(self) -> tuple[str, ...]:
        """Numbers of each node of the axis at rest."""
        return (
            AXIS
            + (AROUND if self.surrounded else ())
            + (ROOT if self.rooted else ())
            + (LOOPS if self.touching else ())
        )

    @property
    def speeds(self) -> Any:
        """First slot of generalised speeds; positions begin at 0."""
        return self.dofs

    @property
    def arcs(self) -> Any:
        """Arc lengths of spheres, and then of the tip."""
        return self.dofs * 2

    @property
    def normals(self) -> Any:
        """Normal force of each sphere at the end of the last step."""
        return self.arcs + self.spheres + 1

    @property
    def hand(self) -> Any:
        """Where the hand aims, along and about the shaft."""
        return self.normals + self.spheres

    @property
    def pulls(self) -> Any:
        """What arrived at the bending section."""
        return self.hand + 2

    @property
    def time(self) -> Any:
        """Simulated time."""
        return self.pulls + 4

    @property
    def axis(self) -> Any:
        """`NODE` slots a node."""
        return self.time + 1

    @property
    def row(self) -> Any:
        """Numbers of one kind that follow each other where nodes stand side by side: some before and behind too."""
        return self.nodes if self.abreast == 1 else self.nodes + 3 * self.abreast

    @property
    def state(self) -> Any:
        """Slots of the state."""
        return self.axis + self.row * NODE

    def axes(self, states: Float[np.ndarray, "*rows slots"]) -> Float[np.ndarray, "*rows nodes 11"]:
        """Where poses and speeds of the colons' axes lie in rows of states: a view."""
        numbers = states[..., self.axis :]
        if self.abreast == 1:
            return numbers.reshape(*states.shape[:-1], self.nodes, NODE)
        own = numbers.reshape(*states.shape[:-1], NODE, self.row)[..., self.abreast :][..., : self.nodes]
        return np.swapaxes(own, -1, -2)

    def node_state(self, number: int) -> Any:
        """Where a number of the nodes' poses and speeds is counted from."""
        return self.axis + self._of_number(number)

    def node_slot(self, number: int) -> Any:
        """Where a number of the nodes' rooms is counted from."""
        return self.node_room + self._of_number(number)

    def loop_slot(self, number: int) -> Any:
        """Where a number of the nodes' rooms for loops that touch is counted from."""
        return self.loop_room + self._of_number(number)

    def thread_slot(self, number: int) -> Any:
        """Where a number of the nodes' rooms for a shaft between its spheres is counted from."""
        return self.thread_room + self._of_number(number)

    def _of_number(self, number: int) -> Any:
        return number if self.abreast == 1 else self.row * number + self.abreast

    def padded(self, count: Any) -> Any:
        """Room for so many things, of which `abreast` are looked at together."""
        return count if self.abreast == 1 else (count + (self.abreast - 1)) // self.abreast * self.abreast

    @property
    def sphere_row(self) -> Any:
        """Slots of a number of all spheres and the tip, which stand side by side in two registers, and some more."""
        return None if self.abreast == 1 else self.spheres + 2 * self.abreast

    @property
    def design(self) -> tuple[Any, Any, Any, Any]:
        """First slots of links, spheres and the scope's own numbers in a design, and all; joints begin at 0."""
        links = self.padded(self.dofs) * len(DOF)
        places = links + self.padded(self.bodies) * len(BODY)
        scope = places + self.spheres
        return links, places, scope, scope + len(SCOPE)

    # Room to work in.

    @property
    def joint_room(self) -> Any:
        """`joint_numbers` slots a joint."""
        return 0 * self.dofs

    @property
    def joint_numbers(self) -> int:
        """Slots of a joint's room."""
        return JOINT_ROOM if self.abreast == 1 else JOINT_ALONE

    @property
    def body_numbers(self) -> int:
        """Slots of a link's room."""
        return BODY_ROOM if self.abreast == 1 else BODY_ALONE

    @property
    def body_room(self) -> Any:
        """`body_numbers` slots a link."""
        return self.joint_room + self.padded(self.dofs) * self.joint_numbers

    @property
    def sphere_room(self) -> Any:
        """`sphere_numbers` slots a sphere, or rows of `SPHERE_ALONE` numbers, of the tip too."""
        return self.body_room + self.padded(self.bodies) * self.body_numbers

    @property
    def sphere_numbers(self) -> int:
        """Slots of a sphere's room, where spheres do not stand side by side."""
        return SPHERE_ROOM if self.moving else SPHERE_FIXED

    @property
    def node_room(self) -> Any:
        """`NODE_ROOM` slots a node, or `NODE_ALONE` rows where nodes stand side by side."""
        if self.abreast == 1:
            return self.sphere_room + self.spheres * self.sphere_numbers
        return self.sphere_room + self.padded(self.sphere_row * SPHERE_ALONE)

    @property
    def wire_room(self) -> Any:
        """`WIRE_ROOM` slots a joint, where wheels steer."""
        return self.thread_room + (self.row * THREAD_ROOM if self.moving else 0)

    @property
    def thread_room(self) -> Any:
        """`THREAD_ROOM` slots a node, or as many rows where nodes stand side by side, of a colon that moves."""
        return self.loop_room + (self.row * LOOP_ROOM if self.touching else 0)

    @property
    def loop_room(self) -> Any:
        """`LOOP_ROOM` slots a node, or as many rows where nodes stand side by side, where loops touch."""
        if self.abreast == 1:
            return self.node_room + self.row * NODE_ROOM
        return self.press_scratch + self.abreast * PRESS

    @property
    def cell_room(self) -> Any:
        """`CELL_ALONE` slots a node, where nodes stand side by side: what spheres look up there."""
        return self.node_room + self.padded(self.row * NODE_ALONE)

    @property
    def press_room(self) -> Any:
        """`PRESS` slots a node, where nodes stand side by side: what spheres do to it."""
        return self.cell_room + self.row * CELL_ALONE

    @property
    def press_scratch(self) -> Any:
        """`PRESS` slots for each of the spheres that are looked at together."""
        return self.press_room + self.row * PRESS

    @property
    def other_room(self) -> Any:
        """Where all of the chain up to its spheres' normal forces stands a second time, if it is written by turns."""
        return self.wire_room + self.dofs * WIRE_ROOM if self.wheels else self.wire_room

    @property
    def room(self) -> Any:
        """All of it."""
        return self.other_room + self.hand if self.by_turns else self.other_room


JOINT_ROOM = 10
"""U / D (6), tau / D and then the new speed, direction (3)."""
BODY_ROOM = 9
"""Direction (3), and the wrench that its velocity and its spheres need (6)."""
SPHERE_FIXED = 9
"""Normal, speed against the wall (6), spring and then normal force, drag, damper."""
SPHERE_ROOM = SPHERE_FIXED + 3
"""Numbers of a fixed wall's sphere, and the lever at which a colon that moves is held (3); at a step's end the force on
it (3) and the next sphere of the same cell stand where its normal and speed did."""
JOINT_ALONE = JOINT_ROOM + 5
"""Where joints stand side by side: what drives one, its armature with what damps it, sine, versine, what scales it."""
BODY_ALONE = 30
"""Where links stand side by side: direction (3), inertia (21) and wrench (6)."""
SPHERE_ALONE = SPHERE_ROOM + 33
"""Where spheres stand side by side: what the link feels of it, as links' inertia and wrench; place and motion until
that is known; the lever of its surface; and its place."""
NODE = 11
"""Pose and speed (`haustra.models.wall.moving_colon.AxisDisplacement`)."""
NODE_ROOM = 20
"""`haustra.envs.sim.linear.axis`."""
NODE_ALONE, CELL_ALONE, PRESS = 6, 28, 16
"""Where nodes stand side by side: what of that is theirs, what spheres look up, and what these do to them."""
LOOP_ROOM = 9
"""`haustra.envs.sim.linear.loops`."""
THREAD_ROOM = 3
"""`haustra.envs.sim.linear.threads`."""
WIRE_ROOM = 2
"""`haustra.envs.sim.linear.wires`."""


STRUCTURE = 5
"""Whole numbers a link: its first joint, the one after its last, the same of its spheres, and whether it is of the tip.
After all links' come, for each joint, what scales it, and for each sphere its place among the imager's coils, or -1."""

SEEN = ("tip", 3), ("tip_frame", 9), ("push_force", 1), ("torque", 1), ("tip_force", 3), ("deepest", 1)
"""What is read off first, and how many numbers it is; then come the coils' places and the links' forces."""


@cache
def seen_slot(name: str) -> int:
    """Where what is read off by that name begins; 'coils' come last."""
    names = [each for each, _ in SEEN] + ["coils"]
    return sum(count for _, count in SEEN[: names.index(name)])
