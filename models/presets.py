"""Three ways to model a scene, by what they cost and how far they are off: `fast`, `balanced`, `accurate`.

Their errors are measured, not promised: `haustra bench accuracy` finds them, and assets/presets.toml holds them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from haustra.assets import asset
from haustra.errors import InvalidOptionError
from haustra.models.scene import SceneOptions
from haustra.quantity import Quantity, load_quantities

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

    def apply(self, options: SceneOptions | None = None) -> SceneOptions:
        """Those options, computed as the preset says; what is in the scene stays."""
        return replace(options or SceneOptions(), **self.modelling)

    @property
    def modelling(self) -> dict[str, Any]:
        """Value of every option of `MODELLING`."""
        return {name: getattr(SceneOptions(), name) for name in MODELLING} | dict(self.changes)

    def measured(self) -> dict[str, Quantity]:
        """Errors and speed in an insertion, by name; empty for a preset that was never measured.

        `tip_error` [m], `push_error` [1], `wall_force_error` [1] and `real_time_factor` [1].
        """
        prefix = f"{self.name}."
        return {name.removeprefix(prefix): each for name, each in _measured().items() if name.startswith(prefix)}


PRESETS: Mapping[str, Preset] = {
    preset.name: preset
    for preset in (
        Preset(
            "fast",
            "three quarters as many joints in the shaft and half in the bending section, for searches",
            {"shaft_cell": 0.0625, "bending_cell": 0.034},
        ),
        Preset("balanced", "the defaults"),
        Preset(
            "accurate",
            "twice the joints against the wall's exact surface and stiffness",
            {"wall_law": "planes", "shaft_cell": 0.025, "bending_cell": 0.0085, "sample_spacing": 0.0084},
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
    """Name of the preset that computes a scene as those options do; `custom` when none does."""
    for preset in PRESETS.values():
        if all(getattr(options, entry) == value for entry, value in preset.modelling.items()):
            return preset.name
    return CUSTOM


def error_class(options: SceneOptions) -> dict[str, float | str | None]:
    """What a run with those options says of its own accuracy, as plain JSON values; None where nothing was measured."""
    name = preset_of(options)
    found = PRESETS[name].measured() if name in PRESETS else {}

    def value(entry: str, unit: float = 1.0) -> float | None:
        return found[entry].value * unit if entry in found else None

    return {
        "preset": name,
        "preset_tip_error_mm": value("tip_error", 1e3),
        "preset_push_error": value("push_error"),
        "preset_wall_force_error": value("wall_force_error"),
    }


@cache
def _measured() -> dict[str, Quantity]:
    return load_quantities(asset("presets.toml"))
