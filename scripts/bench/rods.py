"""Every shape and every release of a rod, at several numbers of joints, as rows."""

from collections.abc import Callable, Sequence
from typing import Any

from haustra.scripts.bench.release import release_errors
from haustra.scripts.bench.rod_data import RodData
from haustra.scripts.bench.statics import observed_order, static_errors


def bench_rods(
    data: RodData,
    counts: Sequence[int],
    *,
    timestep: float | None = None,
    progress: Callable[[float, str], None] = lambda done, note: None,
) -> dict[str, Any]:
    """Rows of errors as fractions of length, and what they cost, as plain JSON values.

    Args:
        data: the rod, its shapes and its releases.
        counts: numbers of joints.
        timestep: of the releases [s]; what is stable and accurate when None.
        progress: called with the cases done so far and a note.
    """
    done = 0
    statics, rows, cost = [], [], []
    for joints in counts:
        before = done
        shapes = static_errors(
            data.rod,
            data.shapes,
            joints,
            progress=lambda solved, before=before, joints=joints: progress(before + solved, f"{joints} joints"),
        )
        done += len(data.shapes.tip)
        releases = []
        for release in data.releases:
            releases.append(release_errors(data.rod, release, joints, timestep=timestep))
            done += 1
            progress(done, f"{joints} joints, {release.file}")
        statics.append(shapes)
        rows.append(
            {
                "joints": joints,
                "statics_mean_tip_error": float(shapes.errors.mean()),
                "statics_max_tip_error": float(shapes.errors.max()),
                "dynamics": [
                    {"file": each.file, "mid_rms": each.mid_rms, "tip_rms": each.tip_rms} for each in releases
                ],
            }
        )
        cost.append(
            {
                "joints": joints,
                "seconds_per_shape": shapes.seconds_per_shape,
                "newton_iterations": shapes.iterations,
                "timesteps_s": [each.timestep for each in releases],
                "real_time_factors": [each.real_time_factor for each in releases],
                "tip_means": [each.tip_mean for each in releases],
            }
        )
    for entry, order in zip(cost, observed_order(statics), strict=True):
        entry["observed_order"] = order
    return {"shapes": len(data.shapes.tip), "rows": rows, "cost": cost}
