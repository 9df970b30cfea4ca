"""How far every wall law and preset is off in grown colons and others, fixed and on their mesentery, as ranges.

One script of hand and wires a colon, recorded from the lumen follower, drives every model and a converged one: six
times the joints of the shaft, four times those of the bending section, and shorter time steps. Fixed colons are
judged by tangent planes, which have the lumen's exact surface and the wall's exact stiffness; colons that move by the
table of the lumen. Every track is kept as it is finished, so that a measurement that was stopped goes on.
"""

import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from haustra.errors import HaustraError
from haustra.files import prepare_folder, write_atomically
from haustra.models.accuracy import LEAST_COLONS, QUANTITIES, Measured, NumericalError, kind_of
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import METADATA, load_colon, save_colon
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import PRESETS, find_preset
from haustra.models.scene import SceneOptions
from haustra.models.wall.pieces.build import Method
from haustra.models.wall.pieces.folder import wall_folder, wall_of
from haustra.models.wall.pieces.store import load_wall
from haustra.provenance import content_hash
from haustra.scripts.bench.accuracy.drive import Errors, Script, Track, compare, record_script, replay, set_tolerance
from haustra.scripts.bench.accuracy.insertion import SAMPLES, refined
from haustra.scripts.bench.accuracy.knobs import unchanged
from haustra.scripts.bench.accuracy.run import code_state, silent_engine

_REFERENCE, _COARSER = (6, 4), (3, 2)
"""Times as many joints of shaft and bending section of the reference and of the model that says how converged it is:
both have as many spheres on a length of shaft, a sphere having one stiffness."""
_PARTS = {False: (4, 2), True: (32, 16)}
"""Parts of the default time step of both, by whether the colon moves: there time steps matter more than joints."""
_SCRIPT, _CONVERGED, _NEARLY = "script", "reference", "coarser reference"

Item = TypeVar("Item")
Found = TypeVar("Found")
Progress = Callable[[float, str, float], None]
"""Called with what is done, a note, and what there is to do."""


@dataclass(frozen=True)
class Asked:
    """What is measured, and where."""

    grown: int = LEAST_COLONS
    """Colons grown from seeds 0, 1, 2, ..."""
    folders: tuple[Path, ...] = ()
    """Further colons."""
    designs: tuple[str, ...] = ("adult", "paediatric")
    laws: tuple[str, ...] = ("pieces", "planes", "table")
    walls: tuple[Method, ...] = ("prism",)
    """How pieces are made."""
    presets: tuple[str, ...] = ("fast", "balanced", "accurate")
    mesentery: tuple[bool, ...] = (False, True)
    seconds: float = 10.0
    """Length of the script [s]."""


@dataclass(frozen=True)
class Model:
    """One track: a way of modelling one scope in one colon."""

    place: Path
    """The colon's folder."""
    design: str
    mesentery: bool
    wall_law: str
    wall: str
    preset: str
    """Name of a preset, or what the track is for: script or reference."""

    @property
    def options(self) -> SceneOptions:
        """Options of the scene.

        Raises:
            InvalidOptionError: when they do not go together.
        """
        finest, nearly = _PARTS[self.mesentery]
        levels = {_SCRIPT: ((1, 1), 1), _CONVERGED: (_REFERENCE, finest), _NEARLY: (_COARSER, nearly)}
        if self.preset not in levels:
            return replace(find_preset(self.preset).apply(law=self.wall_law), mesentery=self.mesentery)
        joints, parts = levels[self.preset]
        fine = refined(*joints, SceneOptions.timestep / parts)
        return replace(fine, wall_law=self.wall_law, mesentery=self.mesentery, sample_spacing=SAMPLES)  # pyright: ignore[reportArgumentType]

    @property
    def name(self) -> str:
        """Words that tell it apart within its colon."""
        hung = "mesentery" if self.mesentery else "fixed"
        return " ".join(part for part in (self.design, hung, self.wall_law, self.wall, self.preset) if part)


def measure_errors(
    asked: Asked,
    folder: Path,
    *,
    processes: int = 1,
    minutes: float = math.inf,
    progress: Progress = lambda done, note, total: None,
) -> list[dict[str, Any]]:
    """Rows of errors, one for each colon, scope and model; a model that is refused or falls over says so.

    Args:
        asked: what is measured.
        folder: where colons and finished tracks are kept.
        processes: at a time.
        minutes: after which no more is begun; what is missing counts as refused, and the next call goes on from there.
        progress: told after each track.
    """
    until = time.monotonic() + 60 * minutes
    pool = partial(each_of, processes=processes, until=until)
    places = [prepare_folder(folder) / "colons" / f"grown-{seed}" for seed in range(asked.grown)]
    for seed, _ in pool(partial(grow_into, folder / "colons"), range(asked.grown)):
        progress(0, f"grown colon {seed}", 1)
    places = [each for each in (*places, *asked.folders) if (each / METADATA).is_file()]
    methods = asked.walls if "pieces" in asked.laws else ()
    walls: list[tuple[Path, Method]] = [(place, method) for method in methods for place in places]
    for (place, method), _ in pool(_walled, walls):
        progress(0, f"{place.name}: {method} wall", 1)
    kept = prepare_folder(folder / "tracks" / _state(asked))
    scripts = [
        Model(place, design, hung, _judge(hung), "", _SCRIPT)
        for place in places
        for design in asked.designs
        for hung in asked.mesentery
    ]
    models = [replace(each, preset=preset) for preset in (_CONVERGED, _NEARLY) for each in scripts]
    models += [model for each in scripts for model in _ways(asked, each)]
    total, refused, done = len(scripts) + len(models), {}, 0
    for stage in (scripts, models):  # all scripts first: tracks follow them
        for model, reason in pool(partial(_track, seconds=asked.seconds, kept=kept), stage):
            done += 1
            progress(done, f"{model.place.name}: {model.name}", total)
            if reason:
                refused[model] = reason
    return [row for each in scripts for row in _rows(asked, each, kept, refused)]


def grow_into(folder: Path, seed: int) -> None:
    """Grow a colon into its folder of that one, unless it is there."""
    place = folder / f"grown-{seed}"
    if not (place / METADATA).is_file():
        save_colon(grow_colon(seed=seed), place)


def _walled(asked: tuple[Path, Method]) -> None:
    place, method = asked
    wall_of(place, load_colon(place), method)


def _judge(mesentery: bool) -> str:
    """What converged scopes, and the one that records the script, meet."""
    return "table" if mesentery else "planes"


def _ways(asked: Asked, script: Model) -> Iterator[Model]:
    for law in asked.laws:
        for wall in asked.walls if law == "pieces" else ("",):
            for preset in asked.presets:
                yield replace(script, wall_law=law, wall=wall, preset=preset)


def _state(asked: Asked) -> str:
    """A hash of what shapes a track beside its model: the code and the script's length."""
    return content_hash(json.dumps([code_state(), asked.seconds]).encode())


def each_of(
    work: Callable[[Item], Found], items: Sequence[Item], *, processes: int, until: float = math.inf
) -> Iterator[tuple[Item, Found]]:
    """Every item with what is made of it, in whatever order they are finished; none is begun after `until`."""
    if processes == 1:
        yield from ((item, work(item)) for item in items if time.monotonic() < until)
        return
    # New processes: what threads this one has does not matter to them. JAX is not to share a GPU among all.
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        waiting: dict[Future[Found], Item] = {pool.submit(work, each): each for each in items}
        left = None if until == math.inf else max(0.0, until - time.monotonic())
        with suppress(TimeoutError):
            for each in as_completed(list(waiting), left):
                yield waiting.pop(each), each.result()
        for each in [each for each in waiting if not each.cancel()]:
            yield waiting[each], each.result()


def _file(model: Model, kept: Path) -> Path:
    return kept / model.place.name / f"{model.name.replace(' ', '-')}.npz"


def _track(model: Model, seconds: float, kept: Path) -> str:
    """Compute one track unless it is there; why not, when it is refused."""
    file = _file(model, kept)
    script = _file(replace(model, wall_law=_judge(model.mesentery), wall="", preset=_SCRIPT), kept)
    if file.is_file():
        return ""
    if model.preset != _SCRIPT and not script.is_file():
        return "there is no script"
    try:
        with silent_engine():
            arrays = _computed(model, seconds, script)
    except HaustraError as error:
        return str(error)
    prepare_folder(file.parent)
    write_atomically(file, lambda path: np.savez(path, **arrays))
    return ""


def _computed(model: Model, seconds: float, script: Path) -> Mapping[str, Any]:
    colon, design, options = load_colon(model.place), find_design(model.design), model.options
    if model.preset == _SCRIPT:
        return asdict(record_script(colon, design, options, seconds=seconds))
    wall = load_wall(wall_folder(model.place, model.wall)) if model.wall else None  # pyright: ignore[reportArgumentType]
    tweak = set_tolerance(1e-8) if model.preset in (_CONVERGED, _NEARLY) else unchanged
    return asdict(replay(_read(script, Script), colon, wall, design, options, tweak=tweak))


def _read(file: Path, kind: Any) -> Any:
    with np.load(file, allow_pickle=False) as arrays:
        return kind(**{name: arrays[name] if arrays[name].ndim else float(arrays[name]) for name in arrays.files})


def _rows(asked: Asked, script: Model, kept: Path, refused: Mapping[Model, str]) -> Iterator[dict[str, Any]]:
    """One row a model; all are refused where there is no whole reference."""
    where = {"colon": script.place.name, "kind": kind_of(load_colon(script.place)), "design": script.design}
    reference, coarser = (replace(script, preset=preset) for preset in (_CONVERGED, _NEARLY))
    known = _file(reference, kept)
    whole = _read(known, Track) if known.is_file() else None
    steps = round(asked.seconds / 0.02)
    for model in (coarser, *_ways(asked, script)):
        row = {**where, **{name: getattr(model, name) for name in ("mesentery", "wall_law", "wall", "preset")}}
        file = _file(model, kept)
        if whole is None or len(whole) < steps:
            yield {**row, "refused": f"no reference: {refused.get(reference, 'it fell over')}"}
        elif not file.is_file():
            yield {**row, "refused": refused.get(model, "not computed")}
        else:
            track = _read(file, Track)
            yield {**row, "cost": track.cost, **_named(compare(track, whole))}


def _named(errors: Errors) -> dict[str, float | None]:
    found = {"wall_force": errors.wall, "push": errors.push, "tip_mm": errors.tip * 1e3}
    return {name: value if np.isfinite(value) else None for name, value in found.items()}


@dataclass(frozen=True)
class Ranges:
    """Errors of one way of modelling over all scopes, in grown colons or in grown and real ones (`ranges_of`)."""

    wall_law: str
    wall: str
    mesentery: bool
    preset: str
    colon: str
    colons: int
    """Number of colons that gave numbers for every scope."""
    fallen: int
    """Tracks that ended before the script did."""
    wall_force: tuple[float, float]
    push: tuple[float, float]
    tip_mm: tuple[float, float]


def ranges_of(rows: Sequence[Mapping[str, Any]]) -> list[Ranges]:
    """From lowest to highest error of each way of modelling; what was refused everywhere is left out.

    Few real colons are public, so the range of real colons spans the grown ones too.
    """
    groups: dict[tuple, list[Mapping[str, Any]]] = {}
    for row in rows:
        if "refused" not in row:
            key = (row["wall_law"], row["wall"], row["mesentery"], row["preset"], row["kind"])
            groups.setdefault(key, []).append(row)
    for *way, kind in list(groups):
        if kind == "real":
            groups[*way, kind] += groups.get((*way, "grown"), [])
    found = []
    for key, group in groups.items():
        fallen = {row["colon"] for row in group if row["push"] is None}
        sound = [row for row in group if row["push"] is not None]
        if sound:
            ends = {q: (min(row[q] for row in sound), max(row[q] for row in sound)) for q in QUANTITIES}
            colons = len({row["colon"] for row in group} - fallen)
            found.append(Ranges(*key, colons=colons, fallen=len(group) - len(sound), **ends))
    return found


def accuracy_toml(
    ranges: Sequence[Ranges], asked: Asked, where: Mapping[str, Any], *, before: Sequence[Measured] = ()
) -> str:
    """Text of assets/accuracy.toml: what spans enough colons and did not fall over in any.

    Args:
        ranges: what was measured.
        asked: how.
        where: date and machine.
        before: entries of earlier measurements, which stay where nothing is measured now.
    """
    nearly = {(each.mesentery, each.colon): each for each in ranges if each.preset == _NEARLY}
    entries = {_way_of(each): _entry(each, each.error.measured_on, each.error) for each in before}
    for each in ranges:
        if each.preset in PRESETS:
            sound = not each.fallen and each.colons >= LEAST_COLONS
            source = _source(each, nearly.get((each.mesentery, each.colon)), asked, where)
            entries[_way_of(each)] = _entry(each, source, each) if sound else ""
    return _ABOUT + "".join(entries.values())


_ABOUT = """\
# How far answers are off by numerics alone, as ranges over colons: relative errors of the mean sum of wall
# forces and of the mean push, and the median distance of the tip in mm. Written by `haustra bench errors`.
"""


def _way_of(each: Ranges | Measured) -> tuple[Any, ...]:
    return each.wall_law, each.wall, each.mesentery, each.preset, each.colon


def _entry(each: Ranges | Measured, source: str, ends: Ranges | NumericalError) -> str:
    lines = ["", "[[measured]]", *(f"{name} = {_toml(getattr(each, name))}" for name in _NAMES)]
    lines += [f"{name} = [{', '.join(f'{end:.2g}' for end in getattr(ends, name))}]" for name in QUANTITIES]
    return "\n".join([*lines, f'source = "{source}"']) + "\n"


_SPANNED = {"grown": "grown", "real": "real and grown"}
_NAMES = ("wall_law", "wall", "mesentery", "preset", "colon", "colons")


def _toml(value: str | int | bool) -> str:
    return json.dumps(value)


def _source(each: Ranges, floor: Ranges | None, asked: Asked, where: Mapping[str, Any]) -> str:
    judge = "the table of the lumen" if each.mesentery else "tangent planes"
    finest, nearly = _PARTS[each.mesentery]
    text = (
        f"measured by `haustra bench errors` on {where['date']}: {each.colons} {_SPANNED[each.colon]} colons, scopes "
        f"{' and '.join(asked.designs)}, {asked.seconds:g} s of one script, against {judge} with {_REFERENCE[0]} times "
        f"the joints and a time step of 5/{finest} ms"
    )
    if floor:
        text += (
            f", from which {_COARSER[0]} times the joints and 5/{nearly} ms are at most "
            f"{100 * floor.wall_force[1]:.1f} % of wall force, {100 * floor.push[1]:.1f} % of push and "
            f"{floor.tip_mm[1]:.2g} mm away"
        )
    return text


def refusals(rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """What was not measured, and why, once a reason."""
    found = {}
    for row in rows:
        if "refused" in row:
            hung = "mesentery" if row["mesentery"] else "fixed"
            found.setdefault(
                f"{row['wall_law']} {row['wall']} {hung} {row['preset']}".replace("  ", " "), row["refused"]
            )
    return found
