"""Cases that were built before: grown once, kept in the cache, read in milliseconds."""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.children import children
from haustra.envs.runs.measure.containment import LumenWidths, widths_along
from haustra.envs.tasks.case import TabulatedColon, case_of, load_case, save_case
from haustra.errors import HaustraError, InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import colon_hash, load_colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.gas.compartments import opened_at
from haustra.models.presets import PRESETS, TABLE
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.cache import cache_folder
from haustra.models.wall.lumen_table import ANGLES, STATION_STEP, Tables, stack
from haustra.provenance import content_hash, package_versions

TASK_OPTIONS = replace(PRESETS["fast"].apply(law=TABLE), softening=False, timestep=SceneOptions().timestep)
"""Cells of the preset `fast`, at the usual time step. With coarser ones folds hold the scope and let it go in jolts, so
that drivers got stuck that do not with finer ones (docs/validation/cells.md)."""
_FORMAT = 4
"""Version of the files' format; a bank of another format is built anew."""


@dataclass(frozen=True)
class ColonSet:
    """Colons that episodes draw from, and the scope that goes into all of them."""

    cases: tuple[TabulatedColon, ...]
    design: ScopeDesign
    options: SceneOptions

    def __deepcopy__(self, memo: object) -> "ColonSet":
        """Itself: it never changes, and Gymnasium copies what it is asked to make an environment from."""
        return self

    def with_mesentery(self, mesentery: bool) -> "ColonSet":
        """The bank of colons that move on their mesentery, or that do not."""
        if mesentery == self.options.mesentery:
            return self
        return replace(self, options=replace(self.options, mesentery=mesentery))

    def with_gas(self, gas: float | None, *, flow: float, start: float, water: float) -> "ColonSet":
        """The bank of colons that gas and water hold open, as scenes' options say [Pa, m^3/s, Pa, m^3], or do not."""
        options = replace(self.options, gas=gas, gas_flow=flow, gas_start=start, water=water)
        return self if options == self.options else replace(self, options=options)

    @cached_property
    def tables(self) -> Tables:
        """Lumen tables of all cases, one after the other."""
        return stack(
            [
                case.with_mesentery(self.options.abdomen) if self.options.mesentery else case.tables
                for case in self.cases
            ]
        )

    @cached_property
    def lengths(self) -> np.ndarray:
        """Lengths of the centrelines [m]."""
        return np.array([case.length for case in self.cases])

    @cached_property
    def valves(self) -> np.ndarray:
        """Arc length at which the caecum begins, behind the ileocaecal valve [m]; not a number where not known."""
        return np.array([case.borders[-2] if len(case.borders) else np.nan for case in self.cases])

    @cached_property
    def widths(self) -> tuple[LumenWidths, ...]:
        """How wide each colon's lumen is along its centreline."""
        return tuple(widths_along(case.line.arc, case.sight) for case in self.cases)

    @cached_property
    def node_widths(self) -> Float[np.ndarray, "colons nodes"]:
        """How wide each colon's lumen is at the nodes of its axis [m], where colons move."""
        own = self.tables.mesentery
        assert own is not None, "axes of colons that stand still"
        arcs = np.asarray(own.spacing)[:, None] * np.arange(own.nodes.shape[1])
        return np.stack([np.interp(each, *widths) for each, widths in zip(arcs, self.widths, strict=True)])

    @cached_property
    def scene(self) -> Scene:
        """The scope, as much of it as the longest colon takes."""
        longest = self.cases[int(self.lengths.argmax())]
        return build_scene(longest.colon(), None, self.design, self.options, show_lumen=False)


def make_bank(cases: Sequence[TabulatedColon], design: ScopeDesign, options: SceneOptions | None = None) -> ColonSet:
    """A bank of cases that are at hand.

    Raises:
        InvalidOptionError: when there is none, or one was made for a scope of another diameter.
    """
    if not cases:
        raise InvalidOptionError("A bank needs at least one colon.")
    if any(abs(case.device_radius - design.diameter / 2) > 1e-9 for case in cases):
        raise InvalidOptionError(f"A case was made for a scope of another diameter than '{design.name}': make it anew.")
    return ColonSet(tuple(cases), design, replace(options or TASK_OPTIONS, wall_law="table", softening=False))


def grown_bank(
    seeds: Sequence[int],
    design: ScopeDesign,
    *,
    difficulty: str = "any",
    options: SceneOptions | None = None,
    processes: int = 1,
    progress: Callable[[int], None] = lambda done: None,
) -> ColonSet:
    """Grown colons of these seeds; those that were not built before take about four seconds each.

    Args:
        seeds: of the colons.
        design: the scope.
        difficulty: band of tortuosity they are drawn from.
        options: how the scope is modelled.
        processes: that grow what is not in the cache.
        progress: told how many are there.
    """
    radius = design.diameter / 2
    missing = [int(seed) for seed in seeds if not _path([int(seed), difficulty], radius).exists()]
    if processes > 1 and len(missing) > 1:
        _grow_beside(missing, difficulty, radius, min(processes, len(missing)), progress)
    cases = []
    for done, seed in enumerate(seeds):
        progress(done)
        cases.append(_grown_case(int(seed), difficulty, radius))
    progress(len(seeds))
    return make_bank(cases, design, options)


def folder_bank(
    folders: Sequence[Path],
    design: ScopeDesign,
    *,
    options: SceneOptions | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> ColonSet:
    """Colons that were imported or grown into folders; a colon that was not tabulated before takes some seconds.

    Args:
        folders: each written by `haustra colon import` or `colon grow`.
        design: the scope.
        options: how the scope is modelled.
        progress: told how many are there.

    Raises:
        UnreadableFileError: when a folder holds no colon.
        InvalidOptionError: when a colon is too short for the scope, or two have the same name.
    """
    radius = design.diameter / 2
    colons = [load_colon(folder) for folder in folders]
    shortest = design.bending.length + design.tip.length
    named: dict[str, Path] = {}
    for folder, colon in zip(folders, colons, strict=True):
        if colon.centreline.length <= shortest:
            raise InvalidOptionError(
                f"The colon in '{folder}' is {colon.centreline.length:.3f} m long, no longer than the bending section "
                f"and tip of '{design.name}' ({shortest:.3f} m): leave it out."
            )
        if colon.name in named:
            raise InvalidOptionError(
                f"The colons in '{named[colon.name]}' and '{folder}' are both named '{colon.name}': leave one out."
            )
        named[colon.name] = folder
    cases = []
    for done, colon in enumerate(colons):
        progress(done)
        key = ["colon", colon_hash(colon), colon.name]
        case, pressure = _kept_case(_path(key, radius), lambda own=colon: own, radius), opened_at(colon)
        cases.append(replace(case, pressure=pressure))
    progress(len(colons))
    return make_bank(cases, design, options)


def _grow_beside(
    seeds: list[int], difficulty: str, radius: float, processes: int, progress: Callable[[int], None]
) -> None:
    """Grow into the cache, in new processes: what threads this one has does not matter to them."""
    with children(processes) as pool:
        waiting = [pool.submit(_grow, seed, difficulty, radius) for seed in seeds]
        for done, one in enumerate(as_completed(waiting)):
            one.result()
            progress(done)


def _grow(seed: int, difficulty: str, radius: float) -> None:
    """One colon into the cache."""
    _grown_case(seed, difficulty, radius)


def _path(key: Sequence[str | int], device_radius: float) -> Path:
    """Where a colon is kept, given what it is made from."""
    numbers = content_hash(asset("numbers/anatomy.toml").read_bytes())
    made_by = [_FORMAT, *key, device_radius, STATION_STEP, ANGLES, numbers, package_versions()]
    return cache_folder() / "cases" / f"{content_hash(json.dumps(made_by, sort_keys=True).encode())}.npz"


def _grown_case(seed: int, difficulty: str, device_radius: float) -> TabulatedColon:
    path = _path([seed, difficulty], device_radius)
    return _kept_case(path, lambda: grow_colon(seed=seed, difficulty=difficulty), device_radius)


def _kept_case(path: Path, make: Callable[[], Colon], device_radius: float) -> TabulatedColon:
    """The case kept there, made now if it is not."""
    if path.exists():
        try:
            return load_case(path)
        except HaustraError:
            path.unlink(missing_ok=True)  # a broken entry of a cache is made again
    case = case_of(make(), device_radius=device_radius)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_case(path, case)
    except (OSError, HaustraError):
        return case  # a cache that cannot be written is no reason to fail
    return case
