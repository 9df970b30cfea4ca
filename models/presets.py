"""Three ways to model a scene, by what they cost and how far they are off: `fast`, `balanced`, `accurate`.

Their errors are measured, not promised: `haustra.models.accuracy`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from haustra.errors import InvalidOptionError
from haustra.models.scene import SceneOptions

CUSTOM = "custom"
"""Name of options that are no preset's."""

MODELLING = (
    "timestep",
    "shaft_cell",
    "largest_bend_deg",
    "bending_cell",
    "twist_hinges",
    "wall_law",
    "sample_spacing",
)
"""Options that say how a scene is computed; the others say what is in it."""


@dataclass(frozen=True)
class Preset:
    """Named changes to the default options."""

    name: str
    about: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Options that differ from the defaults; only of `MODELLING`."""
    in_linear_time: Mapping[str, Any] = field(default_factory=dict)
    """Those that differ from the defaults against the table of the lumen: linear time makes joints cheap there."""

    def apply(self, options: SceneOptions | None = None, *, law: str | None = None) -> SceneOptions:
        """Those options, computed as the preset says; what is in the scene stays.

        Args:
            options: the defaults when None.
            law: what the scope meets (`SceneOptions.wall_law`); as the preset has it when None.
        """
        return replace(options or SceneOptions(), **(self.modelling if law is None else self.against(law)))

    @property
    def modelling(self) -> dict[str, Any]:
        """Value of every option of `MODELLING`."""
        plain = SceneOptions()
        return {name: getattr(plain, name) for name in MODELLING} | dict(self.changes)

    def against(self, law: str) -> dict[str, Any]:
        """Value of every option of `MODELLING` where the scope meets that law."""
        plain = SceneOptions()
        usual = {name: getattr(plain, name) for name in MODELLING}
        return usual | dict(self.in_linear_time if law == TABLE else self.changes) | {"wall_law": law}


TABLE = "table"
"""Wall law of scenes that are stepped in linear time."""

PRESETS: Mapping[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            "fast",
            "three quarters as many joints in the shaft and half in the bending section, for searches",
            {"shaft_cell": 0.0625, "bending_cell": 0.034},
            {"shaft_cell": 0.035, "bending_cell": 0.0114, "timestep": 0.01},
        ),
        Preset("balanced", "the defaults", {}, {"shaft_cell": 0.025, "bending_cell": 0.0085}),
        Preset(
            "accurate",
            "twice the joints against the wall's exact surface and stiffness",
            {"wall_law": "planes", "shaft_cell": 0.025, "bending_cell": 0.0085, "sample_spacing": 0.0084},
            {"shaft_cell": 0.0167, "bending_cell": 0.0085, "timestep": 0.000625},
        ),
    )
}
"""By name, cheapest first."""


def find_preset(name: str) -> Preset:
    """The preset of that name.

    Raises:
        InvalidOptionError: when there is none; the message lists those there are.
    """
    if name not in PRESETS:
        raise InvalidOptionError(f"Preset '{name}' is not known. Known: {', '.join(PRESETS)}.")
    return PRESETS[name]


def preset_of(options: SceneOptions) -> str:
    """Name of the preset whose joints and time step those options have; `custom` when none does.

    What the scope meets, `wall_law`, is stated beside it: a preset can be run against any wall.
    """
    for preset in PRESETS.values():
        if options == preset.apply(options, law=options.wall_law):
            return preset.name
    return CUSTOM
