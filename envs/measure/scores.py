"""From a finished run to the numbers that designs are compared by."""

import resource
import sys

import numpy as np

from haustra.envs.insertion import Insertion
from haustra.envs.measure.progress import segment_at
from haustra.models.scene import Scene
from haustra.provenance import Provenance


def score(scene: Scene, run: Insertion, provenance: Provenance) -> dict[str, object]:
    """Scores of a run as plain JSON values, units in the names.

    Forces are sampled at the control rate (50 Hz). `wall_force_peak_N` is the largest resultant normal force of the
    wall on one link of the scope. `insertion_m` and `tip_arc_m` are where the run ended; `tip_arc_max_m` is how far it
    came. The tip's arc length is that of the nearest point of the centreline.
    """
    recorded = run.trajectory
    simulated = float(recorded.time[-1]) if len(recorded.time) else 0.0
    arc = float(recorded.tip_arc[-1]) if simulated else scene.options.start_depth
    furthest = float(recorded.tip_arc.max()) if simulated else arc
    return {
        "outcome": run.outcome.value,
        "advice": run.outcome.advice,
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
        "torque_peak_Nm": _peak(recorded.torque),
        "wall_force_peak_N": _peak(recorded.wall_force),
        "wall_force_mean_N": float(recorded.wall_force.mean()) if simulated else 0.0,
        "scope_energy_peak_J": _peak(recorded.scope_energy),
        "scope_energy_mean_J": float(recorded.scope_energy.mean()) if simulated else 0.0,
        "wall_energy_peak_J": _peak(recorded.wall_energy),
        "wall_energy_mean_J": float(recorded.wall_energy.mean()) if simulated else 0.0,
        "outside_max_mm": float(recorded.outside.max()) * 1e3 if simulated else 0.0,
        "contacts_mean": float(recorded.contacts.mean()) if simulated else 0.0,
        "dofs": recorded.qpos.shape[1],
        "joints": len(scene.cable.cells),
        "pieces": scene.pieces,
        "timestep_s": scene.options.timestep,
        "peak_memory_MB": peak_memory() / 1e6,
        "provenance": provenance.to_json(),
    }


def peak_memory() -> float:
    """Largest resident memory of this process so far [bytes]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def _peak(values: np.ndarray) -> float:
    return float(np.abs(values).max()) if len(values) else 0.0
