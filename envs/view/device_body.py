"""A device as pictures show it: what MuJoCo draws of it inside the patient, and its tether along the lumen."""

from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.runs.device_run import DeviceRun
from haustra.envs.view.picture.shapes import drawn_shapes
from haustra.envs.view.picture.tube import Tube, tube
from haustra.models.scene import entry_of

_SHOWN_OUTSIDE, _BESIDE = 0.03, 0.03
"""What lies further before the anus, and so near to the way in, is not shown [m]; engineering choice."""


def device_body(
    run: DeviceRun, model: mujoco.MjModel, data: mujoco.MjData, line: Float[np.ndarray, "stations 3"]
) -> Tube:
    """The device where it is in `data`, in a colon whose axis runs along `line` from the anus on [m]."""
    body = _inside(drawn_shapes(model, data), run)
    if run.trail is None:
        return body
    site, radius = run.trail
    return _joined(body, _tether(line, data.site(site).xpos, radius))


def _inside(body: Tube, run: DeviceRun) -> Tube:
    """A body without what of it lies straight before the anus, in wait."""
    anus, frame = entry_of(run.rest)
    local = (body.vertices - anus) @ frame
    waits = (local[:, 2] < -_SHOWN_OUTSIDE) & (np.hypot(local[:, 0], local[:, 1]) < _BESIDE)
    return replace(body, faces=body.faces[~waits[body.faces].all(axis=1)])


def _tether(line: Float[np.ndarray, "stations 3"], end: Float[np.ndarray, "3"], radius: float) -> Tube:
    """A tether along the lumen's axis from the anus to where it hangs on the device."""
    near = int(np.linalg.norm(line - end, axis=1).argmin())
    return tube(np.vstack([line[: max(near - 3, 2)], end]), radius, bending_length=0.0)


def _joined(first: Tube, second: Tube) -> Tube:
    faces = np.concatenate([first.faces, second.faces + len(first.vertices)])
    names = "vertices", "normals", "colours"
    parts = (np.concatenate([getattr(first, name), getattr(second, name)]) for name in names)
    return Tube(faces=faces, **dict(zip(names, parts, strict=True)))
