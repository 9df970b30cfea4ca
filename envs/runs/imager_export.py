"""A finished run as a magnetic imager would have recorded it."""

from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.runs.imager_files import CAECUM, HEPATIC, SPLENIC, START, ImagerRecording
from haustra.errors import InvalidOptionError, UnreadableFileError
from haustra.models.anatomy.colon import Colon
from haustra.reading import LARGEST_TRAJECTORY, read_arrays

COIL_SPACING = 0.1
"""Distance between coils along the scope [m]; engineering choice, that of the imager that drivers see."""
_ARRAYS = ("time", "qpos", "tip_arc")
_LANDMARKS = {SPLENIC: "transverse", HEPATIC: "ascending", CAECUM: "caecum"}
"""Segments at whose beginning each landmark lies."""


def recording_of_run(folder: Path, *, interval: float, coils: int, colon: Colon | None = None) -> ImagerRecording:
    """Coils along the whole scope of a run, the first at its tip, those outside the anus too.

    Args:
        folder: of the run: its scene.xml and trajectory.npz are read.
        interval: time between two records [s].
        coils: how many; as many as the modelled part of the scope has room for at most.
        colon: tells when the tip first came to each landmark; no landmarks when None.

    Raises:
        UnreadableFileError: when a file is missing or damaged, or the run is empty.
        InvalidOptionError: when the run was recorded less often than asked.
    """
    model = _model(folder / "scene.xml")
    path = folder / "trajectory.npz"
    seen = read_arrays(path, _ARRAYS, largest=LARGEST_TRAJECTORY)
    time, count = seen["time"], len(seen["time"])
    if [seen[name].shape for name in _ARRAYS] != [(count,), (count, model.nq), (count,)] or count < 2:
        raise UnreadableFileError(f"'{path}' holds no run of the scene beside it with at least two records.")
    step = float(time[1] - time[0])
    if interval < 0.999 * step:
        raise InvalidOptionError(f"The run was recorded every {step:g} s: ask for an interval of that or more.")
    kept = slice(None, None, max(1, round(interval / step)))
    began = time - time[0]
    places = _coil_places(model, seen["qpos"][kept], coils)
    return ImagerRecording(began[kept], places, {START: 0.0, **_landmarks(began, seen["tip_arc"], colon)})


def _model(path: Path) -> mujoco.MjModel:
    if not path.is_file():
        raise UnreadableFileError(f"'{path}' is missing: name a folder that 'haustra run' wrote with a scope.")
    try:
        model = mujoco.MjSpec.from_file(str(path)).compile()
        model.site("scope/tip")
    except (ValueError, KeyError) as error:
        raise UnreadableFileError(f"'{path}' is no scene with a scope: {str(error).splitlines()[0]}") from error
    return model


def _coil_places(
    model: mujoco.MjModel, qpos: Float[np.ndarray, "records q"], coils: int
) -> Float[np.ndarray, "records coils 3"]:
    """Places of coils fixed in the links, at multiples of `COIL_SPACING` behind the tip with the scope straight [m]."""
    data, tip = mujoco.MjData(model), model.site("scope/tip").id
    links = [body for body in range(model.nbody) if model.body(body).name.startswith("scope/link_")]
    mujoco.mj_kinematics(model, data)
    straight = np.linalg.norm(data.site_xpos[tip] - data.xpos[links], axis=1)
    order = np.argsort(straight)
    behind = COIL_SPACING * np.arange(1, coils)
    behind = behind[behind <= straight.max()]
    within = np.array(links)[order][np.searchsorted(straight[order], behind)]
    ahead = np.linalg.norm(data.site_xpos[tip] - data.xpos[within], axis=1) - behind
    towards = (data.site_xpos[tip] - data.xpos[within]) / np.linalg.norm(
        data.site_xpos[tip] - data.xpos[within], axis=1, keepdims=True
    )
    own = np.einsum("cji,cj->ci", data.xmat[within].reshape(-1, 3, 3), ahead[:, None] * towards)
    places = np.empty((len(qpos), 1 + len(behind), 3))
    for record, values in enumerate(qpos):
        data.qpos[:] = values
        mujoco.mj_kinematics(model, data)
        places[record, 0] = data.site_xpos[tip]
        places[record, 1:] = data.xpos[within] + np.einsum("cij,cj->ci", data.xmat[within].reshape(-1, 3, 3), own)
    return places


def _landmarks(time: np.ndarray, tip_arc: np.ndarray, colon: Colon | None) -> dict[str, float]:
    starts = {} if colon is None else {segment.name: segment.start for segment in colon.segments}
    found = {}
    for event, segment in _LANDMARKS.items():
        there = tip_arc >= starts.get(segment, np.inf)
        if there.any():
            found[event] = float(time[there.argmax()])
    return found
