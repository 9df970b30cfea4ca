"""Opening a collapsed lumen.

The lumen becomes the union of what it was with all balls about its middle: the points whose distance to the middle line
is less than a wanted radius. Assumptions, also stated in the colon's warnings: what is collapsed opens round about its
own middle; nothing that is open moves or grows; the wall keeps its other shape; loops keep a wall between them. Tissue
stretch and the shift of neighbouring organs are not modelled.
"""

import re
from dataclasses import dataclass, replace

import manifold3d
import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.spatial import KDTree

from haustra.errors import InvalidMeshError, InvalidOptionError
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.landmarks import segment_names
from haustra.models.anatomy.mesh_colon import ANGLES, STATION_STEP
from haustra.models.anatomy.passage import narrow_places, passage_of
from haustra.models.anatomy.properties import Clearance, surface_samples
from haustra.models.anatomy.rays import LumenRays, lumen_table
from haustra.models.anatomy.repair import genus, is_watertight
from haustra.models.gas.law import MMHG
from haustra.models.gas.numbers import diameter_share, full_diameters, gas_numbers

PRESSURE_UNITS = {"mmHg": MMHG, "kPa": 1e3, "Pa": 1.0}
"""Pascals in one unit."""
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""Metres in one unit."""
WIDEST = 0.09
"""Widest opening [m]: an upper normal caecum."""
WALL = 2e-3
"""Least wall that stays between two loops [m]: thin, distended wall has 0-2 mm, and here are two."""
LOOP = 2.0
"""Wall farther along than this many wanted radii belongs to another loop: on a straight stretch it is out of reach."""
MARGIN = 4e-4
"""The balls are larger than asked by this [m]: their facets and the samples of the surface must not show."""
BALL_SEGMENTS = 24
"""Segments round each ball."""
TAPER = 0.01
"""Arc length over which an opening widens [m]."""


@dataclass(frozen=True)
class Opening:
    """What was asked: a diameter everywhere, or a pressure."""

    diameter: float | None = None
    """Largest ball that must pass everywhere [m]."""
    pressure: float | None = None
    """Gas pressure [Pa]."""


def opening_from(text: str) -> Opening:
    """Read '14mm', '20mmHg' or '2.7kPa'.

    Raises:
        InvalidOptionError: when it is neither a diameter nor a pressure, or beyond what a colon bears.
    """
    match = re.fullmatch(r"\s*([0-9.]+(?:e-?[0-9]+)?)\s*([A-Za-z]+)\s*", text)
    unit = match.group(2) if match else ""
    try:
        number = float(match.group(1)) if match else float("nan")
    except ValueError:
        number = float("nan")
    if unit in LENGTH_UNITS and 0 < number * LENGTH_UNITS[unit] <= WIDEST:
        return Opening(diameter=number * LENGTH_UNITS[unit])
    highest = gas_numbers()["pain_pressure"]
    if unit in PRESSURE_UNITS and 0 < number * PRESSURE_UNITS[unit] <= highest:
        return Opening(pressure=number * PRESSURE_UNITS[unit])
    raise InvalidOptionError(
        f"'{text}' is no opening: give a diameter up to {WIDEST * 1e3:.0f} mm ('14mm') or a pressure up to "
        f"{highest / 1e3:.0f} kPa, which hurts ('20mmHg', '2.7kPa')."
    )


def pressure_from(text: str) -> float:
    """Read '20mmHg' or '2.7kPa' as a pressure [Pa].

    Raises:
        InvalidOptionError: when it is none.
    """
    pressure = opening_from(text).pressure
    if pressure is None:
        raise InvalidOptionError(f"'{text}' is no pressure: give '20mmHg' or '2.7kPa'.")
    return pressure


def insufflated(colon: Colon, opening: Opening) -> Colon:
    """Open the lumen where it is narrower than asked.

    Raises:
        InvalidMeshError: when a neighbouring loop leaves no room, or loops would merge.
    """
    passage = passage_of(colon)
    wanted = _wanted(colon, opening)
    narrow = passage.diameter < wanted
    if not narrow.any():
        return replace(colon, warnings=(*colon.warnings, "Insufflation: the lumen is as wide as asked everywhere."))
    middle = gaussian_filter1d(passage.centres, 2.0, axis=0, mode="nearest")
    room = _room(colon, middle, narrow, wanted)
    if opening.diameter is not None:
        _check_room(colon, room, wanted)
    wanted = np.maximum(np.minimum(wanted, room), passage.diameter * narrow)
    grow = int(np.ceil(TAPER / STATION_STEP))
    opened = np.flatnonzero(np.convolve(narrow, np.ones(2 * grow + 1), "same") > 0)
    radius = np.where(narrow, wanted / 2, np.minimum(wanted, passage.diameter) / 2) + MARGIN
    surface = _union(colon.lumen, middle, radius, opened)
    if not is_watertight(surface.faces) or genus(surface.faces) > genus(colon.lumen.faces):
        raise InvalidMeshError("Opening the lumen that far would merge loops that touch: ask for less.")
    return _measured(colon, surface, middle, narrow, opening, passage.diameter)


def _wanted(colon: Colon, opening: Opening) -> Float[np.ndarray, " stations"]:
    """Diameter of the ball that must pass at each station [m]; without a sudden step from segment to segment."""
    arc = colon.centreline.arc
    if opening.diameter is not None:
        return np.full(len(arc), opening.diameter)
    assert opening.pressure is not None
    opened = {name: wide * diameter_share(np, name, opening.pressure) for name, wide in full_diameters().items()}
    steps = np.array([opened[name] for name in segment_names(colon.segments, arc)])
    # The largest ball between folds is narrower than the diameter of equal volume.
    return gas_numbers()["ball_share"] * gaussian_filter1d(steps, TAPER / STATION_STEP, mode="nearest")


def _room(colon: Colon, middle: np.ndarray, narrow: np.ndarray, wanted: np.ndarray) -> Float[np.ndarray, " stations"]:
    """Largest diameter [m] that leaves a wall to other loops at each narrow station; infinite elsewhere."""
    line = colon.centreline
    samples = surface_samples(colon.lumen, 2 * STATION_STEP)
    arc = line.arc[KDTree(line.points).query(samples)[1]]
    tree = KDTree(samples)
    room = np.full(len(line.arc), np.inf)
    for station in np.flatnonzero(narrow):
        near = np.array(tree.query_ball_point(middle[station], wanted[station] / 2 + WALL), dtype=np.int64)
        other = near[np.abs(arc[near] - line.arc[station]) > LOOP * wanted[station] / 2 + STATION_STEP]
        if len(other):
            gap = float(np.linalg.norm(samples[other] - middle[station], axis=1).min())
            room[station] = 2 * max(gap - WALL, 0.0)
    return room


def _check_room(colon: Colon, room: np.ndarray, wanted: np.ndarray) -> None:
    """Refuse where another loop lies within the opened lumen and a wall."""
    station = int((room - wanted).argmin())
    if room[station] < wanted[station]:
        raise InvalidMeshError(
            f"At {colon.centreline.arc[station]:.3f} m along the colon another loop leaves room for "
            f"{room[station] * 1e3:.1f} mm only: the lumen cannot be opened "
            f"to {wanted[station] * 1e3:.1f} mm without merging loops."
        )


def _union(lumen: Surface, middle: np.ndarray, radius: np.ndarray, opened: np.ndarray) -> Surface:
    """The lumen with the hulls of neighbouring balls along the opened stations."""
    mesh = manifold3d.Mesh64(
        vert_properties=np.ascontiguousarray(lumen.vertices), tri_verts=lumen.faces.astype(np.uint64)
    )
    # A ball of facets is inside the round one by this share at most.
    out = 1 / np.cos(np.pi / BALL_SEGMENTS)
    balls = {
        int(k): manifold3d.Manifold.sphere(float(radius[k] * out), BALL_SEGMENTS).translate(middle[k].tolist())
        for k in opened
    }
    parts = [
        manifold3d.Manifold.batch_hull([balls[int(k)], balls[int(k) + 1]]) for k in opened if int(k) + 1 in balls
    ] or list(balls.values())
    solid = manifold3d.Manifold.batch_boolean([manifold3d.Manifold(mesh), *parts], manifold3d.OpType.Add)
    result = solid.to_mesh64()
    faces = np.asarray(result.tri_verts).astype(np.int64)
    return Surface(np.asarray(result.vert_properties)[:, :3].copy(), faces)


def _measured(
    colon: Colon, surface: Surface, middle: np.ndarray, narrow: np.ndarray, opening: Opening, before: np.ndarray
) -> Colon:
    """The colon with the new surface: the centreline goes through the middle of what was opened."""
    weight = gaussian_filter1d(minimum_filter1d(narrow.astype(float), 1), TAPER / STATION_STEP, mode="nearest")
    weight = np.clip(2 * weight, 0.0, 1.0)[:, None]
    points = gaussian_filter1d(colon.centreline.points * (1 - weight) + middle * weight, 1.0, axis=0, mode="nearest")
    rays = LumenRays(surface)
    line = centreline_through(points, STATION_STEP)
    if not rays.clear(line.points[:-1], line.points[1:]).all():
        raise InvalidMeshError("The centreline of the opened lumen would cross its wall: ask for another diameter.")
    scale = line.length / colon.centreline.length
    segments = tuple(replace(s, start=s.start * scale, end=s.end * scale) for s in colon.segments)
    asked = (
        f"{opening.diameter * 1e3:.1f} mm"
        if opening.diameter is not None
        else f"{(opening.pressure or 0) / 1e3:.2f} kPa"
    )
    opened = Colon(
        name=colon.name,
        lumen=surface,
        centreline=line,
        radius=lumen_table(rays, line.points, line.frames, ANGLES),
        segments=segments,
        provenance=replace(colon.provenance, configuration={**colon.provenance.configuration, "insufflate": asked}),
        landmarks={name: place * scale for name, place in colon.landmarks.items()},
        warnings=colon.warnings,
        lesions=colon.lesions,
    )
    note = (
        f"Insufflated to {asked}: {narrow.mean():.0%} of the length was opened round about its middle, the narrowest "
        f"place from {before.min() * 1e3:.1f} to {2e3 * float(Clearance(surface)(line.points).min()):.1f} mm. "
        "Assumed: nothing else moves or grows."
    )
    if opening.diameter is not None and (left := narrow_places(opened, passage_of(opened), opening.diameter)):
        worst = min(left, key=lambda place: place.diameter)
        raise InvalidMeshError(
            f"After opening, {worst.diameter * 1e3:.1f} mm remain at {worst.narrowest:.3f} m: ask for more."
        )
    return replace(opened, warnings=(*colon.warnings, note))
