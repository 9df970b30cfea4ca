"""haustra: simulated colons for designing robotic colonoscopes, on MuJoCo.

Public names load on first use, so that `import haustra` stays light.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from haustra.models.anatomy.colon import Colon as Colon
    from haustra.models.wall.pieces.wall import Wall as Wall

_HOME = {
    "Colon": "haustra.models.anatomy.colon",
    "Wall": "haustra.models.wall.pieces.wall",
}

__all__ = ["Colon", "Wall", "__version__"]


def __getattr__(name: str) -> object:
    """Load the public name from its home module."""
    if name not in _HOME:
        raise AttributeError(f"module 'haustra' has no attribute '{name}'. Public names: {', '.join(sorted(_HOME))}")
    return getattr(import_module(_HOME[name]), name)
