"""What is asked of the reference: force over indentation and phase, a passage of the tread, and convergence."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.models.devices.tracked.fem.strip import Equilibrium, MeshOptions, Strip
from haustra.models.devices.tracked.tread import TreadGeometry

Row = dict[str, float]
"""One solved state: names with units, ready for a CSV file."""

Progress = Callable[[float, str], None]
"""Told the solved states so far and a note."""


@dataclass(frozen=True, kw_only=True)
class Passage:
    """How the paper's strip passes over the two tips while its force and stress are recorded."""

    travel: float = 32.5e-3
    """Distance the tread moves [m]. Published: 1 s at 32.5 mm/s."""
    rear_end: float = 20e-3
    """From the rear tip to the tread's rear end at the start [m]. Assumed: the paper sees an end there at the start."""
    front_end: float = 60e-3
    """From the front tip to the tread's front end at the start [m], at least: the strip has whole pitches.

    Assumed: both ends are 40 mm away midway."""
    steps_per_pitch: int = 8


def force_table(
    geometry: TreadGeometry,
    indentations: Sequence[float],
    *,
    phases: int = 8,
    friction: float = 0.4,
    options: MeshOptions | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """One tip under a long tread: force against indentation and tooth phase.

    Args:
        geometry: Tread, tip and tissue.
        indentations: Rising indentations beyond the clearance [m].
        phases: Positions of the tip within a pitch; phase 0 is under a tooth's centre, 0.5 under a gap's.
        friction: Coulomb's coefficient between teeth and tissue.
        options: Numerical choices.
        progress: Told after each state.

    Raises:
        InvalidOptionError: when the indentations do not rise or there is no phase.
        TreadReferenceError: when a state has no equilibrium.
        MissingDependencyError: when scikit-fem is not installed.
    """
    if phases < 1 or np.any(np.diff([0.0, *indentations]) <= 0):
        raise InvalidOptionError("A force table needs at least one phase and indentations that rise from above 0.")
    strip = Strip.build(geometry, span=0.0, options=options)
    rows: list[Row] = []
    for phase in np.arange(phases) / phases:
        state = None
        for indentation in indentations:
            tip = phase * geometry.pitch
            state = strip.press([tip], indentation, friction=friction, start=state)
            rows.append({"phase": float(phase), "indentation_mm": indentation * 1e3} | _record(strip, state, [tip]))
            if progress:
                progress(len(rows), f"phase {phase:.3f}")
    return rows


def two_tips(
    geometry: TreadGeometry,
    indentation: float,
    *,
    phases: int = 8,
    friction: float = 0.4,
    options: MeshOptions | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """Both tips of a strut under a long tread, over one pitch; the phase is that of the rear tip."""
    strip = Strip.build(geometry, span=geometry.tip_spacing + geometry.pitch, options=options)
    rows: list[Row] = []
    for phase in np.arange(phases) / phases:
        rear = _nearest_tooth(geometry) + phase * geometry.pitch
        tips = [rear, rear + geometry.tip_spacing]
        state = strip.press(tips, indentation, friction=friction)
        rows.append({"phase": float(phase), "indentation_mm": indentation * 1e3} | _record(strip, state, tips))
        if progress:
            progress(len(rows), f"phase {phase:.3f}")
    return rows


def passage(
    geometry: TreadGeometry,
    indentation: float,
    *,
    course: Passage | None = None,
    friction: float = 0.4,
    options: MeshOptions | None = None,
    progress: Progress | None = None,
) -> list[Row]:
    """The paper's third step: a tread of finite length moves backwards over the two tips and the tissue.

    The strip is solved as it stands at each position (quasi-static), so the speed does not enter.
    """
    course = course or Passage()
    length = course.rear_end + geometry.tip_spacing + course.front_end
    options = replace(options or MeshOptions(), free_length=0.0)
    strip = Strip.build(geometry, span=length, options=options)
    half = float(strip.positions[:, 0].max())
    rows: list[Row] = []
    count = round(course.travel / geometry.pitch * course.steps_per_pitch)
    for moved in np.arange(count + 1) * geometry.pitch / course.steps_per_pitch:
        rear = -half + course.rear_end + moved
        tips = [rear, rear + geometry.tip_spacing]
        state = strip.press(tips, indentation, friction=friction)
        phase = float(rear / geometry.pitch % 1.0)
        ends = {"rear_end_mm": (rear + half) * 1e3, "front_end_mm": (half - tips[1]) * 1e3}
        rows.append({"moved_mm": moved * 1e3, "phase": phase} | ends | _record(strip, state, tips))
        if progress:
            progress(len(rows), f"{moved * 1e3:.1f} mm")
    return rows


def convergence(
    geometry: TreadGeometry, indentation: float, *, friction: float = 0.4, progress: Progress | None = None
) -> Iterator[Row | dict[str, str | float]]:
    """One tip over a tooth and over a gap with each numerical choice changed in turn."""
    base = MeshOptions()
    cases = {
        "base": base,
        "cells halved": replace(base, refinement=2),
        "tooth penalty x 2": replace(base, tooth_penalty=2 * base.tooth_penalty),
        "tooth penalty x 4": replace(base, tooth_penalty=4 * base.tooth_penalty),
        "tip penalty x 2": replace(base, tip_penalty=2 * base.tip_penalty),
        "bulk modulus x 0.2": replace(base, bulk_ratio=base.bulk_ratio / 5),
        "bulk modulus x 4": replace(base, bulk_ratio=base.bulk_ratio * 4),
        "free length 30 mm": replace(base, free_length=30e-3),
        "free length 52 mm": replace(base, free_length=52e-3),
    }
    for done, (name, options) in enumerate(cases.items(), 1):
        rows = force_table(geometry, [indentation], phases=2, friction=friction, options=options)
        yield {"case": name} | {
            f"{key}_{where}": row[key]
            for where, row in zip(("tooth", "gap"), rows, strict=True)
            for key in ("tip_rear_N", "contact_N", "stress_rear_kPa", "penetration_um")
        }
        if progress:
            progress(done, name)


def tip_stress(strip: Strip, state: Equilibrium, tip: float) -> float:
    """Mean von Mises stress of the belt's section above a tip, within one tip radius along the tread [Pa].

    The paper says only "directly above the strut tips"; this window is our reading of it.
    """
    return _belt_mean(strip, state, tip - strip.geometry.tip_radius, tip + strip.geometry.tip_radius)


def von_mises(strip: Strip, state: Equilibrium) -> tuple[Float[np.ndarray, " tread"], Float[np.ndarray, " tissue"]]:
    """Mean von Mises stress of each element of tread and tissue [Pa]."""
    first = len(strip.tread.nodes)
    return strip.tread.von_mises(state.displacement[:first]), strip.tissue.von_mises(state.displacement[first:])


def _belt_mean(strip: Strip, state: Equilibrium, low: float, high: float) -> float:
    centres = strip.tread.nodes[strip.tread.quads].mean(1)
    chosen = (centres[:, 1] < -strip.geometry.tooth_height) & (centres[:, 0] > low) & (centres[:, 0] < high)
    areas = strip.tread.weights.sum(1)[chosen]
    return float((von_mises(strip, state)[0][chosen] * areas).sum() / areas.sum())


def _record(strip: Strip, state: Equilibrium, tips: Sequence[float]) -> Row:
    names = ("rear", "front")
    row = {f"tip_{name}_N": float(force) for name, force in zip(names, state.tip_forces, strict=False)}
    row |= {"contact_N": state.contact_force, "friction_N": state.friction_force}
    row |= {f"stress_{name}_kPa": tip_stress(strip, state, tip) / 1e3 for name, tip in zip(names, tips, strict=False)}
    if len(tips) == 2:
        radius = strip.geometry.tip_radius
        row["stress_between_kPa"] = _belt_mean(strip, state, tips[0] + radius, tips[1] - radius) / 1e3
    row["stress_max_kPa"] = float(von_mises(strip, state)[0].max()) / 1e3
    return row | {"penetration_um": state.penetration * 1e6}


def _nearest_tooth(geometry: TreadGeometry) -> float:
    """Centre of the tooth nearest to the rear tip of a strut centred under the strip [m]."""
    return -round(geometry.tip_spacing / 2 / geometry.pitch) * geometry.pitch
