"""One scope and several colons, ready for backends of many worlds: a scene without wall, and the colons' tables."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import TableAccuracy, Tables, lumen_table, stack

BATCH_OPTIONS = SceneOptions(
    wall_law="table", softening=False, shaft_cell=0.05, bending_cell=0.017, twist_hinges=2, sample_spacing=0.015
)
"""Some 75 dofs for a whole colon. In four grown colons the tip stays within 0.6 to 0.9 % (median) of the length inside
of that of a scope of 138 joints; with 58 dofs it was 1.4 to 2.4 % (docs/validation/worlds.md)."""


@dataclass(frozen=True)
class ScopeColonSet:
    """What backends of many worlds need."""

    scene: Scene
    """Scene of the longest colon."""
    colons: tuple[Colon, ...]
    """In the order of the tables."""
    tables: Tables
    """Lumen tables of all colons, each seen from its entry."""
    errors: tuple[TableAccuracy, ...]
    """Accuracy of each colon's table against its surface."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the colons, in the order of the tables."""
        return tuple(colon.name for colon in self.colons)

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of their centrelines [m]."""
        return tuple(colon.centreline.length for colon in self.colons)

    @property
    def tip_links(self) -> int:
        """Links of the bending section."""
        return self.scene.cable.tip_links

    def tables_on_device(self, kind: Any = np.float32) -> Tables:
        """Tables in that precision, on JAX's default device."""
        from haustra.envs.sim.device_arrays import on_device

        return on_device(self.tables, kind)


def build_bank(
    colons: Sequence[Colon],
    design: ScopeDesign,
    options: SceneOptions | None = None,
    *,
    progress: Callable[[str], None] = lambda name: None,
) -> ScopeColonSet:
    """Tabulate colons for one scope; `progress` is told each colon's name.

    Args:
        colons: at least one.
        design: the scope.
        options: how to model it; the wall law is 'table' and shafts do not soften whatever they say.
        progress: called before each colon.
    """
    options = replace(options or BATCH_OPTIONS, wall_law="table", softening=False)
    longest = max(colons, key=lambda colon: colon.centreline.length)
    scene = build_scene(longest, None, design, options, show_lumen=False)
    tables, errors = [], []
    for colon in colons:
        progress(colon.name)
        field = lumen_table(
            colon, device_radius=scene.cable.radius, with_mesentery=options.mesentery, abdomen=options.abdomen
        )
        tables.append(field.seen_from(*entry_of(colon)))
        errors.append(field.error)
    return ScopeColonSet(
        scene=scene,
        colons=tuple(colons),
        tables=stack(tables),
        errors=tuple(errors),
    )
