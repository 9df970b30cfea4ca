"""A run on disk: scores, trajectory, scene, pictures and report."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from haustra.envs.insertion import Insertion
from haustra.envs.measure.scores import score
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.anatomy.store import colon_hash
from haustra.models.scene import Scene
from haustra.models.wall.wall import Wall
from haustra.provenance import Provenance


def write_run(folder: Path, *, scene: Scene, wall: Wall, run: Insertion, seconds: float) -> dict[str, object]:
    """Write a finished run into `folder` and return its scores.

    Files: scores.json, trajectory.npz, scene.xml, outside.png, tip.png, forces.png, report.html.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    prepare_folder(folder)
    provenance = Provenance(
        inputs={"colon": colon_hash(scene.colon), "colon_name": scene.colon.name},
        configuration={**scene.configuration(), "wall": wall.method, "seconds": seconds},
    )
    scores = score(scene, run, provenance)
    arrays = {**asdict(run.trajectory), "shape": run.shape, "tip_frame": run.tip_frame}
    write_atomically(folder / "trajectory.npz", lambda path: np.savez_compressed(path, allow_pickle=False, **arrays))
    scene.save(folder / "scene.xml")
    write_json(folder / "scores.json", scores)
    return scores
