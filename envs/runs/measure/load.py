"""The largest load of the wall under a scope, over the median person's strength, and where it is."""

from types import ModuleType
from typing import Any

import numpy as np

from haustra.envs.sim.state import Readings
from haustra.models.injury.perforation import link_load


def largest_load(xp: ModuleType, seen: Readings, *, tip_links: int, diameter: Any) -> tuple[Any, Any]:
    """Load over strength [1] and arc length [m], one a world.

    Args:
        xp: numpy or jax.numpy.
        seen: readings of worlds, or of several records: `link_forces`, `link_arcs` and `bend` are used.
        tip_links: links of the bending section, the last ones.
        diameter: of the scope [m]: one number, or one a world.
    """
    forces, arcs, bend = (xp.asarray(part) for part in (seen.link_forces, seen.link_arcs, seen.bend))
    of_head = np.arange(forces.shape[-1]) >= forces.shape[-1] - tip_links
    bent = xp.sqrt((bend**2).sum(axis=-1))[..., None]
    load = link_load(xp, forces, bent, of_head, xp.asarray(diameter)[..., None])
    worst = load.argmax(axis=-1)[..., None]
    most, arc = (xp.take_along_axis(part, worst, axis=-1)[..., 0] for part in (load, arcs))
    return most, xp.maximum(arc, 0.0)
