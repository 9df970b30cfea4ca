"""From a finished run to the numbers that designs are compared by."""

import resource
import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from haustra.envs.runs.insertion import Insertion, Trajectory
from haustra.envs.runs.measure.injury import Burden, injury_scores
from haustra.envs.runs.measure.looping import looping
from haustra.envs.runs.measure.progress import segment_at
from haustra.envs.runs.measure.progression import progression_scores
from haustra.envs.runs.measure.surface import LeftBehind, left_behind
from haustra.models.accuracy import NumericalError, kind_of, stated_error
from haustra.models.anatomy.store import colon_hash
from haustra.models.gas.law import MMHG
from haustra.models.presets import preset_of
from haustra.models.scene import Scene
from haustra.provenance import Provenance, backend_record


def score(
    scene: Scene,
    run: Insertion,
    provenance: Provenance | None = None,
    *,
    wall: str | None = None,
    error: NumericalError | None = None,
    left: LeftBehind | None = None,
) -> dict[str, Any]:
    """Scores of a run as plain JSON values, units in the names.

    Forces are sampled at the control rate (50 Hz). `wall_force_peak_N` is the largest resultant normal force of the
    wall on one link of the scope. `insertion_m` and `tip_arc_m` are where the run ended; `tip_arc_max_m` is how far it
    came. The tip's arc length is that of the nearest point of the centreline. `steering_gap_mean_deg` is how far the
    tip's bend is from that steered for: lag and contact, and on a used scope slack, stretch and friction of its wires.
    `loop_excess_m` is the scope inside less the colon passed, `loop_writhe_peak_turns` how much the scope coiled:
    neither needs axes. `loop_N_s` and so on say how long a loop of that name was there, seen along y, which is assumed
    to run from front to back. `pull_back_shortening_m` is the most scope that was pulled back while the tip stayed.
    `outside_surface_max_mm` is how far the scope's axis stood outside the colon's surface, moved and indented by it, at
    the worst of all `outside_surface_records`, and `turned_over_max_share` which share of its triangles had turned over
    at the worst of `surface_records`; `surface_judged_s` is what that took.
    `colon_moved_peak_mm` is how far a colon on its mesentery was moved at most.
    `wall_force_sum_mean_N` is the mean of all normal forces together, which does not depend on how long links are.
    `p_perforation`, `bleeding_*` and `pain_*` are those of `haustra.envs.runs.measure.injury.injury_scores`.
    `cops_own` and `cops3d_*` are this project's own stand-ins for two published scores
    (`haustra.envs.runs.measure.progression`).
    `numerical_error` holds ranges of relative errors of that mean and of the mean push, and of the tip's distance.
    `gas_pressure_peak_mmHg` is the highest of any segment over the run, `gas_volume_mL` what the colon holds at its
    end; null without gas. `water_volume_mL` is the water in it at the end; null in a run without water.
    `outside_max_mm` is against the colon at rest, as it was given, with gas too.
    `warnings` are the colon's.

    Args:
        scene: colon, wall and scope.
        run: what happened.
        provenance: where the numbers come from; what scene and run say of it when None.
        wall: how the pieces of the wall were made, if there are any.
        error: measured on this run; what was measured on others for this wall law, preset and kind of colon when None.
        left: the colon as the scope has left it, where it is known already.
    """
    error = error or stated_error(scene.options, kind_of(scene.colon), wall=wall)
    left = left or left_behind(scene, run)
    surface = left.figures
    recorded = run.trajectory
    simulated = float(recorded.time[-1]) if len(recorded.time) else 0.0
    arc = float(recorded.tip_arc[-1]) if simulated else scene.options.start_depth
    furthest = float(recorded.tip_arc.max()) if simulated else arc
    return {
        "outcome": run.outcome.value,
        "advice": run.outcome.advice,
        "warnings": list(scene.colon.warnings),
        "simulated_s": simulated,
        "wall_clock_s": run.wall_clock,
        "real_time_factor": simulated / run.wall_clock if run.wall_clock > 0 else 0.0,
        "insertion_m": float(recorded.insertion[-1]) if simulated else scene.options.start_depth,
        "tip_arc_m": arc,
        "tip_segment": segment_at(scene.colon, arc),
        "tip_arc_max_m": furthest,
        "tip_segment_max": segment_at(scene.colon, furthest),
        "colon_length_m": scene.colon.centreline.length,
        "push_force_peak_N": _peak(recorded.push_force),
        "push_force_mean_N": float(np.abs(recorded.push_force).mean()) if simulated else 0.0,
        "torque_peak_Nm": _peak(recorded.torque),
        "wall_force_peak_N": _peak(recorded.wall_force),
        "wall_force_mean_N": float(recorded.wall_force.mean()) if simulated else 0.0,
        "wall_force_sum_mean_N": float(recorded.wall_force_sum.mean()) if simulated else 0.0,
        "scope_energy_peak_J": _peak(recorded.scope_energy),
        "scope_energy_mean_J": float(recorded.scope_energy.mean()) if simulated else 0.0,
        "wall_energy_peak_J": _peak(recorded.wall_energy),
        "wall_energy_mean_J": float(recorded.wall_energy.mean()) if simulated else 0.0,
        **_looping(scene, run),
        **_injury(scene, run),
        **progression_scores(
            recorded.time,
            recorded.tip,
            recorded.coils,
            recorded.insertion,
            progress=recorded.tip_arc / scene.colon.centreline.length,
        ),
        "steering_gap_mean_deg": _steering_gap(recorded),
        "outside_max_mm": float(recorded.outside.max()) * 1e3 if simulated else 0.0,
        "outside_surface_max_mm": surface.outside * 1e3,
        "outside_surface_records": surface.looked,
        "turned_over_max_share": surface.turned_over,
        "surface_records": surface.records,
        "surface_judged_s": left.seconds,
        "colon_moved_peak_mm": _peak(recorded.colon_moved) * 1e3,
        **_gas(run),
        "contacts_mean": float(recorded.contacts.mean()) if simulated else 0.0,
        "dofs": recorded.qpos.shape[1],
        "joints": len(scene.cable.cells),
        "pieces": scene.pieces,
        "timestep_s": scene.options.timestep,
        "preset": preset_of(scene.options),
        "backend": run.backend,
        "wall_law": scene.options.wall_law,
        "mesentery": scene.options.mesentery,
        "numerical_error": error.to_json(),
        "peak_memory_MB": peak_memory() / 1e6,
        "provenance": (provenance or provenance_of(scene, run, wall=wall)).to_json(),
    }


def provenance_of(scene: Scene, run: Insertion, *, wall: str | None = None, seconds: float | None = None) -> Provenance:
    """What a run was made of.

    Args:
        scene: colon, wall and scope.
        run: what happened.
        wall: how the pieces of the wall were made, if there are any.
        seconds: longest run that was asked for, in simulated time [s]; as long as it was when None.
    """
    lasted = float(run.trajectory.time[-1]) if len(run.trajectory.time) else 0.0
    return Provenance(
        inputs={"colon": colon_hash(scene.colon), "colon_name": scene.colon.name},
        configuration={
            **scene.configuration(),
            "preset": preset_of(scene.options),
            "wall": wall,
            "driver": asdict(run.settings),
            "seconds": lasted if seconds is None else seconds,
            "shaft_added_s": list(run.shaft_added),
        },
        backend=backend_record(run.backend),
    )


def _gas(run: Insertion) -> dict[str, object]:
    """Scores of the gas in the whole colon; null in a run without gas."""
    if run.gas is None or not len(run.gas.volume):
        return {"gas_pressure_peak_mmHg": None, "gas_volume_mL": None, "water_volume_mL": None}
    return {
        "gas_pressure_peak_mmHg": float(run.gas.pressure.max()) / MMHG,
        "gas_volume_mL": float(run.gas.volume[-1]) * 1e6,
        "water_volume_mL": float(run.gas.water[-1]) * 1e6 if run.gas.water.any() else None,
    }


def _looping(scene: Scene, run: Insertion) -> dict[str, object]:
    found = looping(scene, run)
    return {
        "loop_excess_m": found.excess,
        "loop_excess_peak_m": found.excess_peak,
        "loop_writhe_peak_turns": found.writhe_peak,
        **{f"loop_{name.replace(' ', '_')}_s": lasting for name, lasting in found.seconds.items()},
        "loops_at_end": ", ".join(f"{loop.kind.value} of {loop.size * 1e3:.0f} mm" for loop in found.at_end) or "none",
        "pull_back_shortening_m": found.shortening,
    }


def _injury(scene: Scene, run: Insertion) -> dict[str, object]:
    seen = run.trajectory
    return injury_scores(
        Burden(*(getattr(seen, name) for name in Burden._fields)),
        run.outcome,
        scene.colon,
        interval=float(seen.time[0]) if len(seen.time) else 0.0,
    )


def _steering_gap(recorded: Trajectory) -> float:
    if not len(recorded.time):
        return 0.0
    gap = np.hypot(recorded.asked_up - recorded.bend_up, recorded.asked_left - recorded.bend_left)
    return float(np.degrees(gap.mean()))


def peak_memory() -> float:
    """Largest resident memory of this process so far [bytes]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def _peak(values: np.ndarray) -> float:
    return float(np.abs(values).max()) if len(values) else 0.0
