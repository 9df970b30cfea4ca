"""The tracked robot as it is built, for pictures: toothed belts, strut beams and tips, bellows, core, lens and lamps.

Nothing here touches, weighs or moves by itself: shapes go with core and struts. A bellows is drawn at its length in the
nominal diameter; more or less of it stands in the core's slot as its strut moves.
"""

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.devices.tracked.design import TrackedDesign

GROUP = 0
"""Geom group of what is drawn; MuJoCo's viewer shows it."""
HIDDEN = 3
"""Geom group of what touches and is drawn otherwise; MuJoCo's viewer hides it."""
_RUBBER, _STEEL, _SILICONE = [0.16, 0.17, 0.19, 1.0], [0.72, 0.74, 0.78, 1.0], [0.86, 0.52, 0.20, 1.0]
_SHELL, _GLASS, _LAMP = [0.30, 0.38, 0.50, 1.0], [0.10, 0.16, 0.30, 1.0], [1.0, 0.98, 0.85, 1.0]
_FOLDS = 5
"""Folds of a bellows; engineering choice, as every shape here that the paper does not give."""
_AROUND = 20


def draw_core(spec: mujoco.MjSpec, core: mujoco.MjsBody, design: TrackedDesign, *, prefix: str) -> None:
    """Add the core's shell with its slots for bellows, the lens and two lamps in its nose."""
    half, radius = design.core_length / 2, design.core_diameter / 2
    _cylinder(core, f"{prefix}shell", [-half, 0, 0], [half, 0, 0], radius, _SHELL)
    for side, end in (("rear", -half), ("front", half)):
        core.add_geom(
            name=f"{prefix}{side}_cap",
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            pos=[end, 0, 0],
            size=[radius, radius, radius],
            rgba=_SHELL if side == "rear" else _STEEL,
            **_drawn(),
        )
        _cylinder(core, f"{prefix}{side}_ring", [0.96 * end, 0, 0], [end, 0, 0], 1.04 * radius, _STEEL)
    _ball(core, f"{prefix}lens", [half + 0.80 * radius, 0, 0], 0.30 * radius, _GLASS)
    for side in (-1, 1):
        place = [half + 0.78 * radius, side * 0.52 * radius, 0]
        _ball(core, f"{prefix}lamp{'left' if side > 0 else 'right'}", place, 0.14 * radius, _LAMP)
    hub = [-half - 0.5 * radius, 0, 0]
    _cylinder(core, f"{prefix}shaft_socket", [-half - 1.25 * radius, 0, 0], hub, 0.28 * radius, _RUBBER)


def draw_strut(
    spec: mujoco.MjSpec,
    strut: mujoco.MjsBody,
    design: TrackedDesign,
    *,
    track: int,
    runs: list[tuple[tuple[float, float], tuple[float, float]]],
    prefix: str,
) -> None:
    """Add one track's belt, the beam with its two tips, their links and the bellows.

    Args:
        spec: the scene; belt and bellows are meshes that all tracks share.
        strut: the track's body, whose origin lies in the tread's outer face.
        design: the robot.
        track: its number.
        runs: of the tread's loop, from rear to front: middle lines of its capsules, forwards and outwards [m].
        prefix: before every name.
    """
    name, tread, core = f"{prefix}strut{track}", design.tread, design.core_diameter / 2
    rise = design.nominal_diameter / 2 - 0.75 * core
    if track == 0:
        line = np.array([runs[0][0], *(front for _, front in runs)])
        # Into the core, where the worm meshes with it.
        line = np.array([line[0] - [0, 0.6 * core], *line, line[-1] - [0, 0.6 * core]])
        _mesh(spec, f"{prefix}belt", *_belt(line, design))
        _mesh(spec, f"{prefix}bellows", *_bellows(rise - 3 * tread.tip_radius, 0.42 * core))
    for part, rgba in (("belt", _RUBBER), ("bellows", _SILICONE)):
        geom = strut.add_geom(
            name=f"{name}_{part}",
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"{prefix}{part}",
            rgba=rgba,
            **_drawn(),
        )
        geom.pos = [0, 0, -3 * tread.tip_radius if part == "bellows" else 0]
    half, across = tread.tip_spacing / 2, 0.6 * tread.width
    deep = -tread.belt_thickness - tread.tooth_height - tread.tip_radius
    for tip, along in (("rear", -half), ("front", half)):
        _cylinder(strut, f"{name}_{tip}_tip", [along, -across, deep], [along, across, deep], tread.tip_radius, _STEEL)
        for side in (-1, 1):
            foot = [0.35 * along, side * across, -rise]
            top = [along, side * across, deep]
            _cylinder(strut, f"{name}_{tip}_link{side}", foot, top, 0.45 * tread.tip_radius, _STEEL)
    for side in (-1, 1):
        ends = [-half, side * across, deep], [half, side * across, deep]
        _cylinder(strut, f"{name}_beam{side}", *ends, 0.5 * tread.tip_radius, _STEEL)


def _belt(line: Float[np.ndarray, "corners 2"], design: TrackedDesign) -> tuple[np.ndarray, np.ndarray]:
    """A toothed belt along a line, forwards and outwards, whose teeth end half its width outside the line."""
    tread, ball = design.tread, design.tread.width / 2
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(lengths)])
    edges = _tooth_edges(arc[-1], tread.pitch, tread.tooth_width)
    high = np.array([tall for _, tall in edges], float)
    at = np.array([place for place, _ in edges])
    points = np.column_stack([np.interp(at, arc, axis) for axis in line.T])
    along = np.gradient(np.column_stack([np.interp(at, arc, axis) for axis in line.T]), axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    out = np.column_stack([-along[:, 1], along[:, 0]])
    outer = points + (ball - (1 - high[:, None]) * tread.tooth_height) * out
    inner = points + (ball - tread.tooth_height - tread.belt_thickness) * out
    return _extruded(outer, inner, tread.width / 2)


def _tooth_edges(length: float, pitch: float, width: float) -> list[tuple[float, bool]]:
    """Places along a belt where its outer face rises to a tooth or falls from it."""
    found = [(0.0, False)]
    for number in range(int(length / pitch)):
        begin = (number + 0.5) * pitch - width / 2
        flank = 0.12 * width
        found += [(begin, False), (begin + flank, True), (begin + width - flank, True), (begin + width, False)]
    return [*found, (length, False)]


def _extruded(outer: np.ndarray, inner: np.ndarray, half: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed strip between two lines of points, forwards and outwards, from one side to the other."""
    rings = []
    for (x, z), (u, w) in zip(outer, inner, strict=True):
        rings.append([[x, -half, z], [x, half, z], [u, half, w], [u, -half, w]])
    return _skin(np.array(rings))


def _bellows(length: float, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Folds about the axis from 0 to -length [m]."""
    count = 4 * _FOLDS + 1
    depth = np.linspace(0.0, -length, count)
    wave = radius * (0.82 + 0.18 * np.sin(np.linspace(0, 2 * np.pi * _FOLDS, count) - np.pi / 2))
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    rings = [[[r * np.cos(a), r * np.sin(a), z] for a in angle[::-1]] for r, z in zip(wave, depth, strict=True)]
    return _skin(np.array(rings))


def _skin(rings: Float[np.ndarray, "rings around 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Triangles over rings of points and both ends."""
    count, around = rings.shape[:2]
    ring, k = np.meshgrid(np.arange(count - 1), np.arange(around), indexing="ij")
    here, beside = (ring * around + k).ravel(), (ring * around + (k + 1) % around).ravel()
    sides = np.concatenate(
        [np.stack([here, beside, beside + around], 1), np.stack([here, beside + around, here + around], 1)]
    )
    fan = np.arange(1, around - 1)
    first = np.stack([np.zeros_like(fan), fan + 1, fan], 1)
    last = (count - 1) * around + np.stack([np.zeros_like(fan), fan, fan + 1], 1)
    return rings.reshape(-1, 3), np.concatenate([sides, first, last])


def _mesh(spec: mujoco.MjSpec, name: str, vertices: np.ndarray, faces: np.ndarray) -> None:
    mesh = spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.astype(np.int32).ravel())
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    mesh.smoothnormal = False


def _ball(body: mujoco.MjsBody, name: str, place: list[float], radius: float, rgba: list[float]) -> None:
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=place, size=[radius, 0, 0], rgba=rgba, **_drawn())


def _cylinder(
    body: mujoco.MjsBody, name: str, rear: list[float], front: list[float], radius: float, rgba: list[float]
) -> None:
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        fromto=[*rear, *front],
        size=[radius, 0, 0],
        rgba=rgba,
        **_drawn(),
    )


def _drawn() -> dict[str, float]:
    return {"mass": 0.0, "contype": 0, "conaffinity": 0, "group": GROUP}
