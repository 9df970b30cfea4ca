"""Which backend honours which field of a scene, a design and a task; what a backend cannot honour it refuses by name.

One table, `CAPABILITIES`, holds every field there is. Constructors of backends call `require_supported`;
`tests/envs/sim/test_capabilities.py` runs each field on each backend and finds its effect or its refusal.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.device_scene import HONOURED
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import Scene
from haustra.models.wall.elasticity import LINEAR

BACKENDS: Mapping[str, str] = {
    "native": "one scene on MuJoCo's CPU engine",
    "native-batch": "many scopes on MuJoCo's CPU threads",
    "linear": "many scopes, or one, on CPU threads or a GPU, as a chain in linear time",
    "warp": "many scopes on MuJoCo Warp",
}
"""What each backend is, by name."""
MANY_WORLDS = ("native-batch", "linear", "warp")
"""Backends that step many scopes at once, in tasks too."""


@dataclass(frozen=True)
class Capability:
    """Who honours one field."""

    path: str
    """Where the field is: scene, design, randomisation, task or tracked, then its name."""
    only: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    """Backends that refuse values, and the values that they honour; the others honour all."""
    about: str = ""
    """What else there is to know."""

    def honoured(self, backend: str, value: Any) -> bool:
        """Whether a backend honours a value."""
        return backend not in self.only or value in self.only[backend]


def _in(room: str, *names: str, **more: Any) -> tuple[Capability, ...]:
    return tuple(Capability(f"{room}.{name}", **more) for name in names)


def _only(*values: Any, backends: tuple[str, ...] = MANY_WORLDS) -> Mapping[str, tuple[Any, ...]]:
    return dict.fromkeys(backends, values)


_SECTION = (
    *("length", "flexural_rigidity", "torsional_rigidity", "stiffening", "minimum_bend_radius"),
    *("bias_up_deg", "bias_left_deg"),
)
_WHEELS = "counts where wheels steer, which native-batch and warp refuse"
_LABEL = "a name, which shapes nothing"
_FILLED = "against the table; of one scope or many on linear's CPU threads, of one natively"
_TABLE = "other walls than the table are refused any but the usual"

SCENE = (
    *_in("scene", "timestep", "shaft_cell", "bending_cell", "twist_hinges", "sample_spacing"),
    *_in("scene", "largest_bend_deg", about="many worlds share the joints that suit the longest of their colons"),
    *_in("scene", "wall_stiffness", "wall_damping_time", "friction", "push_limit", "torque_limit", "start_depth"),
    *_in("scene", "insertion_limit"),
    *_in("scene", "gravity", about="in each colon's own frame"),
    *_in("scene", "segment_stiffness", only=_only(())),
    *_in("scene", "elasticity", only=_only(LINEAR, backends=("warp",)), about=_TABLE),
    *_in("scene", "friction_rise", only=_only(0.0, backends=("native-batch", "warp")), about=_TABLE),
    *_in("scene", "wall_law", only=_only("table")),
    *_in("scene", "mesentery", about="drawn to scopes between their spheres too, against every wall"),
    *_in("scene.abdomen", "posture", "mobile", "adhesions", "pressed", "hand", about="of a colon that moves"),
    *_in("scene.abdomen", "rooted", "envelope", "breathing", "torsion", about="of a colon that moves"),
    *_in("scene.abdomen", "loops_touch", only=_only(False, backends=("warp",)), about="of a colon that moves"),
    *_in("scene", "water", only=_only(0.0, backends=("native-batch", "warp")), about=f"with gas; {_FILLED}"),
    *_in("scene", "gas", only=_only(None, backends=("native-batch", "warp")), about=_FILLED),
    *_in("scene", "gas_flow", "gas_start", about="with gas"),
    *_in("scene", "softening", only=_only(False, backends=("native-batch", "warp"))),
)
"""Fields of `SceneOptions`."""

DESIGN = (
    *_in("design", "name", about=_LABEL),
    *_in("design", "diameter", "mass_per_length", "relaxation_time", "variable_stiffness"),
    *_in("design", "temperature_factor_bending", "temperature_factor_torsion"),
    *_in("design", "working_length", about="a check of the design, which shapes nothing"),
    *_in("design.shaft", *_SECTION),
    *_in("design.bending", *_SECTION),
    *_in("design.limits", "up", "left", "down", "right"),
    *_in("design.wires", "routing_radius", "pull_limit", "friction", "hysteresis"),
    *_in("design.wires", "slack", "compliance", about=_WHEELS),
    *_in("design.tip", "length"),
    *_in("design.tip", "field_of_view_deg", "lens", about="for pictures only"),
)
"""Fields of `ScopeDesign` and its parts."""

CAMERA = (
    *_in("design.tip", "camera_offset_up", "camera_offset_left", "camera_tilt_deg", only=_only(0.0)),
    *_in("design.tip", "light", only=_only(1.0)),
)
"""Fields of `ScopeTip` that shape pictures only; tasks, which draw their own, refuse what they cannot show."""

_PULLED = "drawn by the task, which every backend steps"
RANDOMISATION = (
    *_in("randomisation", "friction", "wall_stiffness", "shaft_stiffness", "start_roll"),
    *_in("randomisation", "wire_gain", "wire_slack", about=_PULLED),
)
"""Fields of `Randomisation`."""

_UNSEEN = "on linear's CPU threads, but for pictures and depth, which show colons as they were given"
_RULES = "a rule of the task, which every backend steps"
TASK = (
    *_in(
        "task", "task", only=_only("insertion", backends=("warp",)), about="linear alone withdraws from moving colons"
    ),
    *_in("task", "mesentery", "design", "difficulty", "seeds"),
    *_in("task", "water", only=_only(0.0, backends=("native-batch", "warp")), about="with gas"),
    *_in("task", "gas", only=_only(None, backends=("native-batch", "warp")), about=_UNSEEN),
    *_in("task", "gas_flow", "gas_start", about="with gas"),
    *_in("task", "gas_action", only=_only(False, backends=("native-batch", "warp")), about="with gas"),
    *_in("task", "bleeding", about="told by steps; refused in place and with pictures in colour"),
    *_in("task", "observation", "privileged", "imager", "memory", "picture_size", "depth", "pictures", about=_RULES),
    *_in("task", "stool", "mucus", about="in pictures in colour, which every backend's worlds have; refused without"),
    *_in("task", "randomisation", about="its fields follow"),
    *_in("task.drive", "control_interval", "push_rate", "roll_rate", "wheel_rate", "hand_lead", about=_RULES),
    *_in("task.limits", "seconds", "perforation_force", "safe_force", "caecum_margin", "pace", about=_RULES),
    *_in("task.weights", "progress", "advance", "facing", "reached", "time", "wall_force", about=_RULES),
    *_in("task.weights", "looping", "perforation", "coverage", "haste", about=_RULES),
)
"""Fields of `TaskConfig` and its parts."""

_SOLVED = "refused where no force table is solved for the tread"
_PAIRED = "with worm and tread, which must mesh"
TRACKED = (
    *_in("tracked", "name", about=_LABEL),
    *_in("tracked", "scale", about="size of masses, dampers and contacts of the model itself"),
    *_in("tracked.tread", "pitch", "tooth_width", about=f"{_SOLVED}; {_PAIRED}"),
    *_in("tracked.tread", "tooth_height", "belt_thickness", "tip_radius", about=_SOLVED),
    *_in("tracked.tread", "width", "tissue_thickness", "clearance", about=_SOLVED),
    *_in("tracked.tread", "tip_spacing"),
    *_in("tracked.worm", "starts", "lead", about=_PAIRED),
    *_in("tracked.worm", "efficiency", "torque_limit"),
    *_in("tracked.shaft", "onset_speed", "efficiency", "stall_excess"),
    *_in("tracked.bellows", "stiffness", "preload", "pressure", "area"),
    *_in("tracked.bellows", "lowest_pressure", "highest_pressure", "response", about="where bellows are regulated"),
    *_in("tracked.tether", "mass_per_length", "friction", "held", about="in a colon"),
    *_in("tracked.speed_friction", "peak_speed", "exponent"),
    *_in("tracked", "nominal_diameter", "smallest_diameter", "largest_diameter"),
    *_in("tracked", "core_length", "core_diameter", "mass"),
)
"""Fields of `TrackedDesign` and its parts."""
TRACKED_ON: Mapping[str, str] = {
    "native": "yes",
    "native-batch": "no tracked robots",
    "linear": "no tracked robots",
    "warp": "on rigs",
}
"""Where each backend runs tracked robots: on Warp on the rigs of studies of propulsion, not in colons."""

DEVICE = (
    *_in("device", *(name for name in HONOURED if name not in ("mesentery", "wall_law", "elasticity", "gas"))),
    *_in("device", "gas", only=_only(None, backends=("warp",)), about="of one world"),
    *_in("device", "elasticity", only=_only(LINEAR, backends=("warp",)), about=_TABLE),
    *_in("device", "wall_law", only=_only("table", backends=("warp",)), about="others than the table in one world"),
    *_in("device", "mesentery", about="drawn to a vine or a scope between its spheres by the table only"),
    *_in("device.abdomen", "loops_touch", only=_only(False, backends=("warp",)), about="of a colon that moves"),
)
"""Options of scenes of any device (`haustra.models.device_scene`); which backends step devices, says
`haustra.envs.sim.device_worlds`."""

CAPABILITIES = (*SCENE, *DESIGN, *CAMERA, *TASK, *RANDOMISATION, *TRACKED, *DEVICE)


def require_supported(scene: Scene, backend: str) -> None:
    """Refuse what a backend cannot honour of a scene.

    Raises:
        InvalidOptionError: when the backend is not known.
        UnsupportedSceneError: naming the field, its value, the backend, and those that honour it.
    """
    _require(backend, (*SCENE, *DESIGN), {"scene": scene.options, "design": scene.design})


def require_task_supported(config: Any, design: ScopeDesign, backend: str) -> None:
    """Refuse what a backend of many worlds cannot honour of a task and its design; its scene is checked when built.

    Args:
        config: a `haustra.envs.tasks.config.TaskConfig`.
        design: of the task's scope.
        backend: one of `MANY_WORLDS`.

    Raises:
        InvalidOptionError: when the backend is not known.
        UnsupportedSceneError: naming the field, its value, the backend, and those that honour it.
    """
    _require(backend, (*TASK, *CAMERA), {"task": config, "design": design})


def _require(backend: str, table: tuple[Capability, ...], parts: Mapping[str, Any]) -> None:
    if backend not in BACKENDS:
        raise InvalidOptionError(f"Backend '{backend}' is not known. Known: {', '.join(BACKENDS)}.")
    for entry in table:
        if not entry.only:
            continue
        room, _, name = entry.path.partition(".")
        value = attrgetter(name)(parts[room])
        if not entry.honoured(backend, value):
            others = [other for other in BACKENDS if entry.honoured(other, value)]
            raise UnsupportedSceneError(
                f"The backend '{backend}' cannot honour {entry.path} = {value!r}, only "
                f"{', '.join(map(repr, entry.only[backend]))}; {', '.join(others) or 'none'} can."
            )
