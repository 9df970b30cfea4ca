"""MuJoCo's contact problem on devices, solved by Newton's method at a cost that is linear in links and contacts.

MuJoCo finds the acceleration a that makes 1/2 (a - a0)' M (a - a0) + sum s(J a - a_ref) least, where s is the cost of
a joint's stop or of a contact's elliptic cone (https://mujoco.readthedocs.io/en/stable/computation). Its solvers take
J as a matrix. A contact with what stands still acts on one link, however, so a step of Newton's method, whose matrix is
M + J' s'' J, is the motion of the same links with heavier inertias, and Featherstone's articulated bodies (2008,
chapter 7) solve that link by link. M, J and parameters are MuJoCo's own, and so is the least that is found.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from haustra.models.wall.vectors import add, cross, dot, minus, times

_LIMIT, _SMOOTH_CONTACT, _CONTACT = (
    int(kind)
    for kind in (
        mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT,
        mujoco.mjtConstraint.mjCNSTR_CONTACT_FRICTIONLESS,
        mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC,
    )
)
_STAGES = (
    mujoco.mj_kinematics,
    mujoco.mj_comPos,
    mujoco.mj_tendon,
    mujoco.mj_makeM,
    mujoco.mj_collision,
    mujoco.mj_makeConstraint,
    mujoco.mj_transmission,
    mujoco.mj_fwdVelocity,
    mujoco.mj_fwdActuation,
)
"""What comes before the constraints in a step, but for cameras, flexes and M's factors."""
_LINE = 0.03
"""Share of a line's first slope at which it has been searched well enough."""
_TRIES = 20
"""Points of a line that are tried at most."""


class Tree(NamedTuple):
    """Links that move, as compiled loops want them."""

    bodies: Any
    """Bodies that move, parents first."""
    parent: Any
    root: Any
    first: Any
    """First dof of each body."""
    dofs: Any
    """How many each has."""
    armature: Any
    dof_of_joint: Any
    """First dof of slides and hinges; -1 for other joints."""
    body_of_geom: Any
    """-1 where it stands still."""

    @classmethod
    def of(cls, model: mujoco.MjModel) -> "Tree":
        """Read a compiled model."""
        return cls(
            np.flatnonzero(model.body_treeid >= 0),
            model.body_parentid,
            model.body_rootid,
            model.body_dofadr,
            model.body_dofnum,
            model.dof_armature,
            np.where(model.jnt_type >= int(mujoco.mjtJoint.mjJNT_SLIDE), model.jnt_dofadr, -1),
            np.where(model.body_treeid[model.geom_bodyid] >= 0, model.geom_bodyid, -1),
        )


class Rows(NamedTuple):
    """Constraints of one instant, as MuJoCo made them."""

    kind: Any
    number: Any
    """Number of the joint or contact that a row is of."""
    stiffness: Any
    """D of each row."""
    aim: Any
    """a_ref of each row."""
    jacobian: Any
    geoms: Any
    places: Any
    frames: Any
    dims: Any
    mu: Any
    friction: Any


def step(model: mujoco.MjModel, data: mujoco.MjData, tree: Tree, solve: Callable[..., int]) -> None:
    """Do what `mj_step` does for a model with an implicit integrator, without sensors and callbacks.

    Args:
        model: with a dense Jacobian.
        data: of the model.
        tree: the model's links.
        solve: `solve`, compiled.
    """
    for stage in _STAGES:
        stage(model, data)
    data.qfrc_smooth[:] = data.qfrc_passive - data.qfrc_bias + data.qfrc_actuator + data.qfrc_applied
    if data.xfrc_applied.any() or not _constrain(model, data, tree, solve):
        mujoco.mj_factorM(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
    mujoco.mj_implicit(model, data)


def _constrain(model: mujoco.MjModel, data: mujoco.MjData, tree: Tree, solve: Callable[..., int]) -> bool:
    """Do what `mj_fwdConstraint` does; False where constraints are of a kind that is not known here."""
    contact = data.contact
    of_contacts = contact.geom, contact.pos, contact.frame, contact.dim, contact.mu, contact.friction
    rows = Rows(
        data.efc_type,
        data.efc_id,
        data.efc_D,
        data.efc_aref,
        data.efc_J,
        *map(np.ascontiguousarray, of_contacts),  # a single contact's are, and numba would compile once more
    )
    data.qacc[:] = data.qacc_warmstart
    done = solve(
        tree,
        rows,
        data.subtree_com,
        data.cdof,
        data.cinert,
        data.qfrc_smooth,
        model.opt.tolerance * model.stat.meaninertia * model.nv,
        model.opt.iterations,
        data.qacc,
        data.qfrc_constraint,
        data.efc_force,
    )
    if done < 0:
        return False
    data.qacc_warmstart[:] = data.qacc
    return True


def times_inertia(c: Any, v: Any, b: int) -> Any:
    """MuJoCo's ten numbers of a body's inertia times its spatial velocity."""
    r, w, u = (c[b, 6], c[b, 7], c[b, 8]), (v[b, 0], v[b, 1], v[b, 2]), (v[b, 3], v[b, 4], v[b, 5])
    turned = (
        c[b, 0] * w[0] + c[b, 3] * w[1] + c[b, 4] * w[2],
        c[b, 3] * w[0] + c[b, 1] * w[1] + c[b, 5] * w[2],
        c[b, 4] * w[0] + c[b, 5] * w[1] + c[b, 2] * w[2],
    )
    return add(turned, cross(r, u)), add(times(c[b, 9], u), cross(w, r))


def put_inertia(c: Any, whole: Any, b: int) -> None:
    """MuJoCo's ten numbers of a body's inertia as a matrix."""
    for i in range(3):
        for k in range(3):
            whole[b, i, k + 3] = whole[b, i + 3, k] = whole[b, i + 3, k + 3] = 0.0
        whole[b, i, i], whole[b, i + 3, i + 3] = c[b, i], c[b, 9]
    whole[b, 0, 1] = whole[b, 1, 0] = c[b, 3]
    whole[b, 0, 2] = whole[b, 2, 0] = c[b, 4]
    whole[b, 1, 2] = whole[b, 2, 1] = c[b, 5]
    whole[b, 0, 4] = whole[b, 4, 0] = -c[b, 8]
    whole[b, 0, 5] = whole[b, 5, 0] = c[b, 7]
    whole[b, 1, 3] = whole[b, 3, 1] = c[b, 8]
    whole[b, 1, 5] = whole[b, 5, 1] = -c[b, 6]
    whole[b, 2, 3] = whole[b, 3, 2] = -c[b, 7]
    whole[b, 2, 4] = whole[b, 4, 2] = c[b, 6]


def cone(d0: Any, d1: Any, d2: Any, mu: Any, f1: Any, f2: Any, r0: Any, r1: Any, r2: Any) -> Any:
    """Forces of an elliptic cone whose rows are off by r, and their derivatives (00, 01, 02, 11, 12, 22), negated."""
    n, u1, u2 = r0 * mu, r1 * f1, r2 * f2
    t = np.sqrt(u1 * u1 + u2 * u2)
    if n >= mu * t:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if mu * n + t <= 0:
        return (-d0 * r0, -d1 * r1, -d2 * r2), (d0, 0.0, 0.0, d1, 0.0, d2)
    stiff = d0 / (mu * mu * (1 + mu * mu))
    over = n - mu * t
    e1, e2 = u1 / t, u2 / t
    bent = -mu * over / t
    forces = -stiff * over * mu, stiff * over * mu * e1 * f1, stiff * over * mu * e2 * f2
    h11 = bent * e2 * e2 + mu * mu * e1 * e1
    h12 = (mu * mu - bent) * e1 * e2
    h22 = bent * e1 * e1 + mu * mu * e2 * e2
    return forces, (
        stiff * mu * mu,
        -stiff * mu * mu * e1 * f1,
        -stiff * mu * mu * e2 * f2,
        stiff * h11 * f1 * f1,
        stiff * h12 * f1 * f2,
        stiff * h22 * f2 * f2,
    )


def _three(values: Any, row: int, at: int) -> Any:
    return values[row, at], values[row, at + 1], values[row, at + 2]


def _put_six(values: Any, row: int, turning: Any, moving: Any) -> None:
    values[row, 0], values[row, 1], values[row, 2] = turning
    values[row, 3], values[row, 4], values[row, 5] = moving


def _dot_six(a: Any, i: int, b: Any, k: int) -> Any:
    return dot(_three(a, i, 0), _three(b, k, 0)) + dot(_three(a, i, 3), _three(b, k, 3))


def _rates(arms: Any, body: int, row: int, size: int, motion: Any, dofs: Any, rate: Any) -> None:
    """Rows of J times a motion of the bodies and dofs."""
    if body < 0:
        rate[row] = arms[row, 0] * dofs[-1 - body]
        return
    for r in range(row, row + size):
        rate[r] = _dot_six(arms, r, motion, body)


def _pushed(rows: Any, row: int, size: int, r0: Any, r1: Any, r2: Any) -> Any:
    """Forces of a constraint whose rows are off by r, and their derivatives, as `cone` gives them."""
    if size == 3:
        d, number = rows.stiffness, rows.number[row]
        rough = rows.mu[number], rows.friction[number, 0], rows.friction[number, 1]
        return cone(d[row], d[row + 1], d[row + 2], *rough, r0, r1, r2)
    if r0 >= 0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return (-rows.stiffness[row] * r0, 0.0, 0.0), (rows.stiffness[row], 0.0, 0.0, 0.0, 0.0, 0.0)


def _press(arms: Any, row: int, size: int, f: Any, h: Any, bias: Any, whole: Any, b: int) -> None:
    """Add a contact's forces and their derivatives to those on its body."""
    if size == 1:
        for i in range(6):
            bias[b, i] -= f[0] * arms[row, i]
            for k in range(6):
                whole[b, i, k] += h[0] * arms[row, i] * arms[row, k]
        return
    for i in range(6):
        x, y, z = arms[row, i], arms[row + 1, i], arms[row + 2, i]
        bias[b, i] -= f[0] * x + f[1] * y + f[2] * z
        p = h[0] * x + h[1] * y + h[2] * z
        q = h[1] * x + h[3] * y + h[4] * z
        s = h[2] * x + h[4] * y + h[5] * z
        for k in range(6):
            whole[b, i, k] += p * arms[row, k] + q * arms[row + 1, k] + s * arms[row + 2, k]


def _let_go(axes: Any, columns: Any, whole: Any, bias: Any, drive: Any, b: int, i: int, pivot: float) -> float:
    """Let a body's inertia and forces be those that are felt before its dof i, whose own inertia comes back."""
    for k in range(6):  # the matrix is symmetric; by its rows, six sums go on at a time
        columns[i, k] = whole[b, 0, k] * axes[i, 0]
    for j in range(1, 6):
        for k in range(6):
            columns[i, k] += whole[b, j, k] * axes[i, j]
    pivot += _dot_six(axes, i, columns, i)
    drive[i] -= _dot_six(axes, i, bias, b)
    push = drive[i] / pivot
    for k in range(6):
        bias[b, k] += columns[i, k] * push
        part = columns[i, k] / pivot
        for j in range(6):
            whole[b, k, j] -= part * columns[i, j]
    return pivot


def _line(rows: Any, row: int, size: int, off: Any, rate: Any, share: Any, slope: Any, bend: Any) -> Any:
    """Slope and curvature of the cost along a step, with those of a constraint added."""
    second, third = row + size // 2, row + size - 1
    v0, v1, v2 = rate[row], rate[second], rate[third]
    f, h = _pushed(rows, row, size, off[row] + share * v0, off[second] + share * v1, off[third] + share * v2)
    across = 2 * (h[1] * v0 * v1 + h[2] * v0 * v2 + h[4] * v1 * v2)
    bend += h[0] * v0 * v0 + h[3] * v1 * v1 + h[5] * v2 * v2 + across
    return slope - (f[0] * v0 + f[1] * v1 + f[2] * v2), bend


PARTS = (times_inertia, put_inertia, cone, _three, _put_six, _dot_six, _rates, _pushed, _press, _let_go, _line)
"""What numba is to compile."""


def solve(
    tree: Any,
    rows: Any,
    centres: Any,
    axes: Any,
    inertias: Any,
    smooth: Any,
    tolerance: float,
    iterations: int,
    qacc: Any,
    total: Any,
    force: Any,
) -> int:
    """Find the acceleration; returns Newton's steps, or -1 where constraints are of a kind that is not known here.

    Args:
        tree: the links.
        rows: the constraints.
        centres: of the trees' masses, about which axes and inertias are given [m].
        axes: of the dofs, as spatial velocities.
        inertias: of the bodies, ten numbers each.
        smooth: generalised forces of all but the constraints.
        tolerance: of the cost that is made least: less gain than this in a step ends the search.
        iterations: Newton's steps at most.
        qacc: where to begin, and then the acceleration.
        total: generalised forces of the constraints.
        force: of each row.
    """
    count, joints, bodies = len(rows.kind), len(qacc), len(tree.parent)
    if len(rows.jacobian) != count * joints:
        return -1
    # Constraints: one row on one dof, or one or three rows on one body.
    body, starts, sizes = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    arms, found, row = np.zeros((count, 6)), 0, 0
    while row < count:
        kind, number = rows.kind[row], rows.number[row]
        starts[found], sizes[found] = row, 1
        if kind == _LIMIT:
            dof = tree.dof_of_joint[number]
            if dof < 0:
                return -1
            body[found], arms[row, 0] = -1 - dof, rows.jacobian[row * joints + dof]
        elif kind == _SMOOTH_CONTACT or (kind == _CONTACT and rows.dims[number] == 3):
            one, other = tree.body_of_geom[rows.geoms[number, 0]], tree.body_of_geom[rows.geoms[number, 1]]
            if (one < 0) == (other < 0):
                return -1
            body[found], sizes[found] = max(one, other), rows.dims[number]
            side = 1.0 if one < 0 else -1.0
            lever = minus(_three(rows.places, number, 0), _three(centres, tree.root[body[found]], 0))
            for axis in range(sizes[found]):
                way = times(side, _three(rows.frames, number, 3 * axis))
                _put_six(arms, row + axis, cross(lever, way), way)
        else:
            return -1
        row += sizes[found]
        found += 1
    moving, going = np.zeros((bodies, 6)), np.zeros((bodies, 6))
    whole, bias = np.empty((bodies, 6, 6)), np.empty((bodies, 6))
    off, rate, stops = np.empty(count), np.empty(count), np.empty(joints)
    step, drive, pivot, columns = np.empty(joints), np.empty(joints), np.empty(joints), np.empty((joints, 6))
    for b in tree.bodies:
        moving[b] = moving[tree.parent[b]]
        for i in range(tree.first[b], tree.first[b] + tree.dofs[b]):
            for k in range(6):
                moving[b, k] += axes[i, k] * qacc[i]
    for c in range(found):
        _rates(arms, body[c], starts[c], sizes[c], moving, qacc, off)
    for r in range(count):
        off[r] -= rows.aim[r]
    steps, last = 0, False
    while True:
        # Forces, their sum on each link, and how they change with its motion.
        stops[:], total[:] = 0.0, 0.0
        for b in tree.bodies:
            put_inertia(inertias, whole, b)
            _put_six(bias, b, *times_inertia(inertias, moving, b))
        for c in range(found):
            row, b = starts[c], body[c]
            f, h = _pushed(rows, row, sizes[c], off[row], off[row + sizes[c] // 2], off[row + sizes[c] - 1])
            for axis in range(sizes[c]):
                force[row + axis] = f[axis]
            if b < 0:
                stops[-1 - b] += h[0]
                total[-1 - b] += arms[row, 0] * f[0]
            elif h[0] > 0:
                _press(arms, row, sizes[c], f, h, bias, whole, b)
        if last:
            break
        # Newton's step: articulated bodies that are moved by what is out of balance.
        for n in range(len(tree.bodies) - 1, -1, -1):
            b = tree.bodies[n]
            for i in range(tree.first[b] + tree.dofs[b] - 1, tree.first[b] - 1, -1):
                drive[i] = smooth[i] + total[i] - tree.armature[i] * qacc[i]
                pivot[i] = _let_go(axes, columns, whole, bias, drive, b, i, tree.armature[i] + stops[i])
            up = tree.parent[b]
            if up > 0:
                for k in range(6):
                    bias[up, k] += bias[b, k]
                    for j in range(6):
                        whole[up, k, j] += whole[b, k, j]
        for b in tree.bodies:
            going[b] = going[tree.parent[b]]
            for i in range(tree.first[b], tree.first[b] + tree.dofs[b]):
                step[i] = (drive[i] - _dot_six(columns, i, going, b)) / pivot[i]
                for k in range(6):
                    going[b, k] += axes[i, k] * step[i]
        # Along the step: slope and curvature of the cost of free motion, then with the rows'.
        slope, bend = 0.0, 0.0
        for b in tree.bodies:
            turning, pushing = times_inertia(inertias, going, b)
            slope += dot(turning, _three(moving, b, 0)) + dot(pushing, _three(moving, b, 3))
            bend += dot(turning, _three(going, b, 0)) + dot(pushing, _three(going, b, 3))
        for i in range(joints):
            slope += step[i] * (tree.armature[i] * qacc[i] - smooth[i])
            bend += step[i] * step[i] * tree.armature[i]
        for c in range(found):
            _rates(arms, body[c], starts[c], sizes[c], going, step, rate)
        share, low, high, first = 1.0, 0.0, np.inf, 0.0
        for i in range(joints):
            first -= drive[i] * drive[i] / pivot[i]
        for _ in range(_TRIES):
            here, change = slope + share * bend, bend
            for c in range(found):
                here, change = _line(rows, starts[c], sizes[c], off, rate, share, here, change)
            if abs(here) <= -_LINE * first:
                break
            low, high = (share, high) if here < 0 else (low, share)
            share -= here / change
            if not low < share < high:
                share = 0.5 * (low + high) if high < np.inf else 2.0 * low
        for i in range(joints):
            qacc[i] += share * step[i]
        for b in tree.bodies:
            for k in range(6):
                moving[b, k] += share * going[b, k]
        for r in range(count):
            off[r] += share * rate[r]
        steps += 1
        last = not -first > 2 * tolerance or steps >= iterations
    # What the rows' forces come to at the dofs.
    for b in tree.bodies:
        bias[b] = 0.0
    for c in range(found):
        if body[c] >= 0:
            for r in range(starts[c], starts[c] + sizes[c]):
                for k in range(6):
                    bias[body[c], k] += force[r] * arms[r, k]
    for n in range(len(tree.bodies) - 1, -1, -1):
        b = tree.bodies[n]
        for i in range(tree.first[b], tree.first[b] + tree.dofs[b]):
            total[i] += _dot_six(axes, i, bias, b)
        if tree.parent[b] > 0:
            bias[tree.parent[b]] += bias[b]
    return steps
