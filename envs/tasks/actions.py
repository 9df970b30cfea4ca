"""How an action becomes what the hands ask for: one function of (xp, …) for arrays over worlds and in programs."""

from typing import Any, NamedTuple

from haustra.envs.tasks.config import Drive, TaskConfig

ACTIONS = ("push", "roll", "tip up", "tip left")
"""Each from -1 to 1."""
GAS_ACTION = "gas"
"""The fifth, where a task asks for it: from -1, suck, to 1, let in, over `TaskConfig.gas_flow`."""


def actions_of(config: TaskConfig) -> tuple[str, ...]:
    """Names of a task's actions."""
    return (*ACTIONS, GAS_ACTION) if config.gas_action else ACTIONS


class Asked(NamedTuple):
    """What is asked for until the next action."""

    push_rate: Any
    """Speed at which the hand pushes [m/s]."""
    roll_rate: Any
    """Speed at which the hand turns the shaft [rad/s]."""
    pulls: tuple[Any, Any, Any, Any]
    """Pull of each wire: up, left, down, right [N]."""
    wheels: tuple[Any, Any]
    """How far the wheels are turned then, towards up and left [1]."""


class Wires(NamedTuple):
    """What an episode's wires are like."""

    gain: Any
    """Pull that arrives over pull asked for [1]."""
    slack: Any
    """Share of a wheel's travel that does nothing [1]."""
    limit: Any
    """Largest pull [N]."""


def within(xp: Any, action: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Whether an action is finite numbers, and the action from -1 to 1; nothing where it is not.

    Args:
        xp: numpy, or what writes programs.
        action: one number for each of `actions_of` the task.
    """
    sound = xp.isfinite(action[0])
    for part in action[1:]:
        sound = sound & xp.isfinite(part)
    return sound, tuple(xp.clip(xp.where(sound, part, 0.0), -1.0, 1.0) for part in action)


def asked(
    xp: Any,
    drive: Drive,
    interval: float,
    action: tuple[Any, ...],
    sound: Any,
    wheels: tuple[Any, Any],
    wires: Wires,
    *,
    lead: Any,
    outside: Any,
) -> Asked:
    """What the hands ask for in the next interval; what is no number where the action was none.

    Args:
        xp: numpy, or what writes programs.
        drive: how actions become motion.
        interval: until the next action [s].
        action: as `within` gives it; hands leave gas to others.
        sound: whether it was finite.
        wheels: where the wheels are [1].
        wires: of the episode.
        lead: how far the hand aims ahead of the shaft [m].
        outside: length of scope that is left outside [m].
    """
    most = drive.wheel_rate * interval
    turned = tuple(wheel + xp.clip(part - wheel, -most, most) for wheel, part in zip(wheels, action[2:4], strict=True))
    up, left = (_pull(xp, wheel, wires) for wheel in turned)
    push = xp.maximum(action[0] * drive.push_rate, (-drive.hand_lead - lead) / interval)
    push = xp.minimum(push, xp.minimum(drive.hand_lead - lead, outside) / interval)
    return Asked(
        push_rate=xp.where(sound, push, xp.nan),
        roll_rate=action[1] * drive.roll_rate,
        pulls=(xp.maximum(up, 0.0), xp.maximum(left, 0.0), xp.maximum(-up, 0.0), xp.maximum(-left, 0.0)),
        wheels=(turned[0], turned[1]),
    )


def _pull(xp: Any, wheel: Any, wires: Wires) -> Any:
    """Pull of a wire, or if negative, of its opposite [N]."""
    taken = xp.maximum(xp.abs(wheel) - wires.slack, 0.0)
    return xp.where(wheel < 0, -taken, taken) / (1 - wires.slack) * wires.gain * wires.limit
