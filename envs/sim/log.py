"""MuJoCo's own log: warnings go to stderr, and no file appears in whatever folder the user stands in."""

import mujoco


def log_to_stderr_only() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT into the current folder; what it warns of stays in `data.warning`.

    Holds for the whole process and all its threads; calling it again changes nothing.
    """
    config = mujoco.MjLogConfig.get()
    config.logto_file = False
    config.set()
