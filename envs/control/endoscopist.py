"""A driver that works as endoscopists do, from what one of them senses.

It sees where the lumen goes and whether it passes by, feels force and torque at the hand, reads the marks on the shaft,
and knows for how long nothing has moved. It does not know forces of the wall, nor where its tip is along the colon but
by how much lumen has passed since. What it does is one of a few small manoeuvres:

- **advance** under sight, in quick strokes with looks between them: it pushes no harder than a soft limit, and firmer
  the longer no lumen passes; the shaft is turned to and fro meanwhile, which lets it slip;
- **look** between two strokes: the hand eases what pushes hard, so that a strong push never lasts;
- **straighten**: with the tip hooked round the bend that it looks into, it pulls back and turns the shaft until the
  lumen slips away or the pull gets strong; after every stretch of new colon, and whenever shaft goes in that the tip
  does not make good, which is how a loop feels. A loop that comes again is left deeper each time;
- **jiggle**: short strokes in and out, which pleat the colon onto the shaft;
- **rest**: a while without any motion after each manoeuvre, in which one looks and breathes;
- **suck gas out**, from the transverse colon on, and after attempts in vain until new colon is seen: a colon is shorter
  without gas. Textbooks ask for it often, at the flexures above all;
- **ask the assistant**: a hand on the belly, and then other postures, one after the other, when attempts have failed;
- **give up**: after many attempts in vain the insertion is over.

Its rules are one function of (xp, …), as the follower's, for any number of worlds in numpy, JAX and programs of linear
time. What the assistant does, and whether gas is sucked out, are numbers in its memory, which who steps the colon must
honour (`ASSISTANT`, `Memory.sucks`).
"""

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from jaxtyping import Float

from haustra.envs.control.follower import Decision, Law, Sensed, Steering, pulls_for, steer_ahead
from haustra.fields import number, require_declared
from haustra.models.wall.abdomen import Abdomen

ASSISTANT = (
    Abdomen(),
    Abdomen(pressed="sigmoid"),
    Abdomen(pressed="transverse"),
    Abdomen(posture="left"),
    Abdomen(posture="right"),
)
"""What the assistant does, by `Memory.assist`: nothing, a hand on the sigmoid or the transverse colon, a posture."""

_ADVANCE, _PULL, _REST, _JIGGLE = 0.0, 1.0, 2.0, 3.0
_NEVER = -1e3


@dataclass(frozen=True)
class EndoscopistSettings:
    """How an endoscopist works. Engineering choices within what published colonoscopies show, as each says."""

    look_ahead: float = number("m", 0.005, 0.5, default=0.045)
    """Distance ahead of the tip of the lumen that it is steered towards [m]."""
    advance_rate: float = number("m/s", 1e-4, 1.0, default=0.04)
    """Insertion speed in free lumen [m/s]: 0.9 m in 23 s of motion; a whole insertion takes 5 to 15 min (Shah 2000)."""
    steer_gain: float = number("1/s", 0.0, 100.0, default=6.0)
    """Bending rate per angle off the lumen's axis [1/s]."""
    steer_limit_deg: float = number("degrees", 1.0, 360.0, default=130.0)
    """Largest angle that the tip is bent to [degrees]."""
    steer_lead: float = number("rad", 0.01, 10.0, default=3.0)
    """Largest lead of the wires over the angle that the bending section has reached [rad]: enough to pull at a tip that
    a wall has caught as hard as wheels do. With 0.6 rad, tips stay bent over in the right colon."""
    slow_from: float = number("1", 0.0, 0.99, default=0.95)
    """Share of the largest push, as it is meanwhile, from which on the hand slows down, to stand still at all of it
    [1]."""
    gentle_force: float = number("N", 0.01, 1e3, default=10.0)
    """Push that is not exceeded while things go well [N]; 9.8 N are exceeded for 5 % of the time (Appleyard 2000)."""
    held_force: float = number("N", 0.01, 1e3, default=6.0)
    """Push that is left on the shaft while it is held [N]: the hand eases what is more."""
    firm_force: float = number("N", 0.01, 1e3, default=36.0)
    """Push that is not exceeded at all [N]: no patient is pushed at harder on purpose."""
    unbend_time: float = number("s", 0.5, 600.0, default=10.0)
    """Time without lumen passing in whose second half the tip is let go straight, again and again [s]: a tip that is
    bent over on itself is pushed sideways, not on."""
    unbent: float = number("rad", 0.0, 3.0, default=0.4)
    """Largest bend that it steers for meanwhile [rad]."""
    stroke: float = number("s", 0.05, 600.0, default=8.0)
    """How long it pushes in one go [s]: quick strokes get on where slow ones only bow the colon."""
    pause: float = number("s", 0.0, 600.0, default=2.0)
    """How long it looks between two strokes, the hand eased [s]."""
    calm: float = number("s", 0.0, 600.0, default=3.0)
    """Time without lumen passing for which one goes on gently [s]."""
    firmer: float = number("N/s", 0.0, 1e3, default=4.0)
    """Rate at which one pushes harder from then on, until lumen passes [N/s]."""
    pull_force: float = number("N", 0.01, 1e3, default=12.0)
    """Pull at which withdrawal stands still [N]; clinics' largest is 17.7 N (Appleyard 2000). With 15 N more virtual
    patients' walls are torn than are published."""
    torque_limit: float = number("N m", 1e-3, 10.0, default=0.8)
    """Torque at which turning stands still [N m]."""
    withdraw_rate: float = number("m/s", 1e-4, 1.0, default=0.05)
    """Speed of pulling back [m/s]."""
    lost_shaft: float = number("m", 0.005, 1.0, default=0.3)
    """Shaft that goes in without lumen passing before a loop is felt [m]; as much more after each attempt."""
    new_colon: float = number("m", 0.01, 2.0, default=0.2)
    """New colon after which the shaft is straightened at the next bend that holds the tip [m]."""
    hook: float = number("rad", 0.0, 3.0, default=1.0)
    """Bend of the tip from which on it holds in a bend of the colon while the shaft is pulled [rad]."""
    slip: float = number("m", 1e-3, 0.5, default=0.06)
    """Lumen that slips away before pulling back ends [m]."""
    least_pull: float = number("m", 1e-3, 0.5, default=0.04)
    """Pulling back goes at least this far [m]."""
    most_pull: float = number("m", 1e-2, 2.0, default=0.6)
    """And at most this far [m]."""
    longest_pull: float = number("s", 1.0, 600.0, default=40.0)
    """Pulling back takes no longer [s]."""
    twist: float = number("rad", 0.0, 4 * math.pi, default=4.7)
    """Angle that the shaft is turned through while pulling back, clockwise first [rad]."""
    roll_rate: float = number("rad/s", 0.01, 50.0, default=math.radians(60))
    """Rate of turning [rad/s]."""
    swing: float = number("rad", 0.0, 2 * math.pi, default=2.2)
    """Angle by which the shaft is turned to and fro while it is pushed [rad]: a shaft that turns slips more easily."""
    swing_time: float = number("s", 0.2, 60.0, default=4.0)
    """Time of one turn to and fro [s]."""
    patience: float = number("s", 0.1, 600.0, default=60.0)
    """Time without lumen passing after which something else is tried [s]."""
    most_attempts: float = number("1", 1.0, 1e3, default=12.0)
    """Attempts without new colon after which it gives up, which ends the insertion: above clinics' medians of 7 to 10
    in all, where they go up to 80 (Shah 2000); pain and looping end one insertion in twenty to ten there (Thieme
    a-0574-2478)."""
    suck_after: float = number("1", 0.0, 1e3, default=1.0)
    """Attempts without new colon after which it sucks gas out instead of letting it in; more than `most_attempts`:
    never."""
    suck_from: float = number("m", 0.0, 100.0, default=1.0)
    """Lumen seen to pass from which on it sucks gas out all the time [m]: where the transverse colon is. Textbooks have
    its loop drawn up and collapsed by suction, and suck at the hepatic flexure and beyond (Cotton and Williams,
    Practical Gastrointestinal Endoscopy)."""
    rest: float = number("s", 0.0, 600.0, default=10.0)
    """Rest after each manoeuvre [s]: for so long one looks, and the assistant moves or presses; a hand on the belly
    mostly presses for less than 30 s (Waye 1991, Gastrointest Endosc 37:147, abstract)."""
    jiggle: float = number("m", 0.0, 0.2, default=0.015)
    """Half the stroke of jiggling [m]."""
    jiggle_rate: float = number("1/s", 0.01, 20.0, default=1.0)
    """Strokes a second [1/s]."""
    jiggle_time: float = number("s", 0.1, 100.0, default=5.0)
    """How long it jiggles [s]."""
    spare_shaft: float = number("m", 0.01, 1.0, default=0.03)
    """Shaft that is left outside: with less of it, it straightens before it goes on [m]."""
    hand_lead_limit: float = number("m", 1e-4, 0.1, default=0.01)
    """Largest distance that the hand aims ahead of where the shaft is [m]."""
    steer: Literal["pulls", "wheels"] = "pulls"
    """What the tip is steered by: pulls of wires, or wheels."""
    straighten: bool = True
    """Whether there is a colon to straighten: one that moves on its mesentery."""

    def __post_init__(self) -> None:
        require_declared(self, "The endoscopist")

    @classmethod
    def law(cls) -> Law:
        """What drives by these settings."""
        return Law(cls, FIRST_MEMORY, rules, gives_up=gives_up)


class Memory(NamedTuple):
    """What an endoscopist remembers; leading axis: worlds."""

    bend_up: Float[Any, "*worlds"]
    """Bend that it steers for, towards wire 'up' [rad]."""
    bend_left: Float[Any, "*worlds"]
    """Bend that it steers for, towards wire 'left' [rad]."""
    attempts: Float[Any, "*worlds"]
    """Manoeuvres since new colon was last seen."""
    mode: Float[Any, "*worlds"]
    """What it does: advance, pull back, rest, jiggle."""
    since: Float[Any, "*worlds"]
    """When it began to [s]."""
    best_arc: Float[Any, "*worlds"]
    """Furthest lumen seen [m]."""
    held_arc: Float[Any, "*worlds"]
    """Furthest lumen seen since it began to advance or to pull back [m]."""
    moved_time: Float[Any, "*worlds"]
    """When lumen last passed [s]."""
    mark_shaft: Float[Any, "*worlds"]
    """Shaft inside when lumen last passed [m]."""
    pull_shaft: Float[Any, "*worlds"]
    """Shaft inside when it last began to pull back [m]."""
    straight_arc: Float[Any, "*worlds"]
    """Lumen seen when the shaft was last straightened [m]."""
    roll_goal: Float[Any, "*worlds"]
    """Angle to which it turns the handle [rad]."""
    assist: Float[Any, "*worlds"]
    """What the assistant does: a place in `ASSISTANT`."""
    sucks: Float[Any, "*worlds"]
    """Whether it sucks gas out of the colon, instead of letting it in: 1 or 0."""


FIRST_MEMORY = Memory(0.0, 0.0, 0.0, _ADVANCE, 0.0, _NEVER, _NEVER, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Memory of an endoscopist who has seen nothing yet."""


def pulls_back(memory: Any) -> Any:
    """Which of those who remember so much pull the shaft back; None where memory is not an endoscopist's."""
    return memory.mode == _PULL if isinstance(memory, Memory) else None


def gives_up(settings: Any, memory: Any) -> Any:
    """Whether an endoscopist who remembers so much ends the insertion: the last attempt that it makes has ended."""
    return (memory.mode == _REST) & (memory.attempts >= settings.most_attempts)


def rules(
    xp: Any, settings: Any, steering: Steering, sensed: Sensed, memory: Memory, *, interval: float
) -> tuple[Decision, Memory]:
    """What an endoscopist does next.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        settings: how it works: `EndoscopistSettings`, or numbers by its names.
        steering: the scopes that it steers.
        sensed: what it senses; forces of the wall are left alone.
        memory: what it remembers.
        interval: time to the next decision [s].
    """
    own = settings
    time, arc, shaft, force = sensed.time, sensed.arc, sensed.insertion, sensed.push_force
    advancing, pulling = memory.mode == _ADVANCE, memory.mode == _PULL
    turns = (time - memory.moved_time) / own.unbend_time
    unbends = advancing & (turns - xp.floor(turns) > 0.5)
    most_bent = xp.where(unbends, xp.minimum(own.unbent, steering.bend_limit), steering.bend_limit)
    up, left = steer_ahead(xp, own, steering._replace(bend_limit=most_bent), sensed, memory, interval)
    passed = advancing & (arc > memory.held_arc + _PASSES)
    further = arc > memory.best_arc + own.slip
    best = xp.where(further, arc, memory.best_arc)
    attempts = xp.where(further & advancing, 0.0, memory.attempts)
    held = xp.where(passed | (pulling & (arc > memory.held_arc)), arc, memory.held_arc)
    moved, mark = xp.where(passed, time, memory.moved_time), xp.where(passed, shaft, memory.mark_shaft)
    begun = memory.pull_shaft
    waited = time - memory.since
    # Whether what is being done ends.
    all_in = shaft > steering.length - own.spare_shaft
    looping = (shaft > mark + own.lost_shaft * (1 + attempts)) | all_in
    cycle = own.stroke + own.pause
    strokes_done = waited / cycle
    pushes = (strokes_done - xp.floor(strokes_done)) * cycle < own.stroke
    stuck = time - moved > own.patience
    bent_up, bent_left = sensed.bend
    hooked = bent_up * bent_up + bent_left * bent_left > own.hook * own.hook
    routine = (arc > memory.straight_arc + own.new_colon) & hooked
    leaves_off = advancing & (looping | stuck | routine)
    withdrawn = begun - shaft
    slipped = (arc < memory.held_arc - own.slip) & (withdrawn > own.least_pull)
    strong = (force < -_STRONG * own.pull_force) & (withdrawn > own.least_pull)
    far = (withdrawn > own.most_pull) | (shaft < _LEAST_SHAFT)
    over = pulling & (slipped | strong | far | (waited > own.longest_pull))
    rested = (memory.mode == _REST) & (waited > own.rest) & ~gives_up(own, memory)
    jiggled = (memory.mode == _JIGGLE) & (waited > own.jiggle_time)
    # What is done next.
    attempts = xp.where(leaves_off & (looping | stuck), attempts + 1, attempts)
    third = attempts - 3 * xp.floor(attempts / 3)
    jiggles = leaves_off & stuck & (third == 0.0) & (attempts > 0)
    mode = xp.where(leaves_off, xp.where(jiggles, _JIGGLE, _PULL), memory.mode)
    mode = xp.where(over | jiggled, _REST, xp.where(rested, _ADVANCE, mode))
    changed = leaves_off | over | rested | jiggled
    since = xp.where(changed, time, memory.since)
    begins = leaves_off | rested
    held, moved = xp.where(begins, arc, held), xp.where(begins, time, moved)
    begun = xp.where(leaves_off, shaft, begun)
    straight = xp.where(over, best, memory.straight_arc)
    odd = attempts - 2 * xp.floor(attempts / 2)
    turn = own.twist * xp.where(odd == 1.0, -1.0, 1.0)
    roll_goal = xp.where(leaves_off & ~jiggles, turn, xp.where(rested & (attempts == 0), 0.0, memory.roll_goal))
    assist = attempts - len(ASSISTANT) * xp.floor(attempts / len(ASSISTANT))
    sucks = xp.where((attempts >= own.suck_after) | (arc > own.suck_from), 1.0, 0.0)
    # How the hand moves: the longer no lumen passes, the firmer it pushes.
    firmly = own.firmer * xp.maximum(time - moved - own.calm, 0.0)
    limit = xp.minimum(own.gentle_force + firmly, own.firm_force)
    ease = own.advance_rate * xp.clip(1 - force / own.held_force, -0.5, 0.0)
    slowed = xp.clip((1 - force / limit) / (1 - own.slow_from), -0.5, 1.0)
    rate = xp.where(pushes, own.advance_rate * slowed, ease)
    rate = xp.where(mode == _PULL, -own.withdraw_rate * xp.clip(3 * (1 + force / own.pull_force), 0.0, 1.0), rate)
    stroke = own.jiggle * own.jiggle_rate
    turnings = (time - since) * own.jiggle_rate
    inwards = turnings - xp.floor(turnings) < 0.5
    strokes = xp.where(inwards, 4 * stroke, -4 * stroke) * xp.clip(3 * (1 - xp.abs(force) / limit), 0.0, 1.0)
    rate = xp.where(mode == _JIGGLE, strokes, xp.where(mode == _REST, ease, rate))
    rate = xp.minimum(rate, (own.hand_lead_limit - sensed.hand_lead) / interval)
    rate = xp.maximum(rate, (-own.hand_lead_limit - sensed.hand_lead) / interval)
    swings = (time - since) / own.swing_time
    swinging = own.swing * (1 - 4 * xp.abs(swings - xp.floor(swings) - 0.5))
    turned = xp.where(mode == _ADVANCE, roll_goal + swinging, roll_goal)
    turning = xp.clip(3 * (1 - xp.abs(sensed.torque) / own.torque_limit), 0.0, 1.0)
    roll_rate = turning * xp.clip((turned - sensed.roll) / interval, -own.roll_rate, own.roll_rate)
    decision = Decision(push_rate=rate, roll_rate=roll_rate, pulls=pulls_for(xp, steering, up, left))
    kept = Memory(up, left, attempts, mode, since, best, held, moved, mark, begun, straight, roll_goal, assist, sucks)
    return decision, kept


_PASSES = 0.01
"""Lumen that passes by is seen from this much on [m]; engineering choice: slower creep is no way to go on."""
_STRONG = 0.8
"""Pulling back ends at this share of the largest pull [1]: slower than that it hardly goes on."""
_LEAST_SHAFT = 0.1
"""Pulling back ends with so much shaft inside [m]: further out is out."""
