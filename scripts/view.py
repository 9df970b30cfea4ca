"""`haustra view`: MuJoCo's viewer, where there is a display."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from zipfile import BadZipFile

import tyro

from haustra.errors import MissingDependencyError, UnreadableFileError

_SCENES = ("scene.mjz", "scene.xml")


@dataclass(frozen=True)
class View:
    """Open a run or a scene file in MuJoCo's viewer."""

    scene: Annotated[Path, tyro.conf.Positional]
    """Folder that `haustra run` wrote, or a scene file (.mjz, .xml)."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Open the viewer and return when its window is closed."""
        path = _scene_file(self.scene)
        _require_display()
        from mujoco import viewer

        model, data = _load(path)
        viewer.launch(model, data)
        return {"scene": str(path)}


def _scene_file(path: Path) -> Path:
    if path.is_file():
        return path
    for name in _SCENES:
        if (path / name).is_file():
            return path / name
    raise UnreadableFileError(f"'{path}' is no scene file and holds none of {', '.join(_SCENES)}: name a run's folder.")


def _require_display() -> None:
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise MissingDependencyError(
            "The viewer needs a display, and neither DISPLAY nor WAYLAND_DISPLAY is set: "
            "open the run's report.html, or copy the scene to a machine with a screen."
        )


def _load(path: Path) -> tuple[Any, Any]:
    """Model and data; at a run's last recorded state when its trajectory lies beside the scene."""
    import mujoco

    from haustra.reading import LARGEST_TRAJECTORY, read_arrays

    try:
        if path.suffix == ".mjz":
            with path.open("rb") as file:  # given a path, from_zip leaves the file open
                model = mujoco.MjSpec.from_zip(file).compile()
        else:
            model = mujoco.MjSpec.from_file(str(path)).compile()
    except (ValueError, BadZipFile) as error:
        raise UnreadableFileError(f"MuJoCo cannot read '{path}': {str(error).splitlines()[0]}") from error
    data = mujoco.MjData(model)
    recorded = path.with_name("trajectory.npz")
    if recorded.is_file():
        states = read_arrays(recorded, ("qpos",), largest=LARGEST_TRAJECTORY)["qpos"]
        if states.ndim != 2 or states.shape[1] != model.nq:
            raise UnreadableFileError(f"'{recorded}' belongs to another scene than '{path}': move one of them away.")
        data.qpos[:] = states[-1] if len(states) else data.qpos
    mujoco.mj_forward(model, data)
    return model, data
