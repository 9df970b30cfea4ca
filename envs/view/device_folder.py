"""A run of any device on disk: scores, trajectory, scene, picture and report."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.runs.device_run import DeviceRun, device_scores
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.image import write_png
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.picture.outside import OutsideView, default_rotation
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.shapes import drawn_shapes
from haustra.envs.view.picture.tube import Tube, tube
from haustra.envs.view.report.run_report import report_run
from haustra.envs.view.run_folder import write_trajectory
from haustra.files import replaced_together, write_atomically, write_json
from haustra.models.accuracy import NumericalError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.models.scene import entry_of
from haustra.provenance import Provenance, backend_record

_CLOSE = 0.08
"""Part of a device that is shown close by, from its tip [m]."""
_SHOWN_OUTSIDE, _BESIDE = 0.03, 0.03
"""What lies further before the anus, and so near to the way in, is not shown [m]."""
_FROM, _UP = np.array([-0.45, 0.80, 0.40]), np.array([-1.0, 0.0, 0.0])
"""Where one looks from at a device close by, and what is up then, in its tip's frame: over its left shoulder."""

_TIP_SIZE = 480
"""Rows and columns of the picture that the device's camera sees [pixels]."""


def write_device_run(
    folder: Path, *, colon: Colon, run: DeviceRun, error: NumericalError | None = None
) -> dict[str, Any]:
    """Write scores.json, trajectory.npz, scene.xml, pictures and report.html; returns the scores.

    Pictures are outside.png, device.png and tip.png. The scene's keyframe `end` is where the run ended.

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
    body = _inside(drawn_shapes(model, data), run.colon)
    if run.trail:
        body = _joined(body, _tether(run, data.site(run.trail[0]).xpos, run.trail[1]))
    return _pictures(run, body, data.site(run.tip))


def _inside(body: Tube, colon: Colon) -> Tube:
    """A body without what of it lies straight before the anus, in wait."""
    anus, frame = entry_of(colon)
    local = (body.vertices - anus) @ frame
    waits = (local[:, 2] < -_SHOWN_OUTSIDE) & (np.hypot(local[:, 0], local[:, 1]) < _BESIDE)
    return replace(body, faces=body.faces[~waits[body.faces].all(axis=1)])


def _tether(run: DeviceRun, end: Float[np.ndarray, "3"], radius: float) -> Tube:
    """A tether along the lumen's axis from the anus to where it hangs on the device."""
    line = run.colon.centreline
    near = int(np.linalg.norm(line.points - end, axis=1).argmin())
    return tube(np.vstack([line.points[: max(near - 3, 2)], end]), radius, bending_length=0.0)


def _joined(first: Tube, second: Tube) -> Tube:
    faces = np.concatenate([first.faces, second.faces + len(first.vertices)])
    names = "vertices", "normals", "colours"
    parts = (np.concatenate([getattr(first, name), getattr(second, name)]) for name in names)
    return Tube(faces=faces, **dict(zip(names, parts, strict=True)))


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
