"""A run as a film: what its tip saw beside the colon from outside, as animated WebP."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from haustra.envs.console.device_vehicle import device_surroundings
from haustra.envs.console.film import draw_pictures
from haustra.envs.console.motion import run_surroundings
from haustra.envs.runs.device_run import DeviceRun
from haustra.envs.runs.insertion import Trajectory
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.view.device_body import device_body
from haustra.envs.view.run_blood import run_blood
from haustra.files import write_atomically
from haustra.models.scene import Scene

if TYPE_CHECKING:
    from PIL.Image import Image

FILM = "film.webp"
"""File of a run's folder."""
_PICTURES = 72
"""Pictures of a film: few enough for a page to load at once."""
_SHOWN_MS, _LAST_MS = 140, 2500
"""How long a picture is shown, and the last one [ms]; engineering choice: what the eye follows."""
_QUALITY = 60
"""Quality of the WebP compression, 0 to 100."""


def write_run_film(
    path: Path,
    scene: Scene,
    seen: Trajectory,
    *,
    progress: Callable[[int, int], None] = lambda done, pictures: None,
) -> Path:
    """Draw a run that has records as a film of some ten seconds.

    Raises:
        OutputError: when the file cannot be written.
    """
    recorded, moves = RecordedRun(scene, seen), bool(seen.displacement.shape[1])
    times = np.linspace(seen.time[0], seen.time[-1], min(_PICTURES, len(seen.time)))
    blood = run_blood(recorded)
    blood = blood[np.argsort(blood[:, -1], kind="stable")]

    def moment(at: float) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
        record = min(int(np.searchsorted(seen.time, at - 1e-9)), len(seen.time) - 1)
        shape = recorded.shape(record)
        row = {name: getattr(seen, name)[record] for name in ("time", "tip", "tip_arc", "wall_force", "insertion")}
        frame = {"shape": shape, "blood": blood[blood[:, -1] <= seen.time[record], :-1]}
        frame |= {"displacement": seen.displacement[record]} if moves else {}
        return row | {"tip_frame": recorded.tip_frame()}, frame

    return _write(path, draw_pictures(run_surroundings(scene, seen), times, moment, progress), len(times))


def write_device_film(
    path: Path, run: DeviceRun, *, progress: Callable[[int, int], None] = lambda done, pictures: None
) -> Path:
    """Draw a run of any device that has records as such a film, the device as MuJoCo draws it.

    Raises:
        OutputError: when the file cannot be written.
    """
    records, around, model = run.records, device_surroundings(run.rest, run.scene), run.spec.compile()
    data, time = mujoco.MjData(model), run.records["time"]
    moves = around.tables and CurrentColon(run.rest, around.tables, around.origin, around.axes)
    times = np.linspace(time[0], time[-1], min(_PICTURES, len(time)))

    def moment(at: float) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
        record = min(int(np.searchsorted(time, at - 1e-9)), len(time) - 1)
        row = {name: records[name][record] for name in ("time", "tip", "tip_frame", "tip_arc", "wall_force")}
        data.qpos[:] = records["qpos"][record]
        mujoco.mj_kinematics(model, data)
        pose = records["displacement"][record].astype(float)
        line = moves.way(pose) if moves else run.rest.centreline.points
        return row, {"body": device_body(run, model, data, line), **({"displacement": pose} if moves else {})}

    return _write(path, draw_pictures(around, times, moment, progress), len(times))


def _write(path: Path, pictures: Iterator["Image"], count: int) -> Path:
    shown = [_SHOWN_MS] * (count - 1) + [_LAST_MS]

    def write(temporary: Path) -> None:
        looks = {"save_all": True, "append_images": pictures, "loop": 0, "quality": _QUALITY, "method": 4}
        next(pictures).save(temporary, format="WEBP", duration=shown, **looks)

    return write_atomically(path, write)
