"""Moments of a run for the player in its report: colon and scope, as the console's page takes them."""

import base64
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from haustra.envs.console.scope_vehicle import LENS_SIZE
from haustra.envs.console.stage import Stage
from haustra.envs.console.vehicle import Surroundings
from haustra.envs.console.wire import pack
from haustra.envs.runs.insertion import Trajectory
from haustra.envs.view.picture.lens import lens_of
from haustra.files import write_json
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import axis_tables, stack

MOTION = "motion.json"
"""File of a run's folder that its report's player plays."""
_MOMENTS = 40
"""Moments that are kept: some half a megabyte."""
_SPACING, _AROUND = 0.016, 16
"""Distance between rings of the colon [m], and corners of each: a report's player is smaller than the console."""


def write_motion(path: Path, scene: Scene, seen: Trajectory) -> Path | None:
    """Write some moments of a run; None of one without records.

    Raises:
        OutputError: when the file cannot be written.
    """
    if not len(seen.time):
        return None
    colon, moves = scene.colon, bool(seen.displacement.shape[1])
    stage = Stage(run_surroundings(scene, seen), spacing=_SPACING, corners=_AROUND)
    told: dict[str, Any] = {"kind": "scene", "radius": scene.cable.radius, "name": colon.name}
    messages = [pack(told, {"faces": stage.faces, "stations": stage.stations, "rest": _single(stage.vertices())})]
    model = scene.compile()
    data = mujoco.MjData(model)
    links, tip = [model.body(name).id for name in scene.cable.links], model.site("scope/tip").id
    for moment in np.unique(np.linspace(0, len(seen.time) - 1, _MOMENTS).astype(int)):
        data.qpos[:] = seen.qpos[moment]
        mujoco.mj_kinematics(model, data)
        arrays = {"shape": np.vstack([data.xpos[links], data.site_xpos[tip]])}
        arrays |= {"pressed": seen.pressed[moment], "pain": seen.pain[moment]}
        if moves:
            arrays["vertices"] = stage.vertices(np.asarray(seen.displacement[moment], float))
        row = {name: round(float(getattr(seen, name)[moment]), 5) for name in ("time", "tip_arc", "wall_force")}
        messages.append(pack({"kind": "frame", "row": row}, {name: _single(part) for name, part in arrays.items()}))
    return write_json(path, [base64.b64encode(message).decode("ascii") for message in messages])


def run_surroundings(scene: Scene, seen: Trajectory) -> Surroundings:
    """What a run took place in, in the coordinates of its scene."""
    moves = bool(seen.displacement.shape[1])
    tables = stack([axis_tables(scene.colon, scene.options.abdomen)]) if moves else None
    lens = lens_of(scene.design.tip, LENS_SIZE, LENS_SIZE)
    return Surroundings(scene.colon, tables, np.zeros(3), np.eye(3), scene.cable.radius, lens)


def _single(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, np.float32)


def player_script() -> str:
    """What plays motions, to be put into a page once."""
    from importlib.resources import files

    text = files("haustra.envs.console.page").joinpath("console.js").read_text(encoding="utf-8")
    return text.replace("</script", "<\\/script")
