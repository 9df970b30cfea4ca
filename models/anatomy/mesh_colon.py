"""A surface mesh becomes a colon."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidMeshError, InvalidOptionError
from haustra.models.anatomy.centring import lead_to_ends, smooth_inside
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.frames import arc_length, centreline_through, smooth
from haustra.models.anatomy.landmarks import (
    find_landmarks,
    landmark_positions,
    require_near,
    segments_between,
    with_places,
)
from haustra.models.anatomy.lumen_grid import LumenGraph, lumen_graph
from haustra.models.anatomy.mesh_file import read_pieces
from haustra.models.anatomy.points import read_points, surface_through
from haustra.models.anatomy.properties import Clearance
from haustra.models.anatomy.rays import LumenRays, lumen_table
from haustra.models.anatomy.repair import genus, repair, signed_volume
from haustra.models.anatomy.route import farthest_from, lumen_ends, middle_route, nearest_point
from haustra.models.anatomy.section import effective_diameter
from haustra.provenance import Provenance, file_hash

Units = Literal["mm", "cm", "m", "voxel"]
"""Units of a file's coordinates."""
METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
"""Metres in one unit of the file."""
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""glTF files have y up and z towards the viewer; here z is up and -y is the patient's front."""
SHORTEST, LONGEST = 0.8, 2.6
"""Length of a colon [m]: cohorts in assets/numbers/anatomy.toml reach from 0.68 m at laparotomy to 2.6 m by CT."""
STATION_STEP = 2e-3
"""Arc step of the centreline [m]: a tenth of the distance between folds."""
ANGLES = 64
"""Rays around each station: 2 mm apart on the wall of a wide colon."""
END_CLEARANCE = 7e-3
"""The centreline begins and ends where there is this much room [m]: an adult colonoscope's radius, 6.4 mm, and some."""
LONGEST_TRIM = 0.15
"""At most this much is left out at either end [m]: an appendix, or a collapsed anal canal."""
END_GAP = 0.01
"""An end of the lumen that is nearer to the centreline's than this [m] lies beside it, in the corner of a lid."""
STAIRCASE = 3.0
"""Grid points over which a path is smoothed before its length is judged: steps along the grid add up to 8 %."""
END_STRETCH = 0.25
"""Share of the path at either end whose width tells caecum from rectum."""


@dataclass(frozen=True)
class _Path:
    """The way from anus to caecum through the grid."""

    points: Float[np.ndarray, "points 3"]
    notes: tuple[str, ...]


def import_colon(
    files: Path | Sequence[Path],
    *,
    units: Units,
    spacing_mm: tuple[float, float, float] | None = None,
    anus: tuple[float, float, float] | None = None,
    places: Mapping[str, tuple[float, float, float]] | None = None,
    cloud: bool = False,
    name: str | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Colon:
    """Make a colon of a lumen surface in mesh files, or of points on it.

    Args:
        files: The mesh; several files are pieces of one surface. Formats: STL, OBJ, PLY, GLB, VTK legacy and XML.
        units: Units of its coordinates.
        spacing_mm: Size of a voxel along x, y and z [mm]; needed with units 'voxel', refused otherwise.
        anus: Position of the anus in the file's units; found automatically when left out.
        places: Positions of landmarks in the file's units, by name; they override what is found.
        cloud: The files hold points on the surface (also XYZ and CSV): make the surface that they lie on.
        name: What to call the colon; the first file's name when left out.
        progress: Called with the name of each stage as it begins.

    Raises:
        UnreadableFileError: when a file cannot be read as a mesh.
        InvalidMeshError: when the mesh cannot serve as a lumen, or its length is not a colon's in these units.
        InvalidOptionError: when units, spacing, anus or landmarks do not fit.
    """
    files = (files,) if isinstance(files, Path) else tuple(files)
    if not files:
        raise InvalidOptionError("No file is named: name at least one.")
    transform = np.diag(_scale(units, spacing_mm)) @ (Y_UP if files[0].suffix.lower() == ".glb" else np.eye(3))
    named = {"anus": anus} if anus is not None else {}
    positions = landmark_positions({**(places or {}), **named}, transform)
    progress("reading")
    if cloud:
        vertices = read_points(files)
        progress("finding the surface")
        found = surface_through(vertices @ transform.T)
        surface, notes = found.surface, found.notes
    else:
        mesh = read_pieces(files)
        progress("repairing")
        repaired = repair(Surface(vertices=mesh.vertices @ transform.T, faces=mesh.faces))
        surface, notes = repaired.surface, repaired.notes
    configuration = {
        "method": "points" if cloud else "mesh",
        "units": units,
        "spacing_mm": spacing_mm,
        "anus": anus,
        "places": dict(places or {}),
    }
    return colon_from_surface(
        surface,
        name=name or files[0].stem,
        provenance=Provenance(inputs={file.name: file_hash(file) for file in files}, configuration=configuration),
        positions=positions,
        units=units,
        notes=notes,
        progress=progress,
    )


def colon_from_surface(
    surface: Surface,
    *,
    name: str,
    provenance: Provenance,
    positions: Mapping[str, Float[np.ndarray, "3"]] | None = None,
    units: Units = "m",
    notes: tuple[str, ...] = (),
    progress: Callable[[str], None] = lambda stage: None,
) -> Colon:
    """Find centreline, radius field and segments of a closed, outward-wound lumen surface.

    Args:
        surface: The lumen [m].
        name: What to call the colon.
        provenance: Where the surface comes from.
        positions: Positions of landmarks [m] by name, among them perhaps the anus; the others are found automatically.
        units: Units that were assumed, for the message when the scale is not a colon's.
        notes: What was done before, put in front of the colon's warnings.
        progress: Called with the name of each stage as it begins.

    Raises:
        InvalidMeshError: when the surface has no lumen from end to end, its length is not a colon's, or a landmark is
            far from it.
    """
    positions = positions or {}
    assumed = METRES.get(units, 1e-3)
    require_near(
        positions, surface.vertices, {name: scale / assumed for name, scale in METRES.items() if name != units}
    )
    progress("filling the lumen")
    graph = lumen_graph(surface, volume=signed_volume(surface.vertices, surface.faces))
    progress("finding the way through")
    path = _way_through(graph, positions.get("anus"))
    check_length(float(arc_length(smooth(path.points, STAIRCASE))[-1]), units)
    progress("smoothing the centreline")
    rays, clearance = LumenRays(surface), Clearance(surface)
    trimmed = _trim(path.points, clearance(path.points))
    points = lead_to_ends(smooth_inside(trimmed, rays, clearance), rays)
    line = centreline_through(points, STATION_STEP)
    progress("measuring the radius")
    radius = lumen_table(rays, line.points, line.frames, ANGLES)
    landmarks = with_places(find_landmarks(line, effective_diameter(line, radius)), line, positions)
    if handles := genus(surface.faces):
        notes += (f"The surface has {handles} handles: loops or folds touch; the centreline keeps to the widest way.",)
    if graph.dropped:
        notes += (f"{graph.dropped * graph.spacing**3 * 1e6:.1f} mL lie in pockets that nothing joins to the lumen.",)
    return Colon(
        name=name,
        lumen=surface,
        centreline=line,
        radius=radius,
        segments=segments_between(landmarks.places, line.length),
        provenance=provenance,
        landmarks=landmarks.places,
        warnings=(*notes, *path.notes, *_ends_note(path.points, points), *landmarks.notes),
    )


def check_length(length: float, units: Units) -> None:
    """Refuse a length [m] that no colon has, naming the unit that would make it one.

    Raises:
        InvalidMeshError: when the length is not within `SHORTEST` and `LONGEST`.
    """
    if SHORTEST <= length <= LONGEST:
        return
    fitting = [
        unit
        for unit, metres in METRES.items()
        if unit != units and SHORTEST <= length / METRES.get(units, 1e-3) * metres <= LONGEST
    ]
    advice = (
        f"the file is probably in {fitting[0]}" if fitting else "check the units, and that the whole colon is there"
    )
    raise InvalidMeshError(
        f"The lumen is {length:.3g} m long in units '{units}', but a colon is {SHORTEST}-{LONGEST} m: {advice}."
    )


def _scale(units: Units, spacing_mm: tuple[float, float, float] | None) -> Float[np.ndarray, "3"]:
    """Metres in one unit of the file along each axis."""
    if units not in (*METRES, "voxel"):
        raise InvalidOptionError(f"Unit '{units}' is not known. Known: {', '.join((*METRES, 'voxel'))}.")
    if (units == "voxel") != (spacing_mm is not None):
        raise InvalidOptionError("A voxel spacing in mm goes with units 'voxel', and only with them.")
    if spacing_mm is None:
        return np.full(3, METRES[units])
    if not all(np.isfinite(spacing_mm)) or min(spacing_mm) <= 0:
        raise InvalidOptionError(f"Voxel spacing {spacing_mm} mm must be three positive numbers.")
    return np.asarray(spacing_mm, dtype=float) * 1e-3


def _way_through(graph: LumenGraph, anus: Float[np.ndarray, "3"] | None) -> _Path:
    """The middle way from anus to caecum.

    The ends of the lumen are the two points farthest apart inside it. The anus is the lower one (z up), and the
    caecal quarter should be the wider one; a note says so when it is not.
    """
    if anus is not None:
        start = nearest_point(graph, anus)
        route = middle_route(graph, start, farthest_from(graph, start))
        return _Path(graph.points[route], _left_out_note(graph, start, float(arc_length(graph.points[route])[-1])))
    one, other = lumen_ends(graph)
    start, end = sorted((one, other), key=lambda point: graph.points[point, 2])
    route = middle_route(graph, start, end)
    width = graph.clearance[route]
    stretch = max(int(END_STRETCH * len(route)), 1)
    if width[:stretch].mean() <= width[-stretch:].mean():
        return _Path(graph.points[route], ())
    note = "The lower end was taken for the anus (z up), although it is the wider one: name the anus if it is not."
    return _Path(graph.points[route], (note,))


def _left_out_note(graph: LumenGraph, anus: int, way: float) -> tuple[str, ...]:
    """How much of the lumen lies beyond an anus that is not at its end."""
    one, other = lumen_ends(graph)
    whole = middle_route(graph, one, other)
    longest = float(arc_length(graph.points[whole])[-1])
    if longest - way <= LONGEST_TRIM:
        return ()
    return (
        f"The given anus is not at an end of the lumen: the colon begins there, {longest - way:.2f} m of "
        f"{longest:.2f} m are left out.",
    )


def _trim(
    points: Float[np.ndarray, "points 3"], clearance: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "kept 3"]:
    """Leave out what is too narrow for a scope at either end."""
    arc = arc_length(points)
    enough = np.flatnonzero(clearance >= min(END_CLEARANCE, float(np.median(clearance))))
    first = min(enough[0], int(np.searchsorted(arc, LONGEST_TRIM)))
    last = max(enough[-1], int(np.searchsorted(arc, arc[-1] - LONGEST_TRIM)))
    return points[first : last + 1]


def _ends_note(route: Float[np.ndarray, "route 3"], points: Float[np.ndarray, "points 3"]) -> tuple[str, ...]:
    """How far the centreline stays from the two places of the lumen that are farthest apart, if it is far."""
    at_anus, at_caecum = (float(np.linalg.norm(route[end] - points[end])) for end in (0, -1))
    if max(at_anus, at_caecum) < END_GAP:
        return ()
    return (
        f"The centreline begins {at_anus * 1e3:.0f} mm from the anal end of the lumen and stops {at_caecum * 1e3:.0f} "
        "mm from the caecal one (straight), where there is room for a scope.",
    )
