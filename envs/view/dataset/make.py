"""A data set from seeds: colons, runs, clips, the data sheet, and how exact it came out."""

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.view.dataset.accuracy import DatasetAccuracy, clip_accuracy
from haustra.envs.view.dataset.clip import MASKS, require_packages, write_clip
from haustra.envs.view.dataset.contact import contact_sheet
from haustra.envs.view.dataset.moments import Moments, Source
from haustra.envs.view.dataset.settings import DatasetSettings
from haustra.envs.view.dataset.sheet import SHEET, data_sheet
from haustra.envs.view.picture.lens import named_lens
from haustra.errors import InvalidOptionError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.lesion import read_orders
from haustra.models.anatomy.store import colon_hash
from haustra.models.anatomy.surface_landmarks import LANDMARKS
from haustra.models.devices.scope.library import named_design
from haustra.models.presets import find_preset
from haustra.models.scene import build_scene
from haustra.provenance import Provenance, backend_record
from haustra.reading import read_document

RECORD = "dataset.json"
"""What the data set is made of; the folder of an unfinished one can be told from that of another by it."""
LENS = "cf-hq190l"
"""Lens of all pictures, that of C3VD's scope."""
_DESIGN = "adult"

Progress = Callable[[int, str], None]
"""Called with the number of pictures done and where they are."""


def make_dataset(
    folder: Path,
    settings: DatasetSettings,
    *,
    name: str,
    seed: int = 0,
    sources: Iterator[Source] | None = None,
    of: str = "seeds",
    progress: Progress = lambda done, note: None,
) -> dict[str, Any]:
    """Make a data set, or go on with one that was interrupted; pictures that are there are kept.

    Args:
        folder: of the data set.
        settings: what it is made of.
        name: of the data set.
        seed: of the first colon; each further colon has the next.
        sources: runs that are there already; grown and run from seeds when None.
        of: what the sources are, for the record; a folder that holds another's pictures is refused.
        progress: told how far it is.

    Raises:
        InvalidOptionError: when the folder holds another data set, or runs are too short for their clips.
        MissingDependencyError: without tifffile or polars.
        OutputError: when the folder cannot be written to.
    """
    require_packages()
    began = time.perf_counter()
    prepare_folder(folder)
    lens = named_lens(LENS).at(settings.width, settings.height)
    made_of = {"name": name, "seed": seed, "settings": asdict(settings), "lens": lens.name, "of": of}
    _require_same(folder, made_of)
    write_json(folder / RECORD, {**made_of, "finished": False})
    accuracy, colons, done = DatasetAccuracy(0.0, 0.0, 0.0, 0.0, 0), [], 0
    for source in sources or _grown(settings, seed):
        moments, clips = source.moments, []
        for number, records in enumerate(clips_of(moments, settings)):
            clip = folder / f"{source.name}_clip_{number:02d}"
            looks: dict[str, Any] = {"response": settings.response, "residue": settings.residue}
            write_clip(
                clip, moments, records, lens, progress=lambda n, d=done, c=clip: progress(d + n, c.name), **looks
            )
            done += len(records)
            accuracy = accuracy.joined(clip_accuracy(clip, moments.colon.lumen.faces, lens, seed=number))
            clips.append({"folder": clip.name, "records": records})
        colons.append(_colon_record(source, clips))
    result = {
        "frames": done,
        "seconds": time.perf_counter() - began,
        "reprojection_px": accuracy.reprojection_px,
        "depth_error_mm": accuracy.depth_error_mm,
        "normals_error_deg": accuracy.normals_error_deg,
        "round_trip_mm": accuracy.round_trip_mm,
        "flows": accuracy.flows,
    }
    inputs = {colon["name"]: colon["hash"] for colon in colons}
    provenance = Provenance(inputs=inputs, configuration=made_of, backend=backend_record("linear"))
    masks = dict(zip(MASKS, (SEGMENTS, LANDMARKS, "index in the colon's lesions"), strict=True))
    whole = {**made_of, "finished": True, "accuracy": result, "masks": masks, "colons": colons}
    whole["provenance"] = provenance.to_json()
    write_json(folder / RECORD, whole)
    contact_sheet(folder, [(clip["folder"], len(clip["records"])) for colon in colons for clip in colon["clips"]])
    write_atomically(folder / SHEET, lambda path: path.write_text(data_sheet(whole, lens), encoding="utf-8"))
    return {**result, "folder": str(folder)}


def clips_of(moments: Moments, settings: DatasetSettings) -> list[list[int]]:
    """Records of each clip, evenly spread over a run.

    Raises:
        InvalidOptionError: when the run is shorter than a clip.
    """
    time = moments.trajectory.time
    every = settings.every(float(time[1] - time[0])) if len(time) > 1 else 1
    span = (settings.frames - 1) * every + 1
    if len(moments) < span:
        raise InvalidOptionError(
            f"The run has {len(moments)} records, {span} are needed for {settings.frames} pictures: "
            "ask for fewer, or for a longer run."
        )
    middles = (np.arange(settings.clips) + 0.5) / settings.clips
    starts = np.clip(np.rint(middles * len(moments) - span / 2), 0, len(moments) - span).astype(int)
    return [list(range(int(start), int(start) + span, every)) for start in starts]


def _grown(settings: DatasetSettings, seed: int) -> Iterator[Source]:
    """Colons from seeds, each with the insertion of an adult scope."""
    orders = read_orders("polyp", settings.polyps)
    for own in range(seed, seed + settings.colons):
        colon = grow_colon(seed=own, difficulty=settings.difficulty, lesions=orders)
        yield inserted(colon, seconds=settings.seconds, name=f"seed_{own:04d}")


def inserted(colon: Colon, *, seconds: float, name: str) -> Source:
    """A run of an adult scope into a colon that moves."""
    options = replace(find_preset("balanced").apply(law="table"), mesentery=True)
    settings = FollowerSettings(straighten=True)
    deepest = options.start_depth + settings.advance_rate * seconds
    scene = build_scene(colon, None, named_design(_DESIGN), options, deepest=deepest, show_lumen=False)
    return Source(
        name, scene, Moments(scene, run_linear_insertion(scene, seconds=seconds, settings=settings).trajectory)
    )


def _require_same(folder: Path, made_of: dict[str, Any]) -> None:
    """Refuse to go on with another data set."""
    path = folder / RECORD
    if not path.exists():
        return
    held = read_document(path, "data set")
    known = {name: held.get(name) for name in made_of} if isinstance(held, dict) else None
    if known != json.loads(json.dumps(made_of)):
        raise InvalidOptionError(f"'{folder}' holds another data set: name another folder, or the same options.")


def _colon_record(source: Source, clips: list[dict[str, Any]]) -> dict[str, Any]:
    colon, scene = source.scene.colon, source.scene
    return {
        "name": source.name,
        "hash": colon_hash(colon),
        "configuration": dict(colon.provenance.configuration),
        "length_m": colon.centreline.length,
        "triangles": len(colon.lumen.faces),
        "lesions": [asdict(lesion) for lesion in colon.lesions],
        "landmarks_m": dict(colon.landmarks),
        "scene": scene.configuration(),
        "clips": clips,
    }
