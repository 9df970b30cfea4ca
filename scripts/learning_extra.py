"""Whether the packages for learning are there."""

from importlib.util import find_spec


def require_learning(*names: str) -> None:
    """Say in one line what is missing.

    Args:
        names: packages that are needed.

    Raises:
        MissingDependencyError: naming the extra.
    """
    from haustra.errors import MissingDependencyError

    missing = [name for name in names if not find_spec(name)]
    if missing:
        raise MissingDependencyError(
            f"Learning needs {', '.join(missing)}: install haustra[rl] (CPU torch: docs/how-to/train.md)."
        )
