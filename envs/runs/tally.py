"""What is kept of many insertions while they run, and what is said of them at the end."""

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.runs.outcome import ENDINGS, Outcome, outcome_of
from haustra.models.injury.perforation import perforation_probability, worst_load

Array: TypeAlias = Any


class Tally(NamedTuple):
    """Scores so far; leading axis: worlds."""

    tip_arc_max: Array
    push_peak: Array
    torque_peak: Array
    wall_peak: Array
    wall_sum: Array
    loop_excess_peak: Array
    load_peak: Array
    """Largest load of the wall over the median person's strength [1]."""
    load_arc: Array
    """Arc length there [m]."""
    pain_peak: Array
    """Largest tension of wall or mesentery over that which is assumed to hurt [1]."""
    pain_arc: Array
    """Arc length there [m]."""
    intervals: Array
    ended: Array
    """Row of `haustra.envs.runs.outcome.ENDINGS`; 0 while a run goes on."""


class Measured(NamedTuple):
    """What scores are made of, at one instant; leading axis: worlds."""

    tip_arc: Array
    """Arc length of the tip [m]."""
    insertion: Array
    """Length past the anus [m]."""
    push_force: Array
    """[N]."""
    torque: Array
    """[N m]."""
    wall_force: Array
    """Largest resultant on one link [N]."""
    load: Array
    """Largest load of the wall under a link over the median person's strength [1]."""
    load_arc: Array
    """Arc length there [m]."""
    pain: Array
    """Largest tension of wall or mesentery over that which is assumed to hurt [1]."""
    pain_arc: Array
    """Arc length there [m]."""


def counted(xp: Any, tally: Tally, seen: Measured, ended: Array) -> Tally:
    """Scores after one more control interval.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        tally: scores before it.
        seen: at its end.
        ended: why the run ends with it, as a row of `haustra.envs.runs.outcome.ENDINGS`.
    """
    worst = (tally.load_peak, tally.load_arc), seen.load, seen.load_arc
    load, arc = worst_load(xp, *worst, escaped=ended == ENDINGS.index(Outcome.ESCAPED))
    return Tally(
        tip_arc_max=xp.maximum(tally.tip_arc_max, seen.tip_arc),
        push_peak=xp.maximum(tally.push_peak, xp.abs(seen.push_force)),
        torque_peak=xp.maximum(tally.torque_peak, xp.abs(seen.torque)),
        wall_peak=xp.maximum(tally.wall_peak, seen.wall_force),
        wall_sum=tally.wall_sum + seen.wall_force,
        loop_excess_peak=xp.maximum(tally.loop_excess_peak, seen.insertion - seen.tip_arc),
        load_peak=load,
        load_arc=arc,
        pain_peak=xp.maximum(tally.pain_peak, seen.pain),
        pain_arc=xp.where(seen.pain > tally.pain_peak, seen.pain_arc, tally.pain_arc),
        intervals=tally.intervals + 1,
        ended=ended,
    )


@dataclass(frozen=True)
class Insertions:
    """Many finished runs; arrays have one entry a world. A diverged world's numbers are those before it diverged."""

    outcome: tuple[Outcome, ...]
    simulated: Float[np.ndarray, " worlds"]
    """Simulated time until it ended [s]."""
    tip_arc_max: Float[np.ndarray, " worlds"]
    """Furthest arc length of the tip [m]."""
    insertion: Float[np.ndarray, " worlds"]
    """Length past the anus at the end [m]."""
    push_force_peak: Float[np.ndarray, " worlds"]
    """[N]."""
    torque_peak: Float[np.ndarray, " worlds"]
    """[N m]."""
    wall_force_peak: Float[np.ndarray, " worlds"]
    """Largest resultant on one link [N]."""
    wall_force_mean: Float[np.ndarray, " worlds"]
    """Mean over time of the largest resultant on one link [N]."""
    loop_excess_peak: Float[np.ndarray, " worlds"]
    """Most scope inside beyond the colon passed [m]."""
    p_perforation: Float[np.ndarray, " worlds"]
    """Share of people whose colon would have been perforated [1]."""
    load_peak: Float[np.ndarray, " worlds"]
    """Largest load of the wall over the median person's strength [1]."""
    load_arc: Float[np.ndarray, " worlds"]
    """Arc length there [m]."""
    pain_peak: Float[np.ndarray, " worlds"]
    """Largest tension of wall or mesentery over that which is assumed to hurt [1]."""
    pain_arc: Float[np.ndarray, " worlds"]
    """Arc length there [m]."""
    gas_pressure_peak: Float[np.ndarray, " worlds"] | None = None
    """Highest pressure of gas in any segment [Pa]; None without gas."""
    gas_volume: Float[np.ndarray, " worlds"] | None = None
    """Volume of the colon's gas at the end [m^3]; None without gas."""

    @classmethod
    def of(
        cls,
        tally: Tally,
        *,
        healthy: Bool[np.ndarray, " worlds"],
        attempts: Float[np.ndarray, " worlds"],
        simulated: Float[np.ndarray, " worlds"],
        insertion: Float[np.ndarray, " worlds"],
        gas: tuple[Float[np.ndarray, " worlds"], Float[np.ndarray, " worlds"]] | None = None,
    ) -> "Insertions":
        """Say how runs went.

        Args:
            tally: scores.
            healthy: whether runs stayed sound.
            attempts: times that the driver backed off since the last progress.
            simulated: when they ended [s].
            insertion: length past the anus then [m].
            gas: highest pressure [Pa], and volume at the end [m^3].
        """
        kept = Tally(*(np.asarray(part, float) for part in tally))
        ends = zip(kept.ended, np.asarray(healthy), np.asarray(attempts), strict=True)
        return cls(
            outcome=tuple(outcome_of(int(row), healthy=bool(sound), attempts=int(tries)) for row, sound, tries in ends),
            simulated=np.asarray(simulated, float),
            tip_arc_max=kept.tip_arc_max,
            insertion=np.asarray(insertion, float),
            push_force_peak=kept.push_peak,
            torque_peak=kept.torque_peak,
            wall_force_peak=kept.wall_peak,
            wall_force_mean=kept.wall_sum / np.maximum(kept.intervals, 1),
            loop_excess_peak=kept.loop_excess_peak,
            p_perforation=perforation_probability(kept.load_peak),
            load_peak=kept.load_peak,
            load_arc=kept.load_arc,
            pain_peak=kept.pain_peak,
            pain_arc=kept.pain_arc,
            gas_pressure_peak=gas and gas[0],
            gas_volume=gas and gas[1],
        )
