"""A scope pushed through standard curved tubes, and turned at its handle while it lies in a loop.

A tube is a straight leg, a bend that rises aside so that a loop passes over itself, and a straight leg; nobody steers.
By theory a rod without friction needs EI / (2 R^2) to be pushed into a bend of radius R: what bending takes up, per
length. Turned at its handle it turns as much at the tip, and friction mu asks for a torque of mu r times the sum of the
wall's forces; what damps its bending asks for more, in proportion to the speed, and is told by itself.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.tube import tube
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.presets import TABLE, find_preset
from haustra.models.scene import build_scene
from haustra.provenance import Provenance

BEND_RADIUS, BORE = 0.1, 0.012
"""Radius of a bend, and of the tube's bore [m]; engineering choices: an alpha loop's, and a scope's with some room."""
LEG, RISE = 0.15, 0.04
"""Length of a straight leg [m], and how much a bend rises aside per length of arc; engineering choices."""
STIFFNESS = 1e4
"""Stiffness of a contact with the tube [N/m]; engineering choice: hard beside a colon."""
FRICTION = 0.1
"""Coulomb's coefficient of a tube with friction [1]; engineering choice: that of a bowel."""
PUSH_RATE, ROLL_RATE = 0.02, 0.5
"""Speeds of the hand [m/s, rad/s]; engineering choices."""
_EVERY, _REST, _TURN = 0.05, 2.0, 3.0
"""Time between two readings, rest before the handle is turned [s], and how far it is turned [rad]."""
_LEFT = 0.05
"""Tube that is left before a scope that is through [m]."""


@dataclass(frozen=True)
class Passage:
    """A scope pushed through a curved tube."""

    depth: Float[np.ndarray, " readings"]
    """Length inside [m]."""
    push: Float[np.ndarray, " readings"]
    """Force of the hand [N]."""


@dataclass(frozen=True)
class Turn:
    """A scope turned at its handle in a curved tube: means over the second half of the turn."""

    ratio: float
    """Angle that the tip turned by over the handle's [1]."""
    lag: float
    """How far the tip stays behind the handle [rad]."""
    torque: float
    """Torque of the hand [N m]."""
    wall_force: float
    """Sum of the wall's forces [N]."""


class TubeBench:
    """A scope in a tube bent by an angle [rad] at that friction."""

    def __init__(self, design: ScopeDesign, angle: float, *, friction: float = FRICTION) -> None:
        """Lay the scope before the tube."""
        self._colon = curved_tube(angle)
        options = find_preset("balanced").apply(law=TABLE)
        options = replace(options, friction=friction, wall_stiffness=STIFFNESS)
        self._scope = LinearSingle(build_scene(self._colon, None, design, options, show_lumen=False))
        self._steps = round(_EVERY / options.timestep)

    def push_through(self) -> Passage:
        """Push it through at a constant speed, until it is through or the hand is at the end of its force."""
        rows, length = [], self._colon.centreline.length
        for _ in range(round(2 * length / PUSH_RATE / _EVERY)):
            seen = self._after(Controls(PUSH_RATE, 0.0))
            rows.append((float(seen.insertion), float(seen.push_force)))
            if rows[-1][0] > length - _LEFT:
                break
        depth, push = np.array(rows).T
        return Passage(depth, push)

    def turn(self) -> Turn:
        """Let it come to rest, and turn the handle at a constant speed."""
        for _ in range(round(_REST / _EVERY)):
            self._after(Controls(0.0, 0.0))
        rows, before, turned = [], self._scope.read().tip_frame, 0.0
        for _ in range(round(_TURN / ROLL_RATE / _EVERY)):
            seen = self._after(Controls(0.0, ROLL_RATE))
            step = before.T @ seen.tip_frame
            turned += math.atan2(step[1, 0] - step[0, 1], step[0, 0] + step[1, 1])
            before = seen.tip_frame
            rows.append((float(seen.roll), turned, float(seen.torque), float(seen.wall_force_sum)))
        roll, tip, torque, wall = np.array(rows[len(rows) // 2 :]).T
        ratio = (tip[-1] - tip[0]) / (roll[-1] - roll[0])
        return Turn(float(ratio), float((roll - tip).mean()), float(torque.mean()), float(wall.mean()))

    def _after(self, hand: Controls) -> Any:
        self._scope.step(hand, self._steps)
        return self._scope.read()


def curved_tube(angle: float, *, radius: float = BEND_RADIUS, after: float = LEG) -> Colon:
    """A round tube: a straight leg along z, a bend by an angle [rad], which rises aside, and a leg `after` it [m]."""
    bend = radius * angle
    arc = np.linspace(0.0, LEG + bend + after, 900)
    turn = np.clip((arc - LEG) / radius, 0.0, angle)
    on = np.maximum(arc - LEG - bend, 0.0)
    x = radius * (1 - np.cos(turn)) + on * math.sin(angle)
    z = np.minimum(arc, LEG) + radius * np.sin(turn) + on * math.cos(angle)
    line = centreline_through(np.column_stack([x, RISE * radius * turn, z]), 0.002)
    bore = np.full((len(line.points), 48), BORE)
    return Colon(
        name=f"tube bent by {math.degrees(angle):.0f} degrees",
        lumen=tube(line.points, line.frames, bore),
        centreline=line,
        radius=bore,
        segments=(ColonSegment("rectum", 0.0, line.length),),
        provenance=Provenance(inputs={}, configuration={}),
    )


def bending_force(design: ScopeDesign, *, radius: float = BEND_RADIUS) -> float:
    """Force that pushes the shaft of a scope into a bend without friction, EI / (2 R^2) [N]."""
    return design.flexural_rigidity(design.shaft[0]) / (2 * radius**2)


def curved_figures(design: ScopeDesign) -> tuple[list[tuple[str, float, str, str]], dict[str, Any]]:
    """Insertion through a right angle and a loop, and torque through the loop: quantity, value, unit, theory."""
    bench = {mu: TubeBench(design, math.tau, friction=mu) for mu in (0.0, FRICTION)}
    loop = {mu: one.push_through() for mu, one in bench.items()}
    bend = {mu: TubeBench(design, math.pi / 2, friction=mu).push_through() for mu in (0.0, FRICTION)}
    smooth, rough = (bench[mu].turn() for mu in (0.0, FRICTION))
    room = BEND_RADIUS + BORE - design.diameter / 2
    theory = f"{bending_force(design, radius=room):.2f} to {bending_force(design):.2f}: EI / (2 R^2)"
    where = f"of {1e3 * BEND_RADIUS:.0f} mm radius"
    rows = [
        (f"insertion force, 90 degrees {where}, no friction", float(bend[0.0].push.max()), "N", theory),
        (f"insertion force, 90 degrees {where}, friction {FRICTION:g}", float(bend[FRICTION].push.max()), "N", ""),
        (f"insertion force, a loop {where}, friction {FRICTION:g}", float(loop[FRICTION].push.max()), "N", ""),
        ("turn of the tip over that of the handle, through the loop", rough.ratio, "1", "1"),
        ("lag of the tip behind the handle, through the loop", math.degrees(rough.lag), "degrees", ""),
        (
            "torque that the loop's friction takes from the handle",
            1e3 * (rough.torque - smooth.torque),
            "mN m",
            f"{1e3 * FRICTION * design.diameter / 2 * rough.wall_force:.1f}: friction times wall force",
        ),
        (f"torque that damping takes at {ROLL_RATE:g} rad/s, no friction", 1e3 * smooth.torque, "mN m", ""),
    ]
    return rows, {"depth_m": loop[FRICTION].depth.tolist(), "push_N": loop[FRICTION].push.tolist()}
