"""Question: how far is a whole insertion off, by every way of modelling it, under one script of hand and wires?

The reference has four times the joints in the bending section and six times in the shaft, half the time step (a quarter
moved tips by 0.03 mm), a solver tolerance of 1e-8, and tangent planes, which have the lumen's exact surface and the
wall's exact stiffness.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import PRESETS
from haustra.models.scene import SceneOptions
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.accuracy.drive import Errors, Track, compare, record_script, replay, set_tolerance
from haustra.scripts.bench.accuracy.knobs import (
    Tweak,
    condims,
    cones,
    impedance_ratios,
    integrators,
    solvers,
    unchanged,
    without_step_damping,
)
from haustra.scripts.bench.accuracy.places import Place, grown
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, timed_front
from haustra.scripts.bench.result import ParetoFront, Table, Value

SAMPLES = 0.0084
"""Largest distance between spheres that meet planes [m]: it divides the cells of every chain tried here, so that all
have as many spheres on a length, a sphere having one stiffness."""
Walls = dict[str, Wall]


@dataclass(frozen=True)
class Model:
    """One way of modelling the insertion."""

    setting: str
    group: str
    options: SceneOptions
    wall: str = ""
    """Key of its wall of pieces; none for the other laws."""
    tweak: Tweak = unchanged


def refined(shaft: int, bending: int, timestep: float) -> SceneOptions:
    """Tangent planes with that many times the joints."""
    base = SceneOptions()
    return replace(
        base,
        wall_law="planes",
        mesentery=False,
        sample_spacing=SAMPLES,
        shaft_cell=base.shaft_cell / shaft,
        bending_cell=base.bending_cell / bending,
        twist_hinges=base.twist_hinges * bending,
        timestep=timestep,
    )


def presets(main: str) -> Iterator[Model]:
    """The presets; `main` is the wall of those that have one."""
    for preset in PRESETS.values():
        chosen = preset.apply()
        yield Model(f"preset={preset.name}", "preset", chosen, main if chosen.wall_law == "pieces" else "")


def models(main: str, *, quick: bool) -> Iterator[Model]:
    """Every setting, one knob at a time around the default; `main` is the wall of the default."""
    base = SceneOptions()
    planes = replace(base, wall_law="planes", sample_spacing=SAMPLES)
    yield from presets(main)
    for shaft, bending in ((0.1, 0.034), (0.025, 0.0085)):
        options = replace(base, shaft_cell=shaft, bending_cell=bending)
        yield Model(f"shaft_cell={shaft}, bending_cell={bending}", "joints", options, main)
    for angle in (20.0, 40.0):
        yield Model(f"largest_bend_deg={angle:g}", "joints, adaptive", replace(base, largest_bend_deg=angle), main)
    for step in (0.0025, 0.01, 0.02):
        yield Model(f"timestep={step}", "timestep", replace(base, timestep=step), main)
    yield Model("wall=planes", "wall", planes)
    yield Model("wall=table", "backend", replace(base, wall_law="table", softening=False, sample_spacing=SAMPLES))
    if quick:
        return
    yield from _combined(main)
    for count in (0, 2, 16):
        yield Model(f"twist_hinges={count}", "twist", replace(base, twist_hinges=count), main)
    loss = find_design("adult").relaxation_time
    for knob in (
        *integrators(),
        without_step_damping(loss),
        *solvers(),
        *cones(),
        *condims(1, 4),
        *impedance_ratios(1, 100),
    ):
        yield Model(knob.setting, knob.group, base, main, knob.turn)
    for other in ("prism, 0.8 mm", "prism, 1.5 mm"):
        yield Model(f"wall={other}", "wall", base, other)
    yield Model("wall=table, as in batches of worlds", "backend", BATCH_OPTIONS)


def _combined(main: str) -> Iterator[Model]:
    """Two knobs together where each alone paid: more joints at a larger step."""
    for shaft, bending in ((2, 2), (3, 4)):
        for step in (0.005, 0.01):
            fine = refined(shaft, bending, step)
            what = f"shaft_cell={fine.shaft_cell:.3g}, bending_cell={fine.bending_cell:.3g}, timestep={step}"
            pieces = replace(fine, wall_law="pieces", twist_hinges=SceneOptions.twist_hinges, sample_spacing=None)
            yield Model(f"{what}, pieces", "combined", pieces, main)
            yield Model(f"{what}, planes", "combined", fine)


def answer(effort: Effort) -> Answer:
    """Sweep everything in the grown colon, and the presets in other colons."""
    found = _answer_in("grown, seed 0", grown(effort), effort, every=True)
    fronts, tables, notes = list(found.fronts), list(found.tables), list(found.notes)
    for folder in effort.colons:
        more = _answer_in(folder.name, Place(folder), effort, every=False)
        fronts += more.fronts
        tables += more.tables
    if not effort.colons:
        notes.append("Insertion: no further colon was named (--colons).")
    return Answer(fronts, tables, notes=notes)


def _answer_in(name: str, place: Place, effort: Effort, *, every: bool) -> Answer:
    seconds = 8.0 if effort.quick else 10.0
    colon, design = place.colon, find_design("adult")
    effort.tell(f"{name}: wall")
    main = "prism, 0.8 mm" if effort.quick else "coacd, 1.5 mm"
    walls: Walls = {main: place.wall("prism" if effort.quick else "coacd")}
    if every and not effort.quick:
        walls["prism, 0.8 mm"], walls["prism, 1.5 mm"] = place.wall("prism"), place.coarse_wall()
    effort.tell(f"{name}: script")
    script = record_script(colon, design, refined(1, 1, SceneOptions.timestep), seconds=seconds)
    effort.tell(f"{name}: reference")
    levels = ((2, 2, 1), (3, 4, 1)) if effort.quick else ((3, 4, 2), (6, 4, 2))
    coarser, reference = (
        replay(
            script,
            colon,
            None,
            design,
            refined(shaft, bending, SceneOptions.timestep / parts),
            tweak=set_tolerance(1e-8),
        )
        for shaft, bending, parts in levels
    )
    floor = compare(coarser, reference)

    def run(model: Model) -> Track:
        return replay(script, colon, walls.get(model.wall), design, model.options, tweak=model.tweak)

    tracks = {}
    for model in models(main, quick=effort.quick) if every else presets(main):
        effort.tell(f"{name}: {model.setting}")
        tracks[model] = run(model)
    fronts = _fronts(name, tracks, reference, floor, run, repeats=1)
    note = (
        f"Insertion into {name}: {seconds:g} s of the lumen follower's inputs, {reference.insertion[-1]:.3f} m in. "
        f"The reference has {levels[1][0]} and {levels[1][1]} times the joints of shaft and bending section; with "
        f"{levels[0][0]} and {levels[0][1]} its median tip distance is {floor.tip * 1e3:.2f} mm, mean push "
        f"{floor.push:.1%} and mean wall force {floor.wall:.1%} off. Mean push {reference.push.mean():.2f} N, mean "
        f"sum of wall forces {reference.wall.mean():.1f} N. The default's wall is {main}."
    )
    return Answer(fronts, [_table(name, tracks, reference)], notes=[note])


def _fronts(
    name: str,
    tracks: dict[Model, Track],
    reference: Track,
    floor: Errors,
    run: Callable[[Model], Track],
    *,
    repeats: int,
) -> list[ParetoFront]:
    """One front each for tip path, push and wall force, from one timing."""
    candidates = []
    for model, track in tracks.items():
        error = compare(track, reference).tip * 1e3
        fine = bool(np.isfinite(error))
        block = (lambda model=model: run(model).cost) if fine else None
        candidates.append(Candidate(model.setting, error, model.group, block, "completed" if fine else "diverged"))
    tips = timed_front(
        f"insertion, {name}: tip path",
        candidates,
        reference=f"many joints in tangent planes; with half of them it differs by {floor.tip * 1e3:.2f} mm",
        error_unit="median tip distance [mm]",
        repeats=repeats,
        warm_up=False,  # every model has already run once, for its error
    )
    fronts = [tips]
    for what, entry in (("push force", "push"), ("wall force", "wall")):
        errors = [getattr(compare(track, reference), entry) for track in tracks.values()]
        points = tuple(replace(point, error=error) for point, error in zip(tips.points, errors, strict=True))
        fronts.append(
            ParetoFront(
                f"insertion, {name}: {what}",
                f"the same; the coarser one differs by {getattr(floor, entry):.2g}",
                f"relative error of the mean {what}",
                tips.cost_unit,
                points,
            )
        )
    return fronts


def _table(name: str, tracks: dict[Model, Track], reference: Track) -> Table:
    rows: list[dict[str, Value]] = []
    for model, track in tracks.items():
        errors = compare(track, reference)
        rows.append(
            {
                "setting": model.setting,
                "tip_error_mm": errors.tip * 1e3,
                "push_error": errors.push,
                "wall_force_error": errors.wall,
                "tip_distance_at_end_mm": float(np.linalg.norm(track.tip[-1] - reference.tip[-1])) * 1e3
                if len(track) == len(reference)
                else None,
                "contacts": track.contacts,
                "cost_one_run": track.cost,
            }
        )
    return Table(f"Insertion, {name}", tuple(rows), "Errors against the reference under the same script.")
