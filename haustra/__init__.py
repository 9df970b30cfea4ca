"""haustra: simulated colons for designing robotic colonoscopes, on MuJoCo.

Public names load on first use, so that `import haustra` stays light.
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.2.0"

if TYPE_CHECKING:
    from haustra.envs.learning.policy import load_policy as load_policy
    from haustra.envs.runs.device_run import run_device as run_device
    from haustra.envs.runs.insertion import Insertion as Insertion
    from haustra.envs.runs.measure.scores import score as score
    from haustra.envs.simulate import simulate as simulate
    from haustra.envs.tasks.registration import make_env as make_env
    from haustra.envs.view.run_folder import write_run as write_run
    from haustra.models.anatomy.colon import Colon as Colon
    from haustra.models.anatomy.grown import grow_colon as grow_colon
    from haustra.models.anatomy.label_colon import import_label_map as import_label_map
    from haustra.models.anatomy.mesh_colon import import_colon as import_colon
    from haustra.models.anatomy.store import load_colon as load_colon
    from haustra.models.anatomy.store import save_colon as save_colon
    from haustra.models.devices.base import Device as Device
    from haustra.models.devices.base import load_device as load_device
    from haustra.models.scene import Scene as Scene
    from haustra.models.scene import SceneOptions as SceneOptions
    from haustra.models.wall.pieces.build import build_wall as build_wall
    from haustra.models.wall.pieces.wall import Wall as Wall

_HOME = {
    "haustra.models.anatomy.colon": ("Colon",),
    "haustra.models.anatomy.grown": ("grow_colon",),
    "haustra.models.anatomy.mesh_colon": ("import_colon",),
    "haustra.models.anatomy.label_colon": ("import_label_map",),
    "haustra.models.anatomy.store": ("load_colon", "save_colon"),
    "haustra.models.wall.pieces.wall": ("Wall",),
    "haustra.models.wall.pieces.build": ("build_wall",),
    "haustra.models.devices.base": ("Device", "load_device"),
    "haustra.models.scene": ("Scene", "SceneOptions"),
    "haustra.envs.simulate": ("simulate",),
    "haustra.envs.runs.insertion": ("Insertion",),
    "haustra.envs.runs.device_run": ("run_device",),
    "haustra.envs.runs.measure.scores": ("score",),
    "haustra.envs.view.run_folder": ("write_run",),
    "haustra.envs.learning.policy": ("load_policy",),
    "haustra.envs.tasks.registration": ("make_env",),
}
"""Public names by the module that they stand in, in the order in which one uses them."""

__all__ = [
    "Colon",
    "Device",
    "Insertion",
    "Scene",
    "SceneOptions",
    "Wall",
    "__version__",
    "build_wall",
    "grow_colon",
    "import_colon",
    "import_label_map",
    "load_colon",
    "load_device",
    "load_policy",
    "make_env",
    "run_device",
    "save_colon",
    "score",
    "simulate",
    "write_run",
]


def __getattr__(name: str) -> object:
    """Load the public name from its home module."""
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module 'haustra' has no attribute '{name}'. Public names: {', '.join(sorted(__all__))}")


def __dir__() -> list[str]:
    """Public names, also those that nobody has used yet."""
    return sorted(__all__)
