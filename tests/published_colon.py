"""EdinGCA_3D_00020 as published (Gut Cell Atlas, CC BY 4.0), and how far an imported colon is from it.

`python tests/published_colon.py` prints the figures of docs/validation/input.md, in four minutes, `... powers` those
of centrelines by the power of their clearance, and `... cloud` those of the colon from points on its surface;
tests/models/anatomy/test_published_colon.py holds the first.
"""

import json
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import KDTree

from haustra.models.anatomy import route
from haustra.models.anatomy.colon import Centreline, Colon, Surface
from haustra.models.anatomy.frames import arc_length, smooth
from haustra.models.anatomy.label_colon import import_label_map
from haustra.models.anatomy.lumen_grid import LumenGraph, lumen_graph, surface_samples
from haustra.models.anatomy.mesh_colon import import_colon
from haustra.models.anatomy.rays import LumenRays
from haustra.models.anatomy.repair import signed_volume
from haustra.models.anatomy.section import effective_diameter

NAME = "EdinGCA_3D_00020"
VOXEL_MM = (0.80859, 0.80859, 0.7)
SIDE = np.array(VOXEL_MM) * 1e-3
"""Sides of a voxel of the published CT [m]."""
PUBLISHED_LENGTH = 2.198
"""Anus to tip of the appendix, smoothed by 8 mm [m]."""
SMOOTHING = 8
"""Standard deviation of that smoothing [rows of the table, 1 mm]."""
LANDMARKS = {
    "descending_sigmoid_junction": 1367,
    "splenic_flexure": 2441,
    "hepatic_flexure": 3666,
    "caecum": 4139,
    "appendix_orifice": 4274,
}
"""Index in the published path, which has 4,337 steps."""
STEPS = 4337
SPREAD = 2.0
"""Standard deviation over which the published table spreads the volume of each of its stations [mm]: found by trial."""
EVERY = 7
"""Step between those samples of a surface, 1 mm apart, that are looked for on the other."""
CLOUD = 200_000
"""Points on the surface, evenly spread at random."""
POWERS = (2, 3, 4, 5, 6, 8)
"""Powers of the clearance in the cost of a centreline, that are compared."""
ENDS = 0.05
"""What is left out of comparisons of radii at either end [m]."""


@dataclass(frozen=True)
class Published:
    """The published path and its table."""

    path: np.ndarray
    """Points, 1 mm apart [m]."""
    smoothed: np.ndarray
    """Points of the published path, smoothed by 8 mm [m]."""
    arc: np.ndarray
    """Arc length along the smoothed path [m]."""
    radius: np.ndarray
    """Effective radius [m]."""

    def row(self, landmark: str) -> int:
        return round(LANDMARKS[landmark] / STEPS * (len(self.path) - 1))

    def stations(self, line: Centreline) -> np.ndarray:
        """Nearest station of a centreline to each point of the smoothed path."""
        return np.asarray(KDTree(line.points).query(self.smoothed)[1])


def published(data: Path) -> Published:
    table = np.genfromtxt(data / "colons" / f"{NAME}_centreline_mm.csv", delimiter=",", names=True)
    path = np.column_stack([table["x_mm"], table["y_mm"], table["z_mm"]]) * 1e-3
    smoothed = smooth(path, SMOOTHING)
    return Published(path, smoothed, arc_length(smoothed), table["effective_diameter_mm"] / 2e3)


def from_stl(data: Path) -> Colon:
    return import_colon(data / "colons" / f"{NAME}_lumen_mm.stl", units="mm", name=NAME)


def from_pieces(data: Path) -> Colon:
    files = sorted((data / "colons" / "raw_00020").glob("*.vtk"))
    return import_colon(files, units="voxel", spacing_mm=VOXEL_MM, name="raw pieces")


def lengths(colon: Colon, known: Published) -> dict[str, float]:
    """Shares by which the centreline is longer than the published one, and how far its ends are from its places."""
    line = colon.centreline
    first, last = np.asarray(KDTree(known.smoothed).query(line.points[[0, -1]])[1])
    orifice = known.smoothed[known.row("appendix_orifice")]
    return {
        "length_m": line.length,
        "whole": line.length / PUBLISHED_LENGTH - 1,
        "between_same_ends": line.length / float(known.arc[last] - known.arc[first]) - 1,
        "from_anus_mm": float(np.linalg.norm(line.points[0] - known.path[0])) * 1e3,
        "from_appendix_orifice_mm": float(np.linalg.norm(line.points[-1] - orifice)) * 1e3,
        "steepest_step_back_mm": float(np.diff(line.arc[known.stations(line)]).min()) * 1e3,
    }


def radii(colon: Colon, known: Published, graph: LumenGraph | None = None) -> dict[str, float]:
    """Differences of effective radii [mm]: as they stand, by the published definition, and per length of one line.

    `graph` is the lumen filled with points, where an import has done so already.
    """
    line, own = colon.centreline, effective_diameter(colon.centreline, colon.radius) / 2
    at = line.arc[known.stations(line)]
    inner = (at > ENDS) & (at < line.length - ENDS)
    plain = np.interp(at, line.arc, own) - known.radius

    graph = graph or lumen_graph(colon.lumen, volume=signed_volume(colon.lumen.vertices, colon.lumen.faces))
    share = np.bincount(KDTree(known.path).query(graph.points)[1], minlength=len(known.path)) * graph.spacing**3
    again = np.sqrt(gaussian_filter1d(share, SPREAD) / 1e-3 / np.pi) - known.radius

    found = {
        "as_they_stand": _rms(plain[inner]),
        "as_they_stand_bias": float(plain[inner].mean()) * 1e3,
        "by_their_definition": _rms(again[inner]),
        "by_their_definition_bias": float(again[inner].mean()) * 1e3,
    }
    for window in (0.01, 0.02):
        off = _per_length(line, own, at, known, window)
        found[f"per_same_length_{window * 1e3:.0f}_mm"] = _rms(off)
        found[f"per_same_length_{window * 1e3:.0f}_mm_bias"] = float(off.mean()) * 1e3
    return found


def _per_length(line: Centreline, own: np.ndarray, at: np.ndarray, known: Published, window: float) -> np.ndarray:
    """Difference of radii [m] when both volumes within `window` [m] of the centreline are divided by that length."""
    first = np.unique(at, return_index=True)[1]
    table = np.concatenate([[0.0], np.cumsum(np.pi * known.radius[1:] ** 2 * 1e-3)])
    volume = np.concatenate([[0.0], np.cumsum(np.pi * own[1:] ** 2 * np.diff(line.arc))])
    middle = line.arc[(line.arc > ENDS) & (line.arc < line.length - ENDS)]
    ends = np.array([middle - window / 2, middle + window / 2])
    ours = np.diff(np.interp(ends, line.arc, volume), axis=0)[0]
    theirs = np.diff(np.interp(ends, at[first], table[first]), axis=0)[0]
    return np.sqrt(ours / window / np.pi) - np.sqrt(theirs / window / np.pi)


def apart(one: Colon, other: Colon, *, every: int = EVERY) -> dict[str, float]:
    """Distances between two colons' surfaces and centrelines [mm]."""
    samples = [surface_samples(colon.lumen, 1e-3) for colon in (one, other)]
    trees = [KDTree(points, leafsize=32) for points in samples]
    samples = [points[::every] for points in samples]
    there, back = trees[1].query(samples[0])[0], trees[0].query(samples[1])[0]
    lines = KDTree(one.centreline.points).query(other.centreline.points)[0]
    found = {}
    for name, distance in (("one_to_other", there), ("other_to_one", back), ("centrelines", lines)):
        for share in (50, 90, 95, 100):
            found[f"{name}_p{share}"] = float(np.percentile(distance, share)) * 1e3
    far = samples[1][back > 1e-3]
    far = far[np.random.default_rng(0).choice(len(far), min(len(far), 4000), replace=False)] if len(far) else far
    found["one_beyond_a_voxel"] = float((there > np.linalg.norm(SIDE)).mean())
    found["other_within_1_mm"] = float((back <= 1e-3).mean())
    found["one_within_1_mm"] = float((there <= 1e-3).mean())
    found["of_the_rest_inside_one"] = float(inside(one.lumen, far).mean()) if len(far) else 1.0
    return found


def inside(surface: Surface, points: np.ndarray) -> np.ndarray:
    """Whether points lie inside a closed surface: a ray to infinity crosses it an odd number of times."""
    rays, direction = LumenRays(surface), np.array([0.3, 0.5, 0.81])
    direction /= np.linalg.norm(direction)
    crossed, at, going = np.zeros(len(points), int), points.copy(), np.arange(len(points))
    while len(going):
        reach = rays.cast(at[going], np.broadcast_to(direction, (len(going), 1, 3)))[:, 0]
        going, reach = going[np.isfinite(reach)], reach[np.isfinite(reach)]
        crossed[going] += 1
        at[going] += (reach[:, None] + 1e-7) * direction
    return crossed % 2 == 1


def voxelised(surface: Surface, low: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Voxels of the published CT, from `low` [m] on, whose centres lie inside a closed surface."""
    x, y = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
    start = low[:2] + SIDE[:2] * np.column_stack([x.ravel(), y.ravel()])
    mask, due = np.zeros((x.size, shape[2]), bool), np.arange(x.size)
    rays, bottom = LumenRays(surface), float(surface.vertices[:, 2].min() - SIDE[2])
    while len(due):
        crossed = _crossed(rays, np.column_stack([start[due], np.full(len(due), bottom)]), float(low[2]), shape[2])
        mask[due] = np.cumsum(crossed[:, :-1], axis=1) % 2 == 1
        # A line that slips through between two triangles crosses oddly often: it is cast again beside itself.
        due = due[crossed.sum(axis=1) % 2 == 1]
        start[due] += 1e-5
    return mask.reshape(shape)


def _crossed(rays: LumenRays, at: np.ndarray, low: float, layers: int) -> np.ndarray:
    """How often the lines upwards from those places cross the surface below each layer, and above the last."""
    crossed, going = np.zeros((len(at), layers + 1), np.int8), np.arange(len(at))
    while len(going):
        reach = rays.cast(at[going], np.broadcast_to([0.0, 0.0, 1.0], (len(going), 1, 3)))[:, 0]
        going, reach = going[np.isfinite(reach)], reach[np.isfinite(reach)]
        at[going, 2] += reach + 1e-7
        layer = np.clip(np.ceil((at[going, 2] - low) / SIDE[2]), 0, layers).astype(int)
        crossed[going, layer] += 1
    return crossed


def label_map_of(colon: Colon, file: Path) -> Path:
    """Write a colon's lumen as a label map of the published CT's voxels."""
    import SimpleITK as sitk

    low = colon.lumen.vertices.min(0) - 2.5 * SIDE
    shape = tuple(int(n) for n in np.ceil((colon.lumen.vertices.max(0) - low) / SIDE) + 2)
    mask = voxelised(colon.lumen, low, (shape[0], shape[1], shape[2]))
    image = sitk.GetImageFromArray(mask.astype(np.uint8).transpose(2, 1, 0))
    image.SetSpacing(VOXEL_MM)
    image.SetOrigin((low * 1e3).tolist())
    sitk.WriteImage(image, str(file), True)
    return file


def from_label_map(colon: Colon) -> tuple[Colon, float]:
    """How a colon comes back from a label map of the published CT's voxels, and in how many seconds."""
    with tempfile.TemporaryDirectory() as folder:
        file, began = label_map_of(colon, Path(folder) / "labels.nii.gz"), time.process_time()
        return import_label_map(file), time.process_time() - began


def cloud_of(colon: Colon, file: Path) -> Path:
    """Write points spread at random over a colon's lumen surface [mm]."""
    corners, random = colon.lumen.vertices[colon.lumen.faces], np.random.default_rng(0)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    face = random.choice(len(area), CLOUD, p=area / area.sum())
    np.savetxt(file, np.einsum("nk,nkd->nd", random.dirichlet(np.ones(3), CLOUD), corners[face]) * 1e3, fmt="%.4f")
    return file


def from_cloud(data: Path) -> dict[str, object]:
    """How the colon comes back from points on its surface: measures, radius along its length, distances."""
    stl = from_stl(data)
    with tempfile.TemporaryDirectory() as folder:
        file, began = cloud_of(stl, Path(folder) / "cloud.xyz"), time.process_time()
        cloud = import_colon(file, units="mm", cloud=True)
        seconds = time.process_time() - began
    line, own = cloud.centreline, effective_diameter(cloud.centreline, cloud.radius) / 2
    known = effective_diameter(stl.centreline, stl.radius) / 2
    station = KDTree(stl.centreline.points).query(line.points)[1]
    off = (own - known[station])[(line.arc > ENDS) & (line.arc < line.length - ENDS)]
    return {
        "length_m": {"STL": stl.centreline.length, "cloud": line.length},
        "volume_l": {
            name: signed_volume(colon.lumen.vertices, colon.lumen.faces) * 1e3
            for name, colon in (("STL", stl), ("cloud", cloud))
        },
        "lengths": {"STL": lengths(stl, published(data)), "cloud": lengths(cloud, published(data))},
        "radius_rms_mm": _rms(off),
        "radius_bias_mm": float(off.mean()) * 1e3,
        "STL (one) and cloud (other)": apart(stl, cloud, every=1),
        "seconds": seconds,
    }


def by_power(data: Path) -> dict[str, dict[str, float]]:
    """How far centrelines of two patients are from the published ones, by the power of the clearance in their cost."""
    found, usual = {}, route.CENTRING_POWER
    for name in (NAME, "HuBMAPVHM_3D_00070"):
        table = np.genfromtxt(data / "colons" / f"{name}_centreline_mm.csv", delimiter=",", names=True)
        known = smooth(np.column_stack([table["x_mm"], table["y_mm"], table["z_mm"]]) * 1e-3, SMOOTHING)
        for power in POWERS:
            route.CENTRING_POWER = power
            line = import_colon(data / "colons" / f"{name}_lumen_mm.stl", units="mm").centreline
            first, last = np.asarray(KDTree(known).query(line.points[[0, -1]])[1])
            between = known[first : last + 1]
            found[f"{name}, power {power}"] = {
                "between_same_ends": line.length / float(arc_length(between)[-1]) - 1,
                "distance_mean_mm": float(KDTree(line.points).query(between)[0].mean()) * 1e3,
            }
    route.CENTRING_POWER = usual
    return found


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean())) * 1e3


def main() -> None:
    data = Path(__file__).parents[2] / "shared" / "data"
    if sys.argv[1:] == ["powers"]:
        json.dump(by_power(data), sys.stdout, indent=1)
        return
    if sys.argv[1:] == ["cloud"]:
        json.dump(from_cloud(data), sys.stdout, indent=1)
        return
    known, t = published(data), [time.process_time()]
    stl = from_stl(data)
    t.append(time.process_time())
    raw = from_pieces(data)
    t.append(time.process_time())
    labels, seconds = from_label_map(stl)
    raw_labels, _ = from_label_map(raw)
    colons = (("STL", stl), ("raw pieces", raw), ("label map", labels), ("label map of the raw pieces", raw_labels))
    json.dump(
        {
            "lengths": {name: lengths(colon, known) for name, colon in colons},
            "radii_mm": {name: radii(colon, known) for name, colon in colons},
            "STL (one) and raw pieces (other)": apart(stl, raw),
            "STL (one) and label map (other)": apart(stl, labels),
            "raw pieces (one) and their label map (other)": apart(raw, raw_labels, every=1),
            "seconds": {"STL": t[1] - t[0], "raw pieces": t[2] - t[1], "label map": seconds},
        },
        sys.stdout,
        indent=1,
    )


if __name__ == "__main__":
    main()
