"""The scene as MuJoCo's own renderer draws it.

In a child process: OpenGL libraries may crash, and must not take a run along.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.view.picture.backends import backend_environment, best_backend, probe_backends
from haustra.errors import MissingDependencyError

_LIMIT = 120.0
"""Time for start-up and first frame, and again for every hundred frames [s]; software OpenGL draws some 10 a second."""


def scene_frames(
    model: mujoco.MjModel,
    qpos: Float[np.ndarray, "frames nq"],
    *,
    camera: str | None = None,
    width: int = 640,
    height: int = 480,
) -> UInt8[np.ndarray, "frames height width 3"]:
    """Draw a scene at the given positions with MuJoCo's renderer.

    Args:
        model: the compiled scene.
        qpos: joint positions of each frame.
        camera: name of a camera of the model; the free camera when None.
        width: columns of each frame.
        height: rows of each frame.

    Returns:
        The frames, RGB.

    Raises:
        MissingDependencyError: when no OpenGL back-end works here, or the one chosen fails on this scene.
    """
    backend = best_backend()
    if backend is None:
        reasons = "; ".join(f"{name}: {verdict}" for name, verdict in probe_backends().items())
        raise MissingDependencyError(f"MuJoCo's renderer works with no OpenGL back-end here ({reasons}): install EGL.")
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        mujoco.mj_saveModel(model, str(where / "model.mjb"), None)
        np.save(where / "qpos.npy", qpos)
        command = [sys.executable, "-m", __name__, folder, camera or "", str(width), str(height)]
        _run(command, backend, _LIMIT * (1 + len(qpos) / 100))
        return np.load(where / "frames.npy")


def _run(command: list[str], backend: str, limit: float) -> None:
    try:
        finished = subprocess.run(
            command, env=backend_environment(backend), capture_output=True, text=True, timeout=limit, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise MissingDependencyError(f"MuJoCo's renderer on {backend} drew nothing within {limit:.0f} s.") from error
    if finished.returncode != 0:
        last = (finished.stderr.strip().splitlines() or [f"exit code {finished.returncode}"])[-1]
        raise MissingDependencyError(f"MuJoCo's renderer on {backend} failed: {last}")


def _draw(folder: Path, camera: str, width: int, height: int) -> None:
    """The child process: read the model and positions, write the frames."""
    model = mujoco.MjModel.from_binary_path(str(folder / "model.mjb"))
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    data = mujoco.MjData(model)
    frames = []
    with mujoco.Renderer(model, height, width) as renderer:
        for positions in np.load(folder / "qpos.npy"):
            data.qpos[:] = positions
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera=camera or -1)
            frames.append(renderer.render())
    np.save(folder / "frames.npy", np.stack(frames))


if __name__ == "__main__":
    _draw(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
