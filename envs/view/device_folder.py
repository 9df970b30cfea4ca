"""A run of any device on disk: scores, trajectory, scene, picture and report."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.runs.device_run import DeviceRun, device_scores
from haustra.envs.view.device_body import device_body
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.outside import OutsideView, default_rotation
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.tube import Tube
from haustra.envs.view.report.run_report import report_run
from haustra.envs.view.run_film import FILM, write_device_film
from haustra.envs.view.run_folder import write_trajectory
from haustra.files import replaced_together, write_atomically, write_json
from haustra.models.accuracy import NumericalError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.provenance import Provenance, backend_record

_CLOSE = 0.08
"""Part of a device that is shown close by, from its tip [m]."""
_FROM, _UP = np.array([-0.45, 0.80, 0.40]), np.array([-1.0, 0.0, 0.0])
"""Where one looks from at a device close by, and what is up then, in its tip's frame: over its left shoulder."""

_TIP_SIZE = 480
"""Rows and columns of the picture that the device's camera sees [pixels]."""


def write_device_run(
    folder: Path,
    *,
    colon: Colon,
    run: DeviceRun,
    error: NumericalError | None = None,
    film: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Write scores.json, trajectory.npz, scene.xml, pictures and report.html; returns the scores.

    Pictures are outside.png, device.png and tip.png; film.webp where `film` is given, which is told pictures done and
    their number. The scene's keyframe `end` is where the run ended.

    The numerical error is that of the run itself where it was measured, otherwise that of other runs of its kind. A run
    that was there is replaced as a whole.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    provenance = Provenance(
        inputs={"colon": colon_hash(colon), "colon_name": colon.name},
        configuration=run.configuration,
        backend=backend_record(run.backend),
    )
    scores: dict[str, Any] = {**device_scores(run, colon, error=error), "provenance": provenance.to_json()}
    spec = _ended(run)
    text, pictures = spec.to_xml(), end_pictures(run)
    with replaced_together(folder) as place:
        scores["trajectory"] = write_trajectory(place, {**run.records, "shape": run.shape})
        write_atomically(place / "scene.xml", lambda path: path.write_text(text, encoding="utf-8"))
        for name, picture in pictures.items():
            write_png(place / f"{name}.png", picture)
        if film is not None and len(run.records["time"]):
            write_device_film(place / FILM, run, progress=film)
        write_json(place / "scores.json", scores)
        report_run(place)
    return scores


def end_pictures(run: DeviceRun) -> dict[str, UInt8[np.ndarray, "height width 3"]]:
    """How a run ended: the device in its colon from `outside`, the `device` close by, and what its `tip` sees."""
    model = _ended(run).compile()
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    body = device_body(run, model, data, run.colon.centreline.points)
    return _pictures(run, body, data.site(run.tip))


def _ended(run: DeviceRun) -> mujoco.MjSpec:
    """The scene with a keyframe where the run ended."""
    spec = run.spec.copy()
    if len(run.records["time"]):
        moved = {"mpos": run.records["mocap_pos"][-1].ravel(), "mquat": run.records["mocap_quat"][-1].ravel()}
        spec.add_key(name="end", qpos=run.records["qpos"][-1], **(moved if len(moved["mpos"]) else {}))
    return spec


def _pictures(run: DeviceRun, body: Tube, tip: Any) -> dict[str, UInt8[np.ndarray, "height width 3"]]:
    """The pictures of a body and its tip."""
    lumen, line = run.colon.lumen, run.colon.centreline.points
    frame: Float[np.ndarray, "3 3"] = tip.xmat.reshape(3, 3)
    whole = OutsideView(lumen, default_rotation(lumen, line))
    beside = frame @ _FROM
    scope = Endoscope(run.colon, named_lens("cf-hq190l").at(_TIP_SIZE, _TIP_SIZE))
    near = np.linalg.norm(body.vertices - tip.xpos, axis=1) < _CLOSE
    close = OutsideView(lumen, looking(-beside, frame @ _UP), framed=body.vertices[near])
    return {
        "outside": whole.draw_body(body),
        "device": close.draw_body(body),
        "tip": scope.picture(CameraPose.of_tip(tip.xpos.copy(), frame)),
    }
