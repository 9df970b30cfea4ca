"""The largest load of the wall under a scope over its strength, the worst pain, and where each is."""

from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.state import Readings
from haustra.models.injury.pain import axis_tensions, pain, pressed_tension
from haustra.models.injury.patch import force_on_contact
from haustra.models.injury.perforation import link_load
from haustra.models.wall.mesentery import Mesentery


def largest_load(xp: Any, seen: Readings, *, tip_links: int, diameter: Any, lengths: Any) -> tuple[Any, Any]:
    """Load over the median person's strength [1] and arc length [m], one a world.

    Args:
        xp: numpy or jax.numpy.
        seen: readings of worlds, or of several records: `link_forces`, `link_arcs` and `bend` are used.
        tip_links: links of the bending section, the last ones.
        diameter: of the scope [m]: one number, or one a world.
        lengths: of the links [m].
    """
    forces, bend = contact_forces(xp, xp.asarray(seen.link_forces), xp.asarray(lengths)), xp.asarray(seen.bend)
    of_head = np.arange(forces.shape[-1]) >= forces.shape[-1] - tip_links
    bent = xp.sqrt((bend**2).sum(axis=-1))[..., None]
    return _most(xp, link_load(xp, forces, bent, of_head, xp.asarray(diameter)[..., None]), seen.link_arcs)


def contact_forces(xp: Any, forces: Any, lengths: Any) -> Any:
    """Forces of the wall on the contacts around links [N], by forces on links and their lengths; last axis: links."""
    lengths = xp.broadcast_to(lengths, forces.shape)
    none, some = xp.zeros_like(forces[..., :1]), xp.ones_like(lengths[..., :1])
    before = xp.concatenate([none, forces[..., :-1]], axis=-1), xp.concatenate([some, lengths[..., :-1]], axis=-1)
    after = xp.concatenate([forces[..., 1:], none], axis=-1), xp.concatenate([lengths[..., 1:], some], axis=-1)
    return force_on_contact(xp, forces, lengths, (before, after))


def largest_pain(
    xp: Any,
    seen: Readings,
    *,
    diameter: Any,
    lengths: Any,
    own: Mesentery | None = None,
    radius: Float[Any, "*any nodes"] | None = None,
) -> tuple[Any, Any]:
    """Largest tension of wall or mesentery over that which hurts [1] and arc length [m], one a world.

    Args:
        xp: numpy or jax.numpy.
        seen: readings of worlds: `time`, `link_forces`, `link_arcs` and `displacement` are used.
        diameter: of the scope [m]: one number, or one a world.
        lengths: of the links [m].
        own: the axes of the worlds' colons; None where they are fixed.
        radius: of the lumen at their nodes [m]; of colons that move.
    """
    wall = pressed_tension(xp.asarray(seen.link_forces), xp.asarray(diameter)[..., None], lengths)
    worst = _most(xp, pain(xp, wall, xp.zeros_like(wall)), seen.link_arcs)
    if own is None:
        return worst
    hurts = pain(xp, *axis_tensions(xp, own, xp.asarray(seen.displacement), radius, xp.asarray(seen.time)))
    arcs = xp.asarray(own.spacing)[..., None] * np.arange(hurts.shape[-1])
    held = _most(xp, hurts, xp.broadcast_to(arcs, hurts.shape))
    return xp.maximum(worst[0], held[0]), xp.where(held[0] > worst[0], held[1], worst[1])


def _most(xp: Any, values: Any, arcs: Any) -> tuple[Any, Any]:
    """The largest of values along the last axis, and its arc length, at least 0."""
    worst = values.argmax(axis=-1)[..., None]
    most, arc = (xp.take_along_axis(part, worst, axis=-1)[..., 0] for part in (values, xp.asarray(arcs)))
    return most, xp.maximum(arc, 0.0)
