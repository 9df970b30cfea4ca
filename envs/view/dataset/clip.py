"""One clip on disk: a folder that C3VD's loaders read, with what they do not know of beside it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.view.dataset import formats
from haustra.envs.view.dataset.ground_truth import GroundTruth, TruthRenderer
from haustra.envs.view.dataset.moments import Moments
from haustra.envs.view.picture.appearance import Residue
from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.light import Response
from haustra.errors import MissingDependencyError
from haustra.files import prepare_folder, write_atomically, write_json

CAMERA, POSES, COVERAGE = "camera.json", "pose.txt", "coverage_mesh.obj"
FRAMES, CONTACTS, VERTICES = "frames.parquet", "contacts.parquet", "world_vertex_positions.bin"
MASKS = ("segment", "landmark", "polyp")
"""Names of the masks of a picture: eight bits, 0 for none, else one more than the index in dataset.json."""
PLAIN = ("depth_m", "normals", "flow_px", "occluding", "triangle", "vertices_m")
"""Arrays of a picture's archive, in SI units: `triangle` is -1 for none."""


def require_packages() -> None:
    """Say what to install, before anything is computed.

    Raises:
        MissingDependencyError: without tifffile or polars.
    """
    try:
        import polars  # noqa: F401
        import tifffile  # noqa: F401
    except ImportError as error:
        raise MissingDependencyError(
            f"Data sets need {error.name}: install it with 'pip install haustra[dataset]'."
        ) from error


def write_clip(
    folder: Path,
    moments: Moments,
    records: Sequence[int],
    lens: Lens,
    *,
    response: Response | None = None,
    residue: Residue | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> None:
    """Render the pictures of these records that are not there yet, then what is told of all of them.

    A picture's archive is written last of its files, so that one that is there is whole. Noise hangs on the record
    alone, so that pictures are the same when the work was interrupted.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    prepare_folder(folder)
    response = response or Response()
    renderer = TruthRenderer(moments.colon, moments.arcs, lens, response=response, residue=residue)
    before = None
    for frame, record in enumerate(records):
        if not _archive(folder, frame).is_file():
            if before is None and frame > 0:
                before = renderer.look(moments.vertices(records[frame - 1]), moments.camera(records[frame - 1]))
            view = renderer.look(moments.vertices(record), moments.camera(record))
            truth = renderer.truth(view, before)
            renderer.bleed(moments.blood[moments.blood[:, -1] <= moments.trajectory.time[record], :-1])
            around = moments.around(record, response.exposure) if response.exposure else None
            picture = renderer.picture(view, seed=record, around=around)
            _write_frame(folder, frame, truth, picture, first=frame == 0)
            before = view
        else:
            before = None
        progress(frame + 1)
    poses = "".join(f"{formats.pose_line(moments.camera(record))}\n" for record in records)
    write_atomically(folder / POSES, lambda path: path.write_text(poses, encoding="ascii"))
    write_json(folder / CAMERA, {**formats.intrinsics(lens), "lens": lens.name, "source": lens.source})
    _write_surface(folder, moments, len(records))
    _write_tables(folder, moments, records)


def read_plain(folder: Path, frame: int) -> dict[str, np.ndarray]:
    """Arrays of a picture's archive."""
    from haustra.reading import read_arrays

    return read_arrays(_archive(folder, frame), PLAIN)


def read_frame(folder: Path, frame: int) -> dict[str, Any]:
    """What C3VD's formats hold of a picture, in SI units and pixels: depth, normals, flow (from the second on)."""
    import tifffile

    found: dict[str, Any] = {}
    for name, read in _READERS.items():
        path = folder / f"{frame:04d}_{name}.tiff"
        if path.is_file():
            found[name] = read(tifffile.imread(path))
    return found


_READERS = {
    "depth": formats.depth_from_bits,
    "normals": formats.normals_from_bits,
    "flow": formats.flow_from_bits,
}


def _archive(folder: Path, frame: int) -> Path:
    return folder / "plain" / f"{frame:04d}.npz"


def _write_frame(folder: Path, frame: int, truth: GroundTruth, picture: np.ndarray, *, first: bool) -> None:
    view, name = truth.view, folder / f"{frame:04d}"
    write_png(name.with_name(f"{name.name}_color.png"), picture)
    _write_tiff(name, "depth", formats.depth_to_bits(view.depth))
    _write_tiff(name, "normals", formats.normals_to_bits(truth.normals))
    if not first:
        _write_tiff(name, "flow", formats.flow_to_bits(truth.flow))
    _write_grey(name, "occlusion", formats.occlusion_to_bits(truth.occluding))
    for mask in MASKS:
        _write_grey(name, mask, (getattr(truth, mask) + 1).astype(np.uint8))
    arrays: Mapping[str, Any] = {
        "depth_m": view.depth.astype(np.float32),
        "normals": truth.normals.astype(np.float32),
        "flow_px": truth.flow.astype(np.float32),
        "occluding": truth.occluding,
        "triangle": view.triangle.astype(np.int32),
        "vertices_m": view.vertices.astype(np.float32),
    }
    archive = _archive(folder, frame)
    prepare_folder(archive.parent)
    write_atomically(archive, lambda path: np.savez_compressed(path, allow_pickle=False, **arrays))


def _write_tiff(name: Path, what: str, bits: np.ndarray) -> None:
    import tifffile

    kind = "rgb" if bits.ndim == 3 else "minisblack"
    path = name.with_name(f"{name.name}_{what}.tiff")
    write_atomically(path, lambda temporary: tifffile.imwrite(temporary, bits, photometric=kind, compression="zlib"))


def _write_grey(name: Path, what: str, bits: UInt8[np.ndarray, "height width"]) -> None:
    from PIL import Image

    path = name.with_name(f"{name.name}_{what}.png")
    write_atomically(path, lambda temporary: Image.fromarray(bits).save(temporary, format="PNG", optimize=True))


def _write_surface(folder: Path, moments: Moments, frames: int) -> None:
    """The mesh at rest with what was seen of it, and where its vertices were in every picture [mm]."""
    faces, seen = moments.colon.lumen.faces, np.zeros(len(moments.colon.lumen.faces), bool)

    def positions(path: Path) -> None:
        with path.open("wb") as file:
            for frame in range(frames):
                plain = read_plain(folder, frame)
                file.write((1e3 * plain["vertices_m"].astype(float)).astype("<f4").tobytes())
                triangles = plain["triangle"]
                seen[triangles[triangles >= 0]] = True

    write_atomically(folder / VERTICES, positions)
    write_atomically(folder / COVERAGE, lambda path: _write_obj(path, moments.colon.lumen.vertices, faces, seen))


def _write_obj(path: Path, vertices: Float[np.ndarray, "vertices 3"], faces: np.ndarray, seen: np.ndarray) -> None:
    """Vertices in millimetres, counted from one; a triangle's texture place is the first where it was seen."""
    lines = [f"v {x:.6g} {y:.6g} {z:.6g}" for x, y, z in 1e3 * vertices]
    lines += ["vt 0.0 0.0", "vt 1.0 1.0"]
    texture = np.where(seen, 1, 2)
    lines += [f"f {a}/{t} {b}/{t} {c}/{t}" for (a, b, c), t in zip((faces + 1).tolist(), texture.tolist(), strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _write_tables(folder: Path, moments: Moments, records: Sequence[int]) -> None:
    """Hands, forces and what is in view of every picture; forces by place of the colon where the scope touches it."""
    import polars

    from haustra.envs.runs.measure.injury import stations_of

    run, rows = moments.trajectory, list(records)
    hands = moments.hands(rows)
    frames = polars.DataFrame(
        {
            "frame": np.arange(len(rows)),
            "time_s": run.time[rows],
            "insertion_m": run.insertion[rows],
            "tip_arc_m": run.tip_arc[rows],
            **{name: hands[:, column] for column, name in enumerate(moments.HANDS)},
            "push_force_N": run.push_force[rows],
            "torque_Nm": run.torque[rows],
            "wall_force_largest_N": run.wall_force[rows],
            "wall_force_sum_N": run.wall_force_sum[rows],
            "colon_moved_m": run.colon_moved[rows],
        }
    )
    pressed, stations = run.pressed[rows], stations_of(moments.colon)
    frame, place = np.nonzero(pressed)
    contacts = polars.DataFrame({"frame": frame, "arc_m": stations[place], "force_N": pressed[frame, place]})
    for name, table in ((FRAMES, frames), (CONTACTS, contacts)):
        write_atomically(folder / name, table.write_parquet)
