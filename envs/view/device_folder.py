"""A run of any device on disk: scores, trajectory, scene, picture and report."""

from pathlib import Path
from typing import Any

from haustra.envs.runs.device_run import DeviceRun, device_scores
from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.outside import default_rotation, outside_view
from haustra.envs.view.report.run_report import report_run
from haustra.envs.view.run_folder import write_trajectory
from haustra.files import replaced_together, write_atomically, write_json
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.provenance import Provenance


def write_device_run(folder: Path, *, colon: Colon, run: DeviceRun) -> dict[str, Any]:
    """Write scores.json, trajectory.npz, scene.xml, outside.png and report.html; returns the scores.

    A run that was there is replaced as a whole.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    provenance = Provenance(
        inputs={"colon": colon_hash(colon), "colon_name": colon.name}, configuration=run.configuration
    )
    scores: dict[str, Any] = {**device_scores(run, colon), "provenance": provenance.to_json()}
    seen = run.colon
    rotation = default_rotation(seen.lumen, seen.centreline.points)
    picture = outside_view(seen.lumen, run.shape, run.radius, bending_length=0.0, rotation=rotation)
    text = run.spec.to_xml()
    with replaced_together(folder) as place:
        scores["trajectory"] = write_trajectory(place, {**run.records, "shape": run.shape})
        write_atomically(place / "scene.xml", lambda path: path.write_text(text, encoding="utf-8"))
        write_png(place / "outside.png", picture)
        write_json(place / "scores.json", scores)
        report_run(place)
    return scores
