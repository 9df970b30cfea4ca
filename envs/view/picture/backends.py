"""Which of MuJoCo's OpenGL back-ends really draw here, found out where a crash does no harm."""

import os
import subprocess
import sys
from functools import cache

BACKENDS = ("egl", "osmesa", "glfw")
"""MuJoCo's names (environment variable MUJOCO_GL), in the order in which they are preferred."""

_PROBE_LIMIT = 30.0  # [s]; a software EGL's first context takes about 1 s, a cold disk several
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 3'/><geom size='.1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().std() > 0, "drew an empty picture"
"""


@cache
def probe_backends() -> dict[str, str]:
    """Draw 32 x 32 pixels with each back-end, each in its own process; the answer is kept for the life of this one.

    Returns:
        For each name of `BACKENDS`, 'works' or the reason why it does not.
    """
    children = {name: _start(name) for name in BACKENDS}
    return {name: _verdict(child) for name, child in children.items()}


def best_backend() -> str | None:
    """The back-end to draw with: MUJOCO_GL when it is set and works, else the first that works, else None."""
    working = [name for name, verdict in probe_backends().items() if verdict == "works"]
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in BACKENDS:
        return asked if asked in working else None
    return working[0] if working else None


def backend_environment(name: str) -> dict[str, str]:
    """Environment variables under which a child process draws with the named back-end."""
    inherited = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"}
    return inherited | {"MUJOCO_GL": name}


def _start(name: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _PROBE],
        env=backend_environment(name),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def _verdict(child: subprocess.Popen[str]) -> str:
    try:
        _, complaint = child.communicate(timeout=_PROBE_LIMIT)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return f"no picture within {_PROBE_LIMIT:.0f} s"
    if child.returncode == 0:
        return "works"
    if child.returncode < 0:
        return f"died with signal {-child.returncode}"
    lines = [line.strip() for line in complaint.splitlines() if line.strip()]
    return lines[-1] if lines else f"exit code {child.returncode}"
