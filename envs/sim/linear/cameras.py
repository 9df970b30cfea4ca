"""Where the cameras at tips are and how the colons lie around them: what programs that draw pictures begin from.

A world's view is one row of fours: `VIEW` first, then as many numbers for each node of a colon that moves.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.linear.layout import seen_slot
from haustra.envs.sim.linear.memory import Lanes, OwnRows
from haustra.envs.sim.linear.program import ScopeProgram
from haustra.envs.sim.linear.sensing import tip_arc
from haustra.envs.sim.linear.trace import Value
from haustra.models.wall.vectors import times

VIEW = 24
"""Numbers of a view before those of nodes, and of each node: station of the colon's beginning, stations, distance
between them, arc length of the tip; the camera's place, and nodes known; its right, and distance between nodes; its up,
and the device's radius; its backward direction. A node has its displacement and its edge's stretch; how its cell
closes, and the share by which its section is flattened; the section's turn; the direction in which it is flattened;
how its cell closes at rest; its direction at rest."""
_GIVEN = {"first": 0, "count": 1, "step": 2}
ARC, EYE, KNOWN, RIGHT, SPACING, UP, RADIUS, BACKWARDS = 3, 4, 7, 8, 11, 12, 15, 16
"""Where in a view these begin."""


def no_views(nodes: int, worlds: int) -> Float[np.ndarray, "worlds numbers"]:
    """Room for the views of worlds whose colons have so many nodes."""
    return np.zeros((worlds, VIEW * (1 + nodes)))


@final
@dataclass(frozen=True, kw_only=True)
class CameraProgram:
    """Tells the views of all worlds, as they are after the last step, and changes none."""

    reach: float
    """Farther than this from the tip nothing is looked at [m]."""

    @property
    def asks(self) -> int:
        """It is asked nothing."""
        return 0

    @property
    def tells(self) -> int:
        """What it tells lies world by world (`no_views`)."""
        return 0

    @property
    def room(self) -> int:
        """It needs none."""
        return 0

    @property
    def slots(self) -> int:
        """It keeps nothing."""
        return 1

    def write(self, scopes: ScopeProgram, numbers: Lanes, room: Lanes, count: Value) -> None:
        """Tell where the cameras are, and how the axes lie as far as they are looked at."""
        program, xp, layout = scopes.program, scopes.program.xp, scopes.layout
        view = OwnRows(program, scopes.told, scopes.first_world, (layout.nodes + 1) * VIEW)
        for name, slot in _GIVEN.items():
            view.put(slot, [scopes.world(name)])
        arc = tip_arc(scopes)
        view.put(ARC, [arc])
        view.put(EYE, scopes.seen.vector(seen_slot("tip")))
        rows = [scopes.seen.vector(seen_slot("tip_frame") + 3 * row) for row in range(3)]
        up, left, ahead = (tuple(row[axis] for row in rows) for axis in range(3))
        view.put(RIGHT, left)
        view.put(UP, up)
        view.put(BACKWARDS, times(-1.0, (ahead[0], ahead[1], ahead[2])))
        view.put(RADIUS, [scopes.scope("radius")])
        if not scopes.axis:
            return
        known = xp.minimum(scopes.axis.shape(arc + self.reach), layout.nodes)
        view.put(KNOWN, [program.real_of(known)])
        view.put(SPACING, [scopes.world("spacing")])
        with program.loop(0, known) as node:
            view.put((node + 1) * VIEW, scopes.axis.lying(node))
