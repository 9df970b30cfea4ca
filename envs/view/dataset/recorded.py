"""Runs that `haustra run` has left in a folder, as sources of a data set."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from haustra.envs.runs.insertion import Trajectory
from haustra.envs.view.dataset.moments import Moments, Source
from haustra.envs.view.inspect import WITHDRAWAL
from haustra.envs.view.report.run_report import TRAJECTORY
from haustra.errors import UnreadableFileError, UnsupportedSceneError
from haustra.fields import read_fields
from haustra.models.anatomy.store import colon_hash, load_colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import SceneOptions, build_scene
from haustra.reading import LARGEST_RECORD, read_arrays, read_document

_LARGEST = 8_000_000_000
"""Arrays of ten hours of a long scope [bytes]."""


def recorded(folder: Path, colon_folder: Path) -> Iterator[Source]:
    """An insertion that was recorded, and the withdrawal after it where there was one.

    Args:
        folder: that `haustra run` wrote.
        colon_folder: of the colon that it was run in.

    Raises:
        UnreadableFileError: when the folder holds no run of a scope, or one in another colon.
        UnsupportedSceneError: when the wall was of another law than the table.
    """
    scores, colon = (
        read_document(folder / "scores.json", "scores of a run", largest=LARGEST_RECORD),
        load_colon(colon_folder),
    )
    provenance: Mapping[str, Any] = scores.get("provenance", {}) if isinstance(scores, dict) else {}
    known, inputs = provenance.get("configuration", {}), provenance.get("inputs", {})
    if not {"options", "design", "driver", "seconds"} <= known.keys():
        raise UnreadableFileError(f"'{folder}' holds no run of a scope: name a folder that `haustra run` wrote.")
    if inputs.get("colon") != colon_hash(colon):
        raise UnreadableFileError(f"The run in '{folder}' was in another colon than '{colon_folder}': name that one.")
    options = read_fields(SceneOptions, known["options"], "scores.json", error=UnreadableFileError)
    if options.wall_law != "table":
        raise UnsupportedSceneError(
            f"The run met wall law '{options.wall_law}': pictures are made of law 'table' only."
        )
    design = read_fields(ScopeDesign, known["design"], "scores.json", error=UnreadableFileError)
    deepest = options.start_depth + known["driver"]["advance_rate"] * known["seconds"]
    scene = build_scene(colon, None, design, options, deepest=deepest, show_lumen=False)
    names = list(Trajectory.__dataclass_fields__)
    for name, file in (("insertion", TRAJECTORY), ("withdrawal", WITHDRAWAL)):
        if (folder / file).is_file():
            trajectory = Trajectory(**read_arrays(folder / file, names, largest=_LARGEST))
            if trajectory.qpos.shape[1] != scene.compile().nq:
                raise UnreadableFileError(f"'{folder / file}' is not of the scope in scores.json: run it again.")
            yield Source(name, scene, Moments(scene, trajectory))
