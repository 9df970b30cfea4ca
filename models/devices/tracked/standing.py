"""A tracked robot standing in a colon, its struts spread to the local lumen."""

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidDesignError, InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.device import Tracked, add_tracked
from haustra.models.devices.tracked.loop import add_contact_sensor
from haustra.models.wall.lumen_table import lumen_table, query

_ROUNDING = 1e-9
"""How far sums of arc lengths may be off by rounding, a tolerance [m]."""
_PLACES = 9
"""Places along the core at which its distance from the wall is looked at; as many spheres stand along it."""


def stand_in_colon(
    spec: mujoco.MjSpec,
    colon: Colon,
    design: TrackedDesign,
    *,
    arc: float,
    friction: float,
    prefix: str = "tracked/",
) -> Tracked:
    """Put a free robot at an arc length of a colon, facing the caecum, each track spread to the wall it faces.

    The spec needs the colon's wall (`build_scene`). Bellows then press each track outwards, so the robot moves off
    centre where the lumen is not round. Treads are closed around the struts, and the core's contact forces are read by
    a sensor of the core's name.

    Args:
        spec: Scene with the wall.
        colon: Its colon.
        design: The robot, at the scale it has in the patient (`TrackedDesign.at_scale`).
        arc: Arc length of the core's centre from the anus [m].
        friction: Coulomb's coefficient between treads and wall.
        prefix: Before every name.

    Raises:
        InvalidOptionError: when the arc length is not inside the colon.
        InvalidDesignError: when the lumen there is narrower or wider, across opposite tracks, than they reach, or
            turns too sharply for the core.
    """
    require_fit(colon, design, arc)
    line, radii = colon.centreline, track_radii(colon, design, arc)
    low, high = design.stroke
    station = int(np.searchsorted(line.arc, arc))
    normal, binormal, tangent = line.frames[station].T
    tracked = add_tracked(
        spec,
        design,
        friction=friction,
        position=tuple(float(np.interp(arc, line.arc, axis)) for axis in line.points.T),
        frame=np.column_stack([tangent, normal, binormal]),
        extension=tuple(float(value) for value in np.clip(radii - design.nominal_diameter / 2, low, high)),
        loops=True,
        prefix=prefix,
    )
    add_contact_sensor(spec, tracked.core)
    return tracked


def require_fit(colon: Colon, design: TrackedDesign, arc: float) -> None:
    """Refuse a place where the robot cannot stand, and name one where it can.

    Raises:
        InvalidOptionError: when the arc length [m] is not inside the colon.
        InvalidDesignError: when the lumen there is narrower or wider, across opposite tracks, than they reach, or
            turns too sharply for the core.
    """
    line = colon.centreline
    half = design.core_length / 2
    if line.length < design.core_length:
        raise InvalidDesignError(
            f"A robot of {design.core_length * 1e3:.0f} mm is longer than the {line.length * 1e3:.0f} mm of colon "
            f"'{colon.name}': scale the design down."
        )
    if not half <= arc <= line.length - half:
        raise InvalidOptionError(
            f"A robot of {design.core_length * 1e3:.0f} mm cannot stand at {arc * 1e3:.0f} mm of a colon of "
            f"{line.length * 1e3:.0f} mm: give {half * 1e3:.0f} to {(line.length - half) * 1e3:.0f} mm."
        )
    radii = track_radii(colon, design, arc)
    if not _fits(design, radii):
        narrow, wide = np.sort(_widths(radii)) * 1e3
        raise InvalidDesignError(
            f"At {arc * 1e3:.0f} mm of colon '{colon.name}' the lumen is {narrow:.1f} and {wide:.1f} mm wide across "
            f"opposite tracks, which reach {design.smallest_diameter * 1e3:.1f} to "
            f"{design.largest_diameter * 1e3:.1f} mm: {_elsewhere(colon, design, arc)}"
        )
    if (room := float(core_room(colon, design, np.array([arc]))[0])) < 0:
        raise InvalidDesignError(
            f"At {arc * 1e3:.0f} mm of colon '{colon.name}' the lumen turns too sharply for a core of "
            f"{design.core_length * 1e3:.1f} mm, which would stand {-room * 1e3:.1f} mm in the wall: "
            f"{_elsewhere(colon, design, arc)}"
        )


def core_room(colon: Colon, design: TrackedDesign, arcs: Float[np.ndarray, " places"]) -> Float[np.ndarray, " places"]:
    """Least distance of the core's surface from the wall where its centre is at those arc lengths [m].

    It lies along the tangent there: its ends leave a lumen that turns within the core's length. Negative in the wall.
    """
    line, half = colon.centreline, design.core_length / 2
    table = lumen_table(colon, device_radius=design.core_diameter / 2)
    middle = np.stack([np.interp(arcs, line.arc, axis) for axis in line.points.T], axis=-1)
    ways = line.frames[np.searchsorted(line.arc, arcs), :, 2]
    along = np.linspace(-half, half, _PLACES)
    points = middle[:, None] + along[:, None] * ways[:, None]
    # As spheres that have just been put there: one look leaves in bends a share of the way.
    near = query(np, table.tables, points, arcs[:, None] + along).arcs
    return -query(np, table.tables, points, near).depth.max(axis=1)


def track_radii(colon: Colon, design: TrackedDesign, arc: float) -> Float[np.ndarray, " tracks"]:
    """Distance from the centreline to the wall under each track, the least over the strut's length [m]."""
    line = colon.centreline
    near = np.abs(line.arc - arc) <= design.tread.tip_spacing / 2 + design.tread.width / 2
    if not near.any():
        near[int(np.argmin(np.abs(line.arc - arc)))] = True
    angles = colon.radius.shape[1]
    # Track k stands 90 k degrees from the second normal, away from the first.
    columns = [round(angles * (track / TRACKS + 0.25)) % angles for track in range(TRACKS)]
    return colon.radius[near][:, columns].min(0)


def places_that_fit(
    colon: Colon, design: TrackedDesign, arcs: Float[np.ndarray, " places"]
) -> Float[np.ndarray, " fitting"]:
    """Those of some arc lengths [m] at which the tracks reach the wall on both sides and the core has room."""
    wide = np.array([_fits(design, track_radii(colon, design, float(arc))) for arc in arcs], bool)
    fits = arcs[wide]
    for aside in (
        (-_ROUNDING, _ROUNDING) if len(fits) else ()
    ):  # which station's tangent counts, rounding must not decide
        fits = fits[core_room(colon, design, fits + aside) >= 0]
    return fits


def nearest_fit(colon: Colon, design: TrackedDesign, arc: float) -> float:
    """Arc length of the core's centre next to `arc` at which the robot fits and its nose is inside the colon [m].

    Raises:
        InvalidDesignError: when there is none.
    """
    line, half = colon.centreline, design.core_length / 2
    nose = half + design.core_diameter / 2
    fits = places_that_fit(colon, design, line.arc[(line.arc >= half) & (line.arc < line.length - nose)])
    if not len(fits):
        raise InvalidDesignError(f"The robot fits nowhere in colon '{colon.name}': scale the design.")
    return float(min(fits, key=lambda place: abs(place - arc)))


def _widths(radii: Float[np.ndarray, " tracks"]) -> Float[np.ndarray, "2"]:
    """Widths of the lumen across both pairs of opposite tracks [m]: the robot may move off centre between them."""
    return radii[:2] + radii[2:]


def _fits(design: TrackedDesign, radii: Float[np.ndarray, " tracks"]) -> bool:
    widths = _widths(radii)
    return bool(((widths >= design.smallest_diameter) & (widths <= design.largest_diameter)).all())


def _elsewhere(colon: Colon, design: TrackedDesign, arc: float) -> str:
    """What to do: the nearest place that fits, or another scale."""
    try:
        return f"the nearest place that fits is at {1e3 * nearest_fit(colon, design, arc):.0f} mm."
    except InvalidDesignError:
        return "it fits nowhere in this colon; scale the design."
