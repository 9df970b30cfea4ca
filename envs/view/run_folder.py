"""A run on disk: scores, trajectory, scene, pictures and report."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.motion import MOTION, write_motion
from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.measure.scores import provenance_of, score
from haustra.envs.runs.measure.surface import left_behind
from haustra.envs.runs.treatment import Treatment
from haustra.envs.view.inspect import write_inspection
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.injury_map import injury_map
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.outside import default_rotation, outside_view
from haustra.envs.view.picture.plots import time_figure
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import LumenSurface
from haustra.envs.view.report.run_report import TRAJECTORY, report_run
from haustra.envs.view.run_blood import run_blood
from haustra.envs.view.run_film import FILM, write_run_film
from haustra.files import replaced_together, write_atomically, write_json
from haustra.models.accuracy import NumericalError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import save_colon
from haustra.models.scene import Scene
from haustra.models.wall.pieces.wall import Wall
from haustra.models.wall.signed_distance import surface_arcs
from haustra.provenance import file_hash

AFTER = "after"
"""Folder of the colon as a treatment has left it."""
_TIP_SIZE = 480
"""Rows and columns of the tip's picture [pixels]."""


def write_run(
    folder: Path,
    *,
    scene: Scene,
    run: Insertion,
    wall: Wall | None = None,
    seconds: float | None = None,
    error: NumericalError | None = None,
    withdrawal: Insertion | None = None,
    treatment: Treatment | None = None,
    film: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Write a finished run into `folder` and return its scores; `wall` is None where the scope met no pieces.

    The numerical error is that of the run itself where it was measured, otherwise that of other runs of its kind.

    A run that was there is replaced as a whole. Files: scores.json, trajectory.npz, scene.xml, outside.png, tip.png,
    forces.png, injury.png, motion.json, report.html; film.webp where `film` is given, which is told pictures done and
    their number; of a scope that was withdrawn also inspection.png and withdrawal.npz, and what was left of the colon
    by a treatment in the folder `after`.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    pieces = wall.method if wall else None
    provenance = provenance_of(scene, run, wall=pieces, seconds=seconds)
    left = left_behind(scene, run)
    scores = score(scene, run, provenance, wall=pieces, error=error, left=left)
    arrays = {**asdict(run.trajectory), "shape": run.shape, "tip_frame": run.tip_frame}
    arrays["displacement"] = arrays["displacement"].astype(np.float32)  # exact to a hundredth of a micrometre
    arrays |= {f"gas_{name}": values for name, values in (run.gas._asdict() if run.gas else {}).items()}
    with replaced_together(folder) as place:
        scores["trajectory"] = write_trajectory(place, arrays)
        if withdrawal is not None:
            scores["inspection"] = write_inspection(place, scene, withdrawal)
        if treatment is not None:
            scores["treatment"] = treatment.scores()
            save_colon(treatment.after(), folder / AFTER)
        scene.save(place / "scene.xml")
        _draw(place, scene, run, left.colon, scores)
        write_motion(place / MOTION, scene, run.trajectory)
        if film is not None and len(run.trajectory.time):
            write_run_film(place / FILM, scene, run.trajectory, progress=film)
        write_json(place / "scores.json", scores)
        report_run(place)
    return scores


def write_trajectory(folder: Path, arrays: Mapping[str, Any]) -> str:
    """Write the arrays of a run and return the hash by which its scores know them.

    Raises:
        OutputError: when they cannot be written.
    """
    path = folder / TRAJECTORY
    write_atomically(path, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    return file_hash(path)


def _draw(folder: Path, scene: Scene, run: Insertion, colon: Colon, scores: Mapping[str, Any]) -> None:
    lumen, frame, seen = colon.lumen, run.tip_frame, run.trajectory
    outside = outside_view(
        lumen,
        run.shape,
        scene.cable.radius,
        bending_length=scene.design.bending.length,
        rotation=default_rotation(lumen, colon.centreline.points),
    )
    write_png(folder / "outside.png", outside)
    surface = LumenSurface(scene.colon.lumen, surface_arcs(scene.colon))
    scope = Endoscope(scene.colon, lens_of(scene.design.tip, _TIP_SIZE, _TIP_SIZE), surface=surface)
    for *place, reach, _ in run_blood(RecordedRun(scene, seen)):
        scope.appearance.bleed(np.array(place), reach)
    surface.place(lumen.vertices)
    write_png(folder / "tip.png", scope.picture(CameraPose.of_tip(run.shape[-1], frame)))
    curves = {
        "force [N]": {"hand": seen.push_force, "wall, hardest pressed link": seen.wall_force},
        "torque [N m]": {"hand": seen.torque},
        "length [m]": {"scope inserted": seen.insertion, "tip along the colon": seen.tip_arc},
    }
    time_figure(folder / "forces.png", seen.time, curves)
    injury_map(
        folder / "injury.png",
        seen.time,
        stations_of(scene.colon),
        seen.pain,
        seen.pressed,
        segments=scene.colon.segments,
        perforation_arc=scores["perforation_arc_m"],
        p_perforation=scores["p_perforation"],
    )
