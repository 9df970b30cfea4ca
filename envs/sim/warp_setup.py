"""MuJoCo Warp as this project uses it: there or not, and silent."""

from importlib.util import find_spec

from haustra.errors import MissingDependencyError


def use_warp() -> None:
    """Make sure that Warp is there, and that it does not tell of every kernel on stdout, where results go.

    Raises:
        MissingDependencyError: when it is not installed.
    """
    if find_spec("warp") is None:
        raise MissingDependencyError("The backend 'warp' needs Warp: pip install 'haustra[warp]'.")
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
