"""Three ways to model a scene, by what they cost and how far they are off."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from haustra.models.scene import SceneOptions


@dataclass(frozen=True)
class Preset:
    """Named changes to the default options."""

    name: str
    changes: Mapping[str, object] = field(default_factory=dict)

    def apply(self, options: SceneOptions | None = None) -> SceneOptions:
        """Those options with the preset's changes."""
        return replace(options or SceneOptions(), **self.changes)


PRESETS = {
    preset.name: preset
    for preset in (
        Preset("fast", {"shaft_cell": 0.0625, "bending_cell": 0.034, "twist_hinges": 2, "timestep": 0.01}),
        Preset("balanced"),
        Preset(
            "accurate",
            {"wall_law": "planes", "shaft_cell": 0.025, "bending_cell": 0.0085, "timestep": 0.0025},
        ),
    )
}
"""By name, cheapest first."""
