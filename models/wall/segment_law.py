"""Stiffness by segment: a sphere's tangent planes push back as the wall of the segment does in which the sphere lies.

Pieces cannot do this: a contact's law holds for a link of known inertia and stands with the link, not with the wall,
and a scene of pieces is one file that is not changed while it runs. Planes are moved from outside anyway.
"""

from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.wall.law import WallContact, contact_parameters
from haustra.models.wall.planes import PlaneWall


class SegmentLaw:
    """The contact law of each sphere of one compiled scene, by the arc length at which it touches."""

    def __init__(
        self,
        model: mujoco.MjModel,
        colon: Colon,
        stiffness: Mapping[str, float],
        usual: WallContact,
        wall: PlaneWall,
    ) -> None:
        """Work out the law of every sphere in every segment.

        Args:
            model: The scene; its pairs change as spheres move on.
            colon: Whose segments.
            stiffness: Normal stiffness of a contact by segment [N/m]; of segments not named it is the usual one.
            usual: The law of the whole wall; damping keeps its ratio to stiffness.
            wall: Whose spheres and planes these are.

        Raises:
            InvalidOptionError: when no colon has such a segment, or MuJoCo cannot honour a stiffness.
        """
        names = [segment.name for segment in colon.segments]
        if unknown := [name for name in stiffness if name not in (*names, *SEGMENTS)]:
            raise InvalidOptionError(f"Segment '{unknown[0]}' is not in this colon. There are {', '.join(names)}.")
        spheres = wall.spheres
        self._model, self._spheres, self._pairs = model, spheres, wall.pairs
        self._ends = np.array([segment.end for segment in colon.segments[:-1]])
        self._segment = np.full(len(spheres), -1)
        inertia = model.body_invweight0[model.geom_bodyid[spheres], 0]
        self._stiffness = np.array([stiffness.get(name, usual.stiffness) for name in names])
        damping_time = usual.damping / usual.stiffness
        laws = [replace(usual, stiffness=value, damping=damping_time * value) for value in self._stiffness.tolist()]
        self._laws = [
            contact_parameters(inertia, law, timestep=model.opt.timestep, where=name)
            for name, law in zip(names, laws, strict=True)
        ]
        self.by_geom: Float[np.ndarray, " geoms"] = np.zeros(model.ngeom)
        """Stiffness that each sphere meets now [N/m]; 0 for other geoms."""
        self.follow(np.zeros(len(spheres)))

    def follow(self, arcs: Float[np.ndarray, " spheres"]) -> None:
        """Give every sphere the law of the segment at its arc length [m]."""
        segment = np.searchsorted(self._ends, arcs, side="right")
        spheres = np.flatnonzero(segment != self._segment)
        segment = segment[spheres]
        self._segment[spheres] = segment
        self.by_geom[self._spheres[spheres]] = self._stiffness[segment]
        for sphere, number in zip(spheres.tolist(), segment.tolist(), strict=True):
            law, pairs = self._laws[number], self._pairs[sphere]
            self._model.pair_solref[pairs] = law.solref[sphere]
            self._model.pair_solreffriction[pairs] = law.sliding[sphere]
            self._model.pair_solimp[pairs, :2] = law.impedance[sphere]
