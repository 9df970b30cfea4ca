"""Over what the random runs range: everything that a user can set about scope, scene and inputs, and how far."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.envs.study.paths import with_values
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions
from haustra.quantity import load_quantities

BEYOND = 0.1
"""How far outside the ranges the other half of the runs goes, as a share of each range's width, on either side."""


@dataclass(frozen=True)
class Range:
    """One variable: where it goes, and its ends."""

    path: str
    """`design.…` and `scene.…` as in studies, `input.…` for what the hands do."""
    low: float
    high: float
    unit: str
    source: str
    log: bool = False
    """Spread evenly in the logarithm."""
    whole: bool = False

    def at(self, share: float, *, beyond: float = 0.0) -> float:
        """The value at a share of the range, which is widened by `beyond` of its width at both ends."""
        share = share * (1 + 2 * beyond) - beyond
        if self.log:
            value = float(np.exp(np.log(self.low) + share * np.log(self.high / self.low)))
        else:
            value = self.low + share * (self.high - self.low)
        return float(round(value)) if self.whole else value

    def holds(self, value: float) -> bool:
        """Whether the value is inside, to rounding."""
        slack = 1e-9 * (self.high - self.low)
        return self.low - slack <= value <= self.high + slack


def ranges() -> tuple[Range, ...]:
    """All variables. Ends of a scope's numbers are those of adult and paediatric together (docs/numbers.md)."""
    scope, contact = (load_quantities(asset(f"numbers/{name}.toml")) for name in ("scope", "contact"))

    def number(path: str, name: str, *, log: bool = False) -> Range:
        both = [scope[f"scope.{kind}.{name}"] for kind in ("adult", "paediatric")]
        low, high = min(each.low for each in both), max(each.high for each in both)
        return Range(f"design.{path}", low, high, both[0].unit, "numbers", log)

    def worn(name: str) -> Range:
        quantity = scope[f"scope.worn.{name}"]
        return Range(f"design.wires.{name}", 0.0, quantity.high, quantity.unit, "numbers; 0 for a new scope")

    def wall(name: str, quantity: str) -> Range:
        found = contact[f"contact.{quantity}"]
        return Range(f"scene.{name}", found.low, found.high, found.unit, "numbers")

    return (
        number("diameter", "diameter"),
        number("mass_per_length", "mass_per_length"),
        number("relaxation_time", "relaxation_time", log=True),
        number("shaft.*.flexural_rigidity", "flexural_rigidity", log=True),
        number("shaft.*.torsional_rigidity", "torsional_rigidity", log=True),
        number("bending.flexural_rigidity", "bending_flexural_rigidity", log=True),
        number("bending.torsional_rigidity", "bending_torsional_rigidity", log=True),
        number("bending.length", "bending_length"),
        number("tip.length", "tip_length"),
        number("limits.up", "tip_angle_up_down"),
        number("limits.left", "tip_angle_left_right"),
        number("wires.pull_limit", "tendon_pull_limit"),
        worn("friction"),
        worn("hysteresis"),
        wall("wall_stiffness", "wall_stiffness"),
        wall("friction", "friction"),
        Range("scene.push_limit", 1.0, contact["contact.push_force_peak"].high, "N", "numbers; 1 N at least"),
        Range("scene.timestep", 0.001, 0.02, "s", "SceneOptions", log=True),
        Range("scene.shaft_cell", 0.02, 0.1, "m", "SceneOptions", log=True),
        Range("scene.bending_cell", 0.01, 0.05, "m", "SceneOptions", log=True),
        Range("scene.twist_hinges", 0, 8, "1", "SceneOptions", whole=True),
        Range("scene.wall_damping_time", 0.001, 0.02, "s", "SceneOptions", log=True),
        Range("scene.start_depth", 0.01, 0.05, "m", "SceneOptions"),
        Range("input.push_rate", 0.0, 0.3, "m/s", "issue: pushes to 0.3 m/s"),
        Range("input.roll_rate", 0.0, 6.28, "rad/s", "a turn a second"),
        Range("input.pull", 0.0, 1.0, "of pull_limit", "all of it"),
        Range("input.gravity", 0.0, 9.81, "m/s^2", "none to all of it, any direction"),
    )


@dataclass(frozen=True)
class Setting:
    """One random run."""

    design: ScopeDesign
    options: SceneOptions
    push_rate: float
    roll_rate: float
    pull: float
    """Share of the largest pull of the wires."""


def build_setting(values: Mapping[str, float], *, wall_law: str, turn: Float[np.ndarray, " 3"]) -> Setting:
    """Design, options and inputs with these values; gravity points along `turn`, a unit vector.

    Raises:
        InvalidDesignError: when the design is impossible.
        InvalidOptionError: when an option cannot be honoured.
    """
    design = {path.removeprefix("design."): value for path, value in values.items() if path.startswith("design.")}
    scene: dict[str, Any] = {p.removeprefix("scene."): v for p, v in values.items() if p.startswith("scene.")}
    basic = named_design("adult")
    # What hangs together goes together: opposite limits, wires inside the sheath.
    design |= {"limits.down": design["limits.up"], "limits.right": design["limits.left"]}
    design["wires.routing_radius"] = basic.wires.routing_radius * design["diameter"] / basic.diameter
    options = with_values(SceneOptions(), scene)
    gravity = tuple(float(values["input.gravity"] * part) for part in turn)
    return Setting(
        design=with_values(basic, design),
        options=replace(options, wall_law=wall_law, gravity=gravity),  # type: ignore[arg-type]
        push_rate=values["input.push_rate"],
        roll_rate=values["input.roll_rate"],
        pull=values["input.pull"],
    )


def draw(variables: Sequence[Range], count: int, *, seed: int, beyond: float) -> list[dict[str, float]]:
    """Values of `count` runs, by Sobol's sequence (scrambled)."""
    import warnings

    from scipy.stats import qmc

    with warnings.catch_warnings():
        # It asks for powers of two, whose balance a count of our own gives up.
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        shares = qmc.Sobol(len(variables), rng=seed).random(count)
    return [
        {
            variable.path: variable.at(float(share), beyond=beyond)
            for variable, share in zip(variables, row, strict=True)
        }
        for row in shares
    ]
