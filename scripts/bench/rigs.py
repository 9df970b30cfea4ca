"""Many rigs of the tracked robot at once: how fast, and how near to the native backend's forces."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
import warp as wp

from haustra.envs.runs.measure.propulsion import pull
from haustra.envs.runs.warp_rigs import WarpRigs
from haustra.envs.study.propulsion import answer
from haustra.envs.study.propulsion_worlds import answer_worlds
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.study_file import load_study
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.law import PadLaw, load_table
from haustra.models.devices.tracked.rig import Rig, flat_rig, tube_rig
from haustra.scripts.bench.machine import machine

_SPEEDS = (16.25e-3, 65e-3)
"""Slowest and fastest tread of the published study [m/s]."""
_FRICTION = (0.2, 0.4)
"""Plastic and tissue."""
_STUDY_COMPARED = 40
"""Jobs of a study that the native backend repeats."""
_COMPARED = 4
"""State that the native backend repeats, spread over all speeds and frictions."""


def _track(friction: float) -> Rig:
    design = TrackedDesign()
    law = PadLaw.fit(load_table(design.tread))
    return flat_rig(design, friction=friction, indentation=law.indentation(design.bellows.preload / 2))


def _device(friction: float) -> Rig:
    return tube_rig(TrackedDesign(), friction=friction)


RIGS: Mapping[str, Callable[[float], Rig]] = {"track": _track, "device": _device}
"""One track on a flat strip; the whole device in a round tube. Each is built for a coefficient of friction."""


def bench_rigs(
    kinds: Sequence[str],
    worlds: Sequence[int],
    *,
    device: str | None = None,
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> dict[str, Any]:
    """Run rigs with speeds and frictions spread over the published study's, and repeat some of them natively.

    Args:
        kinds: of `RIGS`.
        worlds: numbers of worlds to try.
        device: as Warp names it.
        progress: told sizes done.
    """
    rows, parity = [], []
    for kind in kinds:
        for count in worlds:
            rows.append(_rate(kind, count, device))
            progress(len(rows), f"{count} worlds of one {kind}")
        parity += compare_rigs(kind, device)
    where = wp.get_device(device)
    return {
        "rates": rows,
        "parity": parity,
        "bars_steps_per_s": {"track": 20e6, "device": 3e6},
        "device": where.name,
        "warp": wp.__version__,
        **machine(),
    }


def time_study(jobs: int) -> dict[str, Any]:
    """Answer the propulsion study that ships, or a part that is spread over it, and some of its jobs natively.

    It is answered twice: the first time compiles kernels, or loads them from Warp's cache.

    Args:
        jobs: how many of its 10,000.
    """
    study = load_study("propulsion")
    every = list(jobs_of(study, designs_of(study)))
    chosen = every[:: max(1, len(every) // jobs)]
    parts: dict[str, float] = {}
    rows = {result.job: result for result in answer_worlds(study, chosen, spent=parts)}
    spent = sum(parts.values())
    again: dict[str, float] = {}
    list(answer_worlds(study, chosen, spent=again))
    compared = [job for job in chosen[:: max(1, len(chosen) // _STUDY_COMPARED)] if rows[job.id].state == "finished"]
    apart = [
        float(cast(float, rows[job.id].scores["force_N"])) / float(cast(float, answer(study, job).scores["force_N"]))
        - 1
        for job in compared
    ]
    return {
        "jobs": len(chosen),
        "seconds": spent,
        **{f"{part}_s": value for part, value in parts.items()},
        "seconds_again": sum(again.values()),
        **{f"{part}_again_s": value for part, value in again.items()},
        "states": dict(Counter(result.state for result in rows.values())),
        "compared": len(compared),
        "largest_force_apart": float(np.abs(apart).max()),
    }


def _spread(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Speeds and frictions of that many worlds: both ranges are covered by any number."""
    share = (np.arange(count) + 0.5) / count
    return _SPEEDS[0] + share * (_SPEEDS[1] - _SPEEDS[0]), _FRICTION[0] + (share * 7 % 1) * (
        _FRICTION[1] - _FRICTION[0]
    )


def _rate(kind: str, count: int, device: str | None) -> dict[str, Any]:
    began = time.perf_counter()
    rigs = WarpRigs([RIGS[kind](0.4)], which=np.zeros(count, int), device=device)
    pulls = rigs.pull(*_spread(count))
    first = time.perf_counter() - began
    began = time.perf_counter()
    pulls = rigs.pull(*_spread(count))
    spent = time.perf_counter() - began
    return {
        "rig": kind,
        "worlds": count,
        "steps_per_s": count * pulls.steps / spent,
        "first_call_s": first,
        "call_s": spent,
        "sound": float(pulls.sound.mean()),
        "timestep_s": float(rigs.model.opt.timestep),
    }


def compare_rigs(kind: str, device: str | None = None) -> list[dict[str, Any]]:
    """Some speeds and frictions of one of `RIGS`, each beside the same run of the native backend.

    Args:
        kind: of `RIGS`.
        device: as Warp names it.
    """
    speeds, frictions = _spread(_COMPARED)
    many = WarpRigs([RIGS[kind](0.4)], which=np.zeros(_COMPARED, int), device=device).pull(speeds, frictions)
    rows = []
    for world, (speed, friction) in enumerate(zip(speeds, frictions, strict=True)):
        alone = pull(RIGS[kind](friction), speed)
        rows.append(
            {
                "rig": kind,
                "speed_mm_s": speed * 1e3,
                "friction": friction,
                "force_N": float(many.force[world]),
                "native_force_N": alone.mean,
                "force_apart": float(many.force[world] / alone.mean - 1),
                "normal_apart": float(many.normal[world] / alone.normal.mean() - 1),
                "ripple_apart": float(many.ripple[world, 0] / alone.ripple()[0] - 1),
            }
        )
    return rows
