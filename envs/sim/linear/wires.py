"""Wires as springs that wheels steer, in programs: exact in a step's end, by the factors that the step has anyway.

A pair of opposite wires pulls with N = T - T' on the joints of the bending section, by arms a that differ in sign only.
A step solves A x = tau - sum_j a_j N_j for accelerations x, so that x = x0 - sum_j N_j A^-1 a_j, and the stretch of
wire j at its end, u_j + a_j (q + h v + h^2 x), falls by h^2 a_j A^-1 a_k for each newton of N_k. That is all that the
wires' law needs (`haustra.envs.sim.physics.wires.sprung_pulls`). Two more right sides, a_j, go inwards with the first.
Of the recursion's factors A = L^T D L they leave y_j = L^-T a_j, and a_j A^-1 a_k = y_j D^-1 y_k: no way back outwards.
"""

from inspect import unwrap
from typing import Any

from haustra.envs.sim.linear.layout import WIRE_ROOM
from haustra.envs.sim.linear.trace import Changing, Value
from haustra.envs.sim.physics.wires import sprung_pulls
from haustra.models.devices.scope.wires import WIRE_NAMES, passed_part
from haustra.models.wall.vectors import Vector, add, cross, dot, times

_sprung_pulls = unwrap(sprung_pulls)
_PAIRS = WIRE_NAMES[:2]
"""The first wire of each pair; the other's arms and travel are the opposite."""


class SprungWires:
    """The wires of each world's scope."""

    def __init__(self, scopes: Any) -> None:
        """Those of a `haustra.envs.sim.linear.program.ScopeProgram`, which has them."""
        self._scopes = scopes
        self._felt = [Changing(scopes.program, [0.0] * 6) for _ in _PAIRS]
        """Torque and force that a newton of each pair is felt by at the link that the recursion has come to."""
        self._sums = Changing(scopes.program, [0.0] * 9)
        """Stretch of each pair by angles, by speeds, by what else accelerates; then h^-2 times stretch per newton, of
        the first itself, of each by the other, of the second itself."""
        self._nets = Changing(scopes.program, [0.0] * 2)
        """Pull of each pair in this step [N]."""
        self._ends = Changing(scopes.program, [0.0] * 4)

    @property
    def ends(self) -> tuple[Value, ...]:
        """Pull of each wire at the step's end [N]."""
        return self._ends.now

    def asked(self) -> Value:
        """Whether wheels have taken up what is a number."""
        first, second = (self._scopes.program.xp.isfinite(self._scopes.world(name)) for name in _PAIRS)
        return first & second

    def begin(self) -> None:
        """Before the recursion."""
        for felt in self._felt:
            felt.now = [0.0] * 6
        self._sums.now = [0.0] * 9

    def free(self, dof: Value, driven: Value, inverse: Value, gives: tuple[Vector, Vector], slides: int) -> None:
        """Let a joint give way to what wires pull.

        Args:
            dof: the joint.
            driven: what drives it, without wires.
            inverse: 1 / D.
            gives: U / D.
            slides: whether it is a slide.
        """
        scopes = self._scopes
        angle, speed = scopes.now.load(dof), scopes.now.load(scopes.layout.speeds + dof)
        direction = scopes.joints.vector(dof, 7)
        arms, lifted = [scopes.joint(dof, name) for name in _PAIRS], []
        for side, (arm, felt) in enumerate(zip(arms, self._felt, strict=True)):
            torque, force = felt.now[:3], felt.now[3:]
            own = arm - dot(direction, force if slides else torque)
            felt.now = (*add(torque, times(own, gives[0])), *add(force, times(own, gives[1])))
            scopes.room.store(self._slot(dof) + side, own * inverse)
            lifted.append(own)
        first, second = (own * inverse for own in lifted)
        give = first * lifted[0], first * lifted[1], second * lifted[1]
        added = *(arm * angle for arm in arms), *(arm * speed for arm in arms), first * driven, second * driven, *give
        self._sums.now = [total + more for total, more in zip(self._sums.now, added, strict=True)]

    def shift(self, offset: Vector) -> None:
        """To the link before."""
        for felt in self._felt:
            torque, force = felt.now[:3], felt.now[3:]
            felt.now = (*add(torque, cross(offset, force)), *force)

    def pull(self) -> None:
        """After the recursion: find what the wires pull with at the step's end."""
        scopes, h = self._scopes, self._scopes.h
        xp, state, first = scopes.program.xp, scopes.state, scopes.layout.pulls
        sums = self._sums.now
        taken: Any = [scopes.world(name) + bent for name, bent in zip(_PAIRS, sums[:2], strict=True)]
        losses = {"friction": scopes.scope("wire_friction"), "hysteresis": scopes.scope("wire_hysteresis")}
        wires = {"slack": scopes.scope("wire_slack"), "compliance": scopes.scope("wire_compliance")}
        wires |= {"limit": scopes.scope("pull_limit")}
        wires |= {"part": passed_part(xp, **losses, sheath_angle=scopes.sheath_angle())}
        # Wheels move before the step, which the bending section gives way in.
        before = [state.load(first + wire) for wire in range(4)]
        before = _sprung_pulls(xp, before, taken, (0.0, 0.0, 0.0), **wires, rounds=0)
        ends: Any = [s + h * (v + h * a) for s, v, a in zip(taken, sums[2:4], sums[4:6], strict=True)]
        give: Any = [h * h * each for each in sums[6:]]
        pulls = _sprung_pulls(xp, before, ends, give, **wires)
        self._ends.now = pulls
        self._nets.now = pulls[0] - pulls[2], pulls[1] - pulls[3]

    def bends(self, dof: Value) -> Value:
        """By how much the wires slow a joint [rad/s^2], or m/s^2."""
        net, slot = self._nets.now, self._slot(dof)
        return net[0] * self._scopes.room.load(slot) + net[1] * self._scopes.room.load(slot + 1)

    def _slot(self, dof: Any) -> Any:
        return self._scopes.layout.wire_room + dof * WIRE_ROOM
