"""Pictures and films of how a device came through a patient."""

from pathlib import Path
from typing import NamedTuple

from haustra.envs.runs.device_run import DeviceRun
from haustra.envs.runs.insertion import Insertion, Trajectory
from haustra.envs.study.compare_patients import Patient
from haustra.models.scene import Scene


class ScopeRun(NamedTuple):
    """A run of a scope."""

    scene: Scene
    run: Insertion
    trajectory: Trajectory
    """As far as it counts."""


def draw(run: DeviceRun | ScopeRun, patient: Patient, path: Path) -> None:
    """Draw how a run ended into a PNG file, the device close by into `…-close.png`, and a film into `….webp`."""
    from haustra.envs.view.device_folder import end_pictures
    from haustra.envs.view.picture.image import write_png
    from haustra.envs.view.picture.outside import default_rotation, outside_view
    from haustra.envs.view.run_film import write_device_film, write_run_film

    path.parent.mkdir(exist_ok=True)
    if isinstance(run, DeviceRun):
        pictures = end_pictures(run)
        write_png(path, pictures["outside"])
        write_png(path.with_name(f"{path.stem}-close.png"), pictures["device"])
        write_device_film(path.with_suffix(".webp"), run)
        return
    rotation = default_rotation(patient.colon.lumen, patient.colon.centreline.points)
    lumen, radius = run.run.colon.lumen, run.scene.cable.radius
    write_png(path, outside_view(lumen, run.run.shape, radius, rotation=rotation))
    write_run_film(path.with_suffix(".webp"), run.scene, run.trajectory)
