"""The front of run time against error in linear time: which cells, spheres and time steps buy most accuracy?

All colons are worlds of one batch. A script of hand and wires for each, recorded from the lumen follower, drives every
way of modelling and a converged one, all against the table of the lumen, so that errors are of cells, spheres and time
steps alone. Costs are those of one scope that is alone, from where its script ended.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.scope_colon_set import ScopeColonSet, build_bank
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError
from haustra.files import prepare_folder, write_json
from haustra.models.accuracy import LEAST_COLONS, QUANTITIES
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import PRESETS, find_preset
from haustra.models.scene import SceneOptions, build_scene
from haustra.provenance import content_hash
from haustra.scripts.bench.accuracy.drive import TIMED, Script, record_script
from haustra.scripts.bench.accuracy.errors import each_of, grow_into
from haustra.scripts.bench.accuracy.run import code_state
from haustra.scripts.bench.accuracy.timing import processor_seconds

_BOTH = ((0.0625, 0.034), (0.05, 0.017), (0.035, 0.0114), (0.025, 0.0085), (0.0167, 0.0085), (0.0125, 0.00425))
SETTINGS = (
    *PRESETS,
    *(f"shaft_cell={cell}" for cell in (0.1, 0.05, 0.0125)),
    *(f"bending_cell={cell}" for cell in (0.034, 0.017, 0.00425)),
    *(f"sample_spacing={spacing}" for spacing in (0.02, 0.0126, 0.0063, 0.0042)),
    *(f"twist_hinges={count}" for count in (2, 8, 16)),
    *(
        f"shaft_cell={shaft} bending_cell={bending} timestep={step}"
        for shaft, bending in _BOTH
        for step in (0.02, 0.01, 0.005, 0.0025, 0.00125, 0.000625)
    ),
)
"""Ways of modelling: presets, and numbers of the scene's options that differ from those of `balanced`."""
REFERENCE = "shaft_cell=0.00833 bending_cell=0.00425 sample_spacing=0.0084 timestep=0.00015625 twist_hinges=16"
"""What errors are against: a third of the cells of `balanced` and a 32nd of its time step, spheres as far apart."""
COARSER = "shaft_cell=0.0167 bending_cell=0.0085 sample_spacing=0.0084 timestep=0.0003125 twist_hinges=8"
"""Half as fine, to say how converged that is."""
_CHANGED: Mapping[str, Any] = {
    "timestep": float,
    "shaft_cell": float,
    "bending_cell": float,
    "sample_spacing": float,
    "twist_hinges": int,
}

Progress = Callable[[float, str, float], None]
"""Called with what is done, a note, and what there is to do."""


@dataclass(frozen=True)
class Batch:
    """One scope in all colons, fixed or on their mesentery."""

    folders: tuple[Path, ...]
    """Folders of the colons."""
    design: str
    mesentery: bool
    settings: tuple[str, ...] = SETTINGS
    seconds: float = 10.0
    """Length of the scripts [s]."""

    @property
    def name(self) -> str:
        """Words that tell it apart."""
        return f"{self.design} {'mesentery' if self.mesentery else 'fixed'}"


def modelled(setting: str, *, mesentery: bool = False) -> SceneOptions:
    """Options of a setting against the table: of a preset by its name, or as 'shaft_cell=0.03 bending_cell=0.01'.

    Raises:
        InvalidOptionError: when there is no such preset or option, or a number is not one.
    """
    named = "=" not in setting
    changes = {} if named else {name: value for name, _, value in (part.partition("=") for part in setting.split())}
    if unknown := set(changes) - set(_CHANGED):
        raise InvalidOptionError(f"No way of modelling changes '{min(unknown)}'. Known: {', '.join(sorted(_CHANGED))}.")
    base = find_preset(setting if named else "balanced").apply(law="table")
    try:
        return replace(base, mesentery=mesentery, **{name: _CHANGED[name](value) for name, value in changes.items()})
    except ValueError as error:
        raise InvalidOptionError(f"'{setting}' holds what is no number: {error}.") from error


def measure_front(
    folder: Path,
    *,
    colons: int = LEAST_COLONS,
    designs: Sequence[str] = ("adult", "paediatric"),
    mesentery: Sequence[bool] = (False, True),
    settings: Sequence[str] = SETTINGS,
    seconds: float = 10.0,
    processes: int = 1,
    progress: Progress = lambda done, note, total: None,
) -> list[dict[str, Any]]:
    """A row for each setting in fixed colons, and in colons on their mesentery: medians over colons and scopes.

    Args:
        folder: where colons and finished batches are kept.
        colons: how many, grown from seeds 0, 1, 2, ...
        designs: scopes.
        mesentery: whether colons move: both.
        settings: as `modelled` takes them.
        seconds: length of the scripts [s].
        processes: at a time.
        progress: told after each batch.
    """
    pool = partial(each_of, processes=processes)
    list(pool(partial(grow_into, prepare_folder(folder) / "colons"), range(colons)))
    places = tuple(folder / "colons" / f"grown-{seed}" for seed in range(colons))
    batches = [Batch(places, design, hung, tuple(settings), seconds) for hung in mesentery for design in designs]
    found: dict[Batch, dict[str, Any]] = {}
    for batch, errors in pool(partial(_kept, prepare_folder(folder / "front")), batches):
        found[batch] = errors
        progress(len(found), batch.name, len(batches))
    of = {hung: [found[each] for each in batches if each.mesentery == hung] for hung in mesentery}
    return [
        {"setting": setting, "mesentery": hung, **_medians([each[setting] for each in own])}
        for hung, own in of.items()
        for setting in (COARSER, *settings)
    ]


def _kept(folder: Path, batch: Batch) -> dict[str, Any]:
    """Errors of a batch, measured before by the same code, or now."""
    about = [code_state(), batch.settings, batch.seconds, len(batch.folders)]
    file = folder / f"{batch.name.replace(' ', '-')}-{content_hash(json.dumps(about).encode())}.json"
    if not file.is_file():
        write_json(file, measure_batch(batch))
    return json.loads(file.read_text(encoding="utf-8"))


def measure_batch(batch: Batch) -> dict[str, Any]:
    """Errors and costs of each setting, and of the coarser reference: lists over colons."""
    colons, design = [load_colon(folder) for folder in batch.folders], find_design(batch.design)
    base = modelled("balanced", mesentery=batch.mesentery)
    scripts = [record_script(colon, design, base, seconds=batch.seconds) for colon in colons]
    bank = build_bank(colons, design, base)
    deepest = max(script.deepest(base.start_depth) for script in scripts)
    reference = _Tracks(bank, design, modelled(REFERENCE, mesentery=batch.mesentery), scripts, deepest)
    found = {}
    for setting in (COARSER, *batch.settings):
        own = _Tracks(bank, design, modelled(setting, mesentery=batch.mesentery), scripts, deepest)
        found[setting] = {"dofs": own.dofs, "spheres": own.spheres, "cost": own.cost(), **own.errors(reference)}
    return found


class _Tracks:
    """What scripts do to one way of modelling, a world each."""

    def __init__(
        self, bank: ScopeColonSet, design: ScopeDesign, options: SceneOptions, scripts: Sequence[Script], deepest: float
    ) -> None:
        longest = max(bank.colons, key=lambda colon: colon.centreline.length)
        self._scene = build_scene(longest, None, design, options, show_lumen=False, deepest=deepest, to_save=False)
        self._tables, self._count = bank.tables, round(CONTROL_INTERVAL / options.timestep)
        self._last = np.stack([script.pulls[-1] for script in scripts])
        self._ended = self._begun(np.arange(len(scripts)))
        reads = []
        for instant in range(len(scripts[0])):
            push, roll, pulls = (
                np.stack([getattr(each, name)[instant] for each in scripts]) for name in Script.__dataclass_fields__
            )
            self._ended.step(Controls(push, roll, pulls), self._count)
            seen = self._ended.read()
            reads.append((seen.tip, np.abs(seen.push_force), seen.wall_force_sum))
        self._tip, self._push, self._wall = (np.stack(part) for part in zip(*reads, strict=True))
        state = self._ended.state()
        self.dofs, self.spheres = state.qpos.shape[1], state.normal.shape[1]

    def _begun(self, colons: np.ndarray) -> LinearBackend:
        """Worlds that stand at the anus of these colons."""
        worlds, options = len(colons), self._scene.options
        backend = LinearBackend(self._scene, self._tables, worlds=worlds, real=np.float64)
        one = np.ones(worlds)
        own = Conditions(options.friction * one, options.wall_stiffness * one, one)
        backend.reset(np.arange(worlds), colons, own)
        return backend

    def cost(self) -> list[float]:
        """Processor seconds that a simulated second takes a scope that is alone, from where each script ended."""
        found = []
        for colon, pulls in enumerate(self._last):
            alone = self._begun(np.array([colon]))
            alone.restore(0, self._ended.snapshot(colon))
            still = Controls(np.zeros(1), np.zeros(1), pulls[None])
            spent = processor_seconds(lambda alone=alone, still=still: alone.step(still, TIMED * self._count))
            found.append(spent / (TIMED * CONTROL_INTERVAL))
        return found

    def errors(self, reference: "_Tracks") -> dict[str, list[float | None]]:
        """How far each world is from the reference, as `drive.compare`; None of those that fell over."""
        gaps = np.median(np.linalg.norm(self._tip - reference._tip, axis=-1), axis=0) * 1e3
        relative = (np.abs(own.mean(axis=0) / known.mean(axis=0) - 1) for own, known in
                    ((self._wall, reference._wall), (self._push, reference._push)))  # fmt: skip
        alive = self._ended.alive & reference._ended.alive
        return {
            name: [float(value) if there else None for value, there in zip(values, alive, strict=True)]
            for name, values in zip(QUANTITIES, (*relative, gaps), strict=True)
        }


def _medians(batches: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Medians of errors and costs over all worlds of some batches, and the largest errors."""
    sound = {name: [x for each in batches for x in each[name] if x is not None] for name in QUANTITIES}
    tracks = sum(len(each["cost"]) for each in batches)
    found: dict[str, Any] = {"dofs": batches[0]["dofs"], "spheres": batches[0]["spheres"], "tracks": tracks}
    found |= {"fallen": tracks - len(sound["push"])}
    found |= {"cost": float(np.median([cost for each in batches for cost in each["cost"]]))}
    found |= {name: float(np.median(values)) for name, values in sound.items() if values}
    return found | {f"{name}_most": max(values) for name, values in sound.items() if values}


def best(rows: Sequence[Mapping[str, Any]], quantity: str) -> list[Mapping[str, Any]]:
    """Rows that no other beats in both cost and one error, cheapest first."""
    front: list[Mapping[str, Any]] = []
    for row in sorted((row for row in rows if not row["fallen"]), key=lambda each: each["cost"]):
        if not front or row[quantity] < front[-1][quantity]:
            front.append(row)
    return front
