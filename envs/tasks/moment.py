"""How far an episode is, what it is paid and whether it is over: functions of (xp, …) for arrays and in programs."""

from typing import Any, NamedTuple

from haustra.envs.tasks.config import TaskConfig
from haustra.models.injury.perforation import worst_load

_ANUS = 0.04
"""A withdrawn scope has reached the anus when its tip is less than this far in [m]."""


class Dealt(NamedTuple):
    """What an episode was dealt; one number a world."""

    gain: Any
    """Pull that arrives over pull asked for [1]."""
    slack: Any
    """Share of a wheel's travel that does nothing [1]."""
    friction: Any
    """Coulomb coefficient [1]."""
    length: Any
    """Length of the colon's centreline [m]."""
    valve: Any
    """Arc length at which the caecum begins [m]; not a number where not known."""
    bears: Any
    """Largest wall force on one link that does not perforate [N] (`Limits.perforation_force`)."""


class Kept(NamedTuple):
    """What is kept of an episode; one number a world."""

    progress: Any
    """Share of the way that the tip has come, the furthest so far [1]."""
    place: Any
    """Share of the way at which the tip was last [1]."""
    start: Any
    """Arc length at which the tip began [m]."""
    coverage: Any
    """Share of the surface seen when it was last looked at [1]."""
    in_caecum: Any
    """1 once the tip was in the caecum, else 0."""
    load: Any
    """Largest load of the wall over the median person's strength [1]."""
    load_arc: Any
    """Arc length there [m]."""
    pain: Any
    """Largest pain so far [1] (`haustra.models.injury.pain`)."""
    age: Any
    """Control steps since it began."""
    wheel_up: Any
    """How far the wheel is turned towards 'up' [1]."""
    wheel_left: Any
    """How far the wheel is turned towards 'left' [1]."""


class Sensed(NamedTuple):
    """What is looked up and read off for rewards and endings; one number a world."""

    arc: Any
    """Arc length of the tip [m]."""
    insertion: Any
    """Length of scope past the anus [m]."""
    wall_force: Any
    """Largest resultant on one link [N]."""
    load: Any
    """Largest load of the wall over the median person's strength [1]."""
    load_arc: Any
    """Arc length there [m]."""
    pain: Any
    """Largest tension of wall or mesentery over that which hurts [1]."""
    facing: Any
    """Cosine between the viewing direction and the way; 1 when nothing is paid for it [1]."""
    coverage: Any
    """Share of the surface seen so far [1]."""


class Moment(NamedTuple):
    """What rewards are computed from; one number a world."""

    progress: Any
    """Share of the way that the tip has come, the furthest so far [1]."""
    place: Any
    """Share of the way at which the tip is now [1]."""
    facing: Any
    """Cosine between the viewing direction and the way: 1 ahead, -1 back; 1 when nothing is paid for it [1]."""
    wall_force: Any
    """Largest resultant on one link at the end of the last action [N]; a peak between two actions is not seen."""
    excess: Any
    """Scope inside beyond the colon passed [m]."""
    coverage: Any
    """Share of the surface seen so far [1]."""
    haste: Any
    """Share of the way that the tip has come beyond what `Limits.pace` allows by now [1]."""
    reached: Any
    """Whether the end of the way is reached."""
    perforated: Any
    """Whether a wall force exceeded the perforation limit."""


def moment(xp: Any, config: TaskConfig, dealt: Dealt, kept: Kept, sensed: Sensed, healthy: Any) -> tuple[Moment, Kept]:
    """Where an episode is now, and what is kept of it.

    Args:
        xp: numpy, or what writes programs.
        config: the rules.
        dealt: what the episode was dealt.
        kept: what was kept of it so far.
        sensed: what is read off now.
        healthy: whether the world has not diverged.
    """
    arc, limits = sensed.arc, config.limits
    if config.task == "insertion":
        end = dealt.length - limits.caecum_margin
        share, reached = (arc - kept.start) / (end - kept.start), arc >= end
    else:
        share = (kept.start - arc) / xp.maximum(kept.start - _ANUS, 1e-6)
        reached = arc <= _ANUS
    progress = xp.where(healthy, xp.maximum(kept.progress, xp.clip(share, 0.0, 1.0)), kept.progress)
    place = xp.where(healthy, share, progress)
    load, load_arc = worst_load(xp, (kept.load, kept.load_arc), sensed.load, sensed.load_arc)
    now = Moment(
        progress=progress,
        place=place,
        facing=sensed.facing,
        wall_force=sensed.wall_force,
        excess=sensed.insertion - arc,
        coverage=sensed.coverage,
        haste=xp.maximum(progress - kept.age * (config.drive.control_interval / limits.pace), 0.0),
        reached=reached & healthy,
        perforated=(sensed.wall_force > dealt.bears) & healthy,
    )
    return now, kept._replace(
        progress=progress,
        place=place,
        coverage=sensed.coverage,
        in_caecum=xp.where(healthy & (arc >= dealt.valve), 1.0, kept.in_caecum),
        load=xp.where(healthy, load, kept.load),
        load_arc=xp.where(healthy, load_arc, kept.load_arc),
        pain=xp.where(healthy, xp.maximum(kept.pain, sensed.pain), kept.pain),
    )


def over(now: Moment, age: Any, longest: int, healthy: Any) -> tuple[Any, Any]:
    """Whether an episode ends by what happened, and else, whether its time is up.

    Args:
        now: where it is.
        age: control steps since it began.
        longest: control steps that it has.
        healthy: whether the world has not diverged.
    """
    ended = now.reached | now.perforated | ~healthy
    return ended, ~ended & (age >= longest)


def begun(xp: Any, begins: Any, kept: Kept, arc: Any) -> Kept:
    """What is kept of episodes that begin, tips at that arc length [m], and of those that go on."""
    fresh = Kept(*([0.0] * len(Kept._fields)))._replace(start=arc)
    return Kept(*(xp.where(begins, new, old) for new, old in zip(fresh, kept, strict=True)))
