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
from haustra.models.wall.planes import SLIP_RELAXATION, PlaneWall


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
        self._solref, self._solimp = np.zeros((len(names), len(spheres), 2)), np.zeros((len(names), len(spheres), 5))
        for row, (name, value) in enumerate(zip(names, self._stiffness, strict=True)):
            law = replace(usual, stiffness=float(value), damping=usual.damping / usual.stiffness * float(value))
            for sphere, inverse in enumerate(inertia):
                self._solref[row, sphere], self._solimp[row, sphere] = contact_parameters(
                    float(inverse), law, timestep=model.opt.timestep, where=name
                )
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
        solref, pairs = self._solref[segment, spheres], self._pairs[spheres]
        self._model.pair_solref[pairs] = solref[:, None]
        self._model.pair_solimp[pairs] = self._solimp[segment, spheres][:, None]
        self._model.pair_solreffriction[pairs, 1] = SLIP_RELAXATION * solref[:, None, 1]
