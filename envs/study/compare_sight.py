"""How much of a colon's mucosa a device's camera had in view on its way, by the cells that episodes count."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.tasks.case import case_of
from haustra.envs.tasks.coverage import LOOK_EVERY, Coverage, camera_in, cameras_at_rest
from haustra.envs.tasks.observation import Placed
from haustra.envs.tasks.sight import Sight
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import entry_of
from haustra.models.wall import vectors
from haustra.models.wall.lumen_table import axis_tables, pick, stack
from haustra.models.wall.moving_colon import back_to_reference


class Looks(NamedTuple):
    """Where a camera was, look by look, in the colon's coordinates."""

    tip: Float[np.ndarray, "looks 3"]
    """Optical centre [m]."""
    frame: Float[np.ndarray, "looks 3 3"]
    """Columns: two axes across the view, and the viewing direction."""
    arc: Float[np.ndarray, " looks"]
    """Arc length next to it [m]."""
    displacement: Float[np.ndarray, "looks nodes 7"]
    """Poses of the colon's axis; no nodes where it is fixed."""


def looked_at(time: Float[np.ndarray, " records"]) -> Any:
    """Numbers of the records that are looks: `LOOK_EVERY` apart, and the last."""
    every = max(1, round(LOOK_EVERY / float(time[0])))
    return np.unique(np.r_[0 : len(time) : every, len(time) - 1])


def mucosa_seen(colon: Colon, looks: Looks, *, view_deg: float, device_radius: float) -> float:
    """Share of a colon's cells that were in view at one look at least (`haustra.envs.tasks.coverage`) [1].

    Args:
        colon: at rest.
        looks: on the way.
        view_deg: full viewing angle [degrees].
        device_radius: of a device that the colon's wall is tabulated for already [m].
    """
    case = case_of(colon, device_radius=device_radius)
    coverage = Coverage([case], Sight([case]), 1, field_of_view_deg=view_deg)
    coverage.begin(0, 0)
    anus, inwards = entry_of(colon)
    back = None
    if looks.displacement.shape[1]:
        worlds = pick(stack([axis_tables(colon)]), np.zeros(len(looks.arc), int))
        back = back_to_reference(np, worlds, np.asarray(looks.displacement, float))

    def at_rest(points: Any, arcs: Any) -> Any:
        """From the anus, whence a case's tables are seen."""
        return ((back(points, arcs) if back else points) - anus) @ inwards

    axes = tuple(vectors.of(looks.frame[:, :, column]) for column in range(3))
    placed = Placed(vectors.of(looks.tip), (axes[0], axes[1], axes[2]), ())
    cameras, share = cameras_at_rest(placed, looks.arc, at_rest), 0.0
    for look in range(len(looks.arc)):
        share, _ = coverage.look(0, 0, camera_in(cameras, look))
    return share
