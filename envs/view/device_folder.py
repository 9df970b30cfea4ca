"""A run of any device on disk: scores, trajectory, scene, picture and report."""

from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.runs.device_run import DeviceRun, device_scores
from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.outside import default_rotation, outside_view
from haustra.envs.view.report.run_report import report_run
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.provenance import Provenance


def write_device_run(folder: Path, *, colon: Colon, run: DeviceRun) -> dict[str, Any]:
    """Write scores.json, trajectory.npz, scene.xml, outside.png and report.html; returns the scores.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    prepare_folder(folder)
    provenance = Provenance(
        inputs={"colon": colon_hash(colon), "colon_name": colon.name}, configuration=run.configuration
    )
    scores = {**device_scores(run, colon), "provenance": provenance.to_json()}
    arrays = {**run.records, "shape": run.shape}
    write_atomically(folder / "trajectory.npz", lambda path: np.savez_compressed(path, allow_pickle=False, **arrays))
    text = run.spec.to_xml()
    write_atomically(folder / "scene.xml", lambda path: path.write_text(text, encoding="utf-8"))
    seen = run.colon
    rotation = default_rotation(seen.lumen, seen.centreline.points)
    picture = outside_view(seen.lumen, run.shape, run.radius, bending_length=0.0, rotation=rotation)
    write_png(folder / "outside.png", picture)
    write_json(folder / "scores.json", scores)
    report_run(folder)
    return scores
