"""From worm speed to propulsion: friction that depends on speed, shaft losses, worm torque and roll, in closed form."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from haustra.errors import InvalidOptionError
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.implied import (
    SPEEDS_RPM,
    STATEMENTS,
    best_guaranteed,
    implied_curves,
    rises_ever_less,
)
from haustra.models.devices.tracked.law import load_law

_DROOP = 0.1
"""Share of its largest torque over which the worm slows down to a stand; engineering choice."""


@dataclass(frozen=True)
class DrivePoint:
    """The whole device at one worm speed on one surface."""

    rpm: float
    speed: float
    """Speed of the treads over the wall [m/s]."""
    friction: float
    """Effective coefficient: nominal x speed dependence x what the shaft transmits [1]."""
    normal: float
    """Sum over the tracks, set by the bellows [N]."""
    force: float
    """Axial propulsion [N]."""
    worm_torque: float
    """[N m]."""
    roll: float
    """Rate at which the device turns in the tube [rad/s]."""


def track_normal(design: TrackedDesign, diameter: float) -> float:
    """Normal force of one track in a round tube [N]: bellows and tread in series; 0 where they do not reach.

    Raises:
        InvalidDesignError: when the tube does not fit the device, or no force table fits the tread.
    """
    from scipy.optimize import brentq

    law = load_law(design.tread)
    operating = law.indentation(design.bellows.preload / 2)
    extension = design.extension_in(diameter)

    def excess(indentation: float) -> float:
        pushed = design.bellows.force(extension + indentation - operating)
        return 2 * float(law.mean_force(indentation)) - pushed

    if excess(0.0) >= 0:
        return 0.0
    indentation = float(brentq(excess, 0.0, design.tread.tissue_thickness))  # type: ignore[arg-type]
    return 2 * float(law.mean_force(indentation))


def worm_lever(design: TrackedDesign) -> float:
    """Torque that the worm needs over the traction of all treads [m]: lead / (2 pi efficiency)."""
    return design.worm.lead / (math.tau * design.worm.efficiency)


@dataclass(frozen=True)
class WormState:
    """What the one worm does, in a colon as in the rigs: its torque, and how fast it still runs under it."""

    torque: Any = 0.0
    """What the treads ask of it, and turn the core with [N m]; a number, or one a world."""
    speed_share: Any = 1.0
    """Its speed over the speed asked for [1]: less than 1 next to the largest torque that the shaft may transmit."""

    @classmethod
    def under(cls, design: TrackedDesign, traction: Any, *, xp: ModuleType = np) -> "WormState":
        """What the worm does while the treads pull with `traction` [N].

        A worm that is asked for more than the shaft transmits stands; being self-locking it holds.
        """
        torque = xp.abs(traction) * worm_lever(design)
        spare = (1 - torque / design.worm.torque_limit) / _DROOP
        return cls(torque, xp.clip(spare, 0.0, 1.0))


def drive_point(design: TrackedDesign, friction: float, rpm: float, *, diameter: float | None = None) -> DrivePoint:
    """Quasi-static balance of the device held by a string.

    Treads slide; friction T = mu(v) g(w) sum N points against sliding, which has a part around the tube because the
    worm's torque t = F lead / (2 pi eta) turns the body: F = sqrt(T^2 - (t / R)^2) and
    roll = (v / R) tan(asin(t / (R T))).

    Raises:
        InvalidDesignError: when the tube does not fit the device.
        InvalidOptionError: when the speed is not positive, or the worm needs more torque than the shaft carries.
    """
    if not 0 < rpm < 1e5:
        raise InvalidOptionError(f"Worm speed is {rpm} rpm: give a positive number.")
    diameter = design.nominal_diameter if diameter is None else diameter
    radius = diameter / 2
    speed = design.tread_speed(rpm)
    effective = friction * design.speed_friction.factor(speed) * design.shaft.transmission(rpm * math.tau / 60)
    normal = TRACKS * track_normal(design, diameter)
    lever = worm_lever(design)
    force = effective * normal / math.hypot(1.0, lever / radius)
    torque = force * lever
    if torque > design.worm.torque_limit:
        raise InvalidOptionError(
            f"The worm would need {torque:.3g} N m, more than the shaft's {design.worm.torque_limit:.3g} N m: lower "
            "the friction or raise worm.torque_limit."
        )
    return DrivePoint(rpm, speed, effective, normal, force, torque, speed / radius * lever / radius)


@dataclass(frozen=True)
class RangeFit:
    """What the paper's statements identify of the losses over the range, and how well."""

    efficiency: float
    """Level at the peak over the loss-free force."""
    ends: float
    """Level at 75 and 300 rpm over that at 150 rpm."""
    exponent: float
    """`SpeedFriction.exponent` if the lower end's loss is friction's."""
    stall_excess: float
    """`FlexibleShaft.stall_excess` if the upper end's is the shaft's [rad/s]."""
    misfit: tuple[float, ...]
    """Misfits of mean, RMSE and peak RMSE, for tissue then plastic, over the mean [1]."""


def fit_range(design: TrackedDesign) -> RangeFit:
    """Fit two numbers, shared by both surfaces, to the paper's six: mean, RMSE and peak RMSE of each.

    Mean and RMSE do not change when speeds are swapped, so they cannot tell loss below 150 rpm from loss above it:
    the third parameter of rise and fall is fixed by letting both ends lose alike.
    """
    from scipy.optimize import least_squares

    rpm = np.array(SPEEDS_RPM)
    lever = design.worm.lead / (math.tau * design.worm.efficiency) / (design.nominal_diameter / 2)
    reaction = 1 / math.hypot(1.0, lever)

    def level(parameters):
        efficiency, ends = parameters
        rise = np.minimum(1.0, rpm / 150) ** (math.log(ends) / math.log(0.5))
        return efficiency * rise * (1 - np.maximum(0.0, rpm - 150) / 150 * (1 - ends)) * reaction

    def misfit(parameters):
        out = []
        for statement in STATEMENTS.values():
            curve, s = statement.simulated * level(parameters), statement.simulated
            rmse = math.sqrt(((curve - s) ** 2).mean())
            out += [curve.mean() - statement.mean, rmse - statement.rmse, s - curve.max() - statement.peak_rmse]
            out[-3:] = [value / statement.mean for value in out[-3:]]
        return out

    found = least_squares(misfit, [0.95, 0.75], bounds=([0.5, 0.3], [1.0, 0.999]))
    efficiency, ends = (float(value) for value in found.x)
    return RangeFit(
        efficiency=efficiency,
        ends=ends,
        exponent=math.log(ends) / math.log(0.5),
        stall_excess=150 * math.tau / 60 / (1 - ends),
        misfit=tuple(float(value) for value in found.fun),
    )


def range_error(surface: str, forces: Sequence[float]) -> dict[str, Any]:
    """RMSE of five forces [N] against every curve the paper allows, in percent of the measured mean.

    Also against those alone that rise to 150 rpm by less and less (`rises_ever_less`).
    """
    statement = STATEMENTS[surface]
    curves = implied_curves(statement)
    errors = np.sqrt(((curves - np.asarray(forces)) ** 2).mean(1)) / statement.mean * 100
    rising = rises_ever_less(curves)
    return {
        "median_percent": float(np.median(errors)),
        "low_percent": float(errors.min()),
        "p95_percent": float(np.quantile(errors, 0.95)),
        "high_percent": float(errors.max()),
        "farthest_curve_N": curves[errors.argmax()].tolist(),
        "within_12_percent_share": float((errors <= 12).mean()),
        "rising_ever_less_share": float(rising.mean()),
        "rising_ever_less_high_percent": float(errors[rising].max()),
        "best_guaranteed_percent": 100 * best_guaranteed(curves) / statement.mean,
    }
