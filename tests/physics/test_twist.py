"""Twist: transmission, whip in a bent tube, and the torques at which straight and ring-shaped rods buckle.

Sources: Greenhill, Proc. Inst. Mech. Eng. 34 (1883) 182 (a straight rod clamped at both ends buckles at a torque of
8.987 EI/L); Michell 1889 and Zajac, J. Appl. Mech. 29 (1962) 136 (a ring at a twist of 2 pi sqrt(3) EI/GJ); whip of a
pre-curved rod in a bent tube: Dupont et al., IEEE T-RO 26 (2010) 209 (snaps when L^2 k k0 EI/GJ > (pi/2)^2).
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.linalg import null_space
from scipy.optimize import brentq

from haustra.models.devices.scope.cable import add_scope
from haustra.models.devices.scope.cells import cut_into_cells
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.scope.rods import UniformRod, hinge_rod
from haustra.scripts.bench.reference.chain import Load, SerialChain
from haustra.scripts.bench.reference.newton import find_equilibrium

EI, GJ, LENGTH, ZERO = 0.03, 0.39, 0.5, np.zeros(3)
ROD = UniformRod(length=LENGTH, radius=0.0064, flexural_rigidity=EI, torsional_rigidity=GJ, mass_per_length=0.3)


class ClampedBothEnds:
    """A chain whose tip is held in place and direction by a force and a moment."""

    def __init__(self, joints: int) -> None:
        built = hinge_rod(ROD, joints)
        self.model = built.spec.compile()
        self.data = mujoco.MjData(self.model)
        self.chain = SerialChain(self.model)
        self.body, self.place = self.model.body(built.tip[0]).id, np.array(built.tip[1])

    def tip(self):
        frame = self.data.xmat[self.body].reshape(3, 3)
        return self.data.xpos[self.body] + frame @ self.place, frame

    def tangent(self, force, moment):
        """Force out of balance, its derivative, and the tip's Jacobian (6 rows)."""
        value, slope = self.chain.forces(self.data, [Load(self.body, self.place, force, moment)], ZERO)
        _, torque, stiffness = self.chain.springs(self.data.qpos)
        out = torque - value
        moving = self.chain.jacobian(self.data, np.array([self.body]), self.tip()[0][None])[0].T
        turning = np.where(self.chain.hinge, self.data.xaxis.T, 0.0)
        return out, np.diag(stiffness) - slope, np.vstack([moving, turning])

    def hold(self, qpos, goal, frame, holding):
        """Newton's method on angles and holding wrench together, until the tip is at its goal."""
        for _ in range(60):
            self.chain.place(self.data, qpos)
            out, tangent, rows = self.tangent(holding[:3], holding[3:])
            place, now = self.tip()
            error = frame @ now.T
            turn = 0.5 * np.array([error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]])
            miss = np.concatenate([goal - place, turn])
            if max(np.abs(out).max(), np.abs(miss).max()) < 1e-10:
                return qpos, holding
            system = np.block([[tangent, -rows.T], [rows, np.zeros((6, 6))]])
            step = np.linalg.solve(system, np.concatenate([-out, miss]))
            part = min(1.0, 0.3 / np.abs(step[: len(qpos)]).max())
            qpos, holding = qpos + part * step[: len(qpos)], holding + part * step[len(qpos) :]
        raise AssertionError("the tip cannot be held there")

    def stiffnesses(self, qpos, holding, rows: Sequence[int] = range(6)):
        """Stiffnesses of motions that leave the tip where it is, softest first; negative: unstable."""
        self.chain.place(self.data, qpos)
        _, tangent, all_rows = self.tangent(holding[:3], holding[3:])
        free = null_space(all_rows[rows])
        reduced = free.T @ tangent @ free
        return np.linalg.eigvalsh((reduced + reduced.T) / 2)


def test_greenhill_torque_of_a_straight_clamped_rod(compare):
    rod = ClampedBothEnds(40)
    straight = np.zeros(rod.model.nq)
    across = [0, 1, 3, 4]  # the tip may slide and turn along the axis only

    def softest(torque):
        return rod.stiffnesses(straight, np.array([0, 0, 0, 0, 0, torque]), across)[0]

    critical = brentq(softest, 0.5 * 8.987 * EI / LENGTH, 1.5 * 8.987 * EI / LENGTH, xtol=1e-6)
    compare("Greenhill torque, clamped ends, 40 joints [N m]", critical, 8.987 * EI / LENGTH, within=0.03)


def test_michell_twist_of_a_ring(compare):
    """The stiffness of the ring against leaving its plane falls to nothing as the twist grows.

    One softer motion is left out: the ring turning as a whole about its clamp. Extrapolated from below, since near the
    critical twist the polygon, which is no perfect ring, starts to leave its plane early.
    """
    joints = 80
    rod = ClampedBothEnds(joints)
    qpos = 2 * np.pi / joints * rod.model.jnt_axis[:, 1]  # a ring about y
    holding = np.array([0, 0, 0, 0, 2 * np.pi * EI / LENGTH, 0])
    critical = 2 * np.pi * np.sqrt(3) * EI / GJ
    twists = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.9]) * critical
    stiffness = []
    for twist in twists:
        frame = np.array([[np.cos(twist), -np.sin(twist), 0], [np.sin(twist), np.cos(twist), 0], [0, 0, 1]])
        qpos, holding = rod.hold(qpos, ZERO, frame, holding)
        stiffness.append(rod.stiffnesses(qpos, holding)[1])
    slope = (stiffness[-1] - stiffness[-2]) / (twists[-1] - twists[-2])
    compare("Michell twist of a ring, 80 joints [rad]", twists[-1] - stiffness[-1] / slope, critical, within=0.03)


@pytest.mark.parametrize("hinges", [2, 4, 9])
def test_a_torque_twists_the_scope_by_tl_over_gj(hinges, compare):
    """Few twist hinges carry the compliance of the whole length, sections of different stiffness included."""
    design = named_design("adult")
    cells = cut_into_cells(design, shaft_cell=0.04, bending_cell=0.0125)
    spec = mujoco.MjSpec()
    add_scope(
        spec,
        design,
        cells,
        entry=ZERO,
        frame=np.eye(3),
        inserted=design.length,
        twist_hinges=hinges,
        push_limit=1.0,
        torque_limit=1.0,
        timestep=0.004,
    )
    model = spec.compile()
    twists = [joint for joint in range(model.njnt) if "twist" in model.joint(joint).name]
    assert len(twists) == hinges
    compliance = sum(section.length / section.torsional_rigidity for section in (*design.shaft, design.bending))
    found = (1 / model.jnt_stiffness[twists]).sum()
    compare(f"twist per torque of the adult scope, {hinges} twist hinges [rad/N m]", found, compliance, within=0.01)


def in_bent_tube(curvature: float, bias: float, handle: float, joints: int = 12):
    """Twist and lowest stiffness of a rod with natural curvature `bias` held along an arc, its base turned by `handle`.

    A frictionless tight tube is a stiff spring from every joint to the arc; the base is turned by turning the natural
    curvature and reading the tip relative to it.
    """
    model, data, chain, names = _tube_rod(joints)
    cell = LENGTH / joints
    chain.rest = model.jnt_axis[:, :2] @ (bias * cell * np.array([-np.sin(handle), np.cos(handle)]))
    chain.cubic[:] = 0.0  # as in pre-curved sections
    stations = (np.arange(joints) + 0.5) * cell
    # Links touch the arc at their middles, so that joints lie on a slightly wider one; the ends touch it themselves.
    wide = np.array([*np.full(joints - 1, 1 / np.cos(curvature * cell / 2)), 1.0]) / curvature
    turned = curvature * np.array([*stations[1:], LENGTH])
    arc = np.stack([1 / curvature - wide * np.cos(turned), 0 * turned, wide * np.sin(turned)], axis=1)
    bodies = np.arange(model.nbody - joints, model.nbody)
    places = np.array([*([0, 0, cell] for _ in stations[1:]), [0, 0, cell / 2]])
    wall = 2e5

    def evaluate(qpos):
        chain.place(data, qpos)
        points = data.xpos[bodies] + np.einsum("bij,bj->bi", data.xmat[bodies].reshape(-1, 3, 3), places)
        pushed = wall * (arc - points)
        loads = [Load(int(b), p, f, ZERO) for b, p, f in zip(bodies, places, pushed, strict=True)]
        value, slope = chain.forces(data, loads, ZERO)
        moving = chain.jacobian(data, bodies, points)
        stiffening = wall * np.einsum("bqi,bri->qr", moving, moving)
        _, torque, stiffness = chain.springs(qpos)
        return torque - value, np.diag(stiffness) - slope + stiffening

    start = curvature * cell * model.jnt_axis[:, 1]
    found = find_equilibrium(evaluate, start, scale=float(chain.stiffness.max()), most_iterations=300)
    tangent = evaluate(found.qpos)[1]
    twist = sum(found.qpos[n] for n, name in enumerate(names) if "twist" in name)
    return twist, np.linalg.eigvalsh((tangent + tangent.T) / 2)[0]


def _tube_rod(joints: int):
    model = hinge_rod(ROD, joints).spec.compile()
    chain = SerialChain(model)
    return model, mujoco.MjData(model), chain, [model.joint(joint).name for joint in range(model.njnt)]


def lag_by_theory(handle: float, rate: float) -> float:
    """Twist at the free end: GJ t'' = EI k k0 sin(t), t(0) = handle, t'(L) = 0; t = 0 in the tube's plane."""
    places = np.linspace(0, LENGTH, 50)
    solution = solve_bvp(
        lambda s, y: np.array([y[1], rate * np.sin(y[0])]),
        lambda base, end: np.array([base[0] - handle, end[1]]),
        places,
        np.array([np.full(50, handle), np.zeros(50)]),
    )
    return solution.y[0, -1] - handle


@pytest.mark.parametrize("handle", [0.6, 1.2, 2.4])
def test_a_pre_curved_rod_lags_in_a_bent_tube_as_theory_says(handle, compare):
    curvature, bias = 4.0, 4.0
    lag = lag_by_theory(handle, EI * curvature * bias / GJ)
    assert abs(lag) > 0.05
    found = in_bent_tube(curvature, bias, handle)[0]
    compare(f"whip: lag of the tip at a handle angle of {handle} rad, 12 joints [rad]", found, lag, within=0.01)


def test_whip_snaps_where_theory_says(compare):
    """With the handle half a turn away the rod can stay at the maximum of energy while L^2 k k0 EI/GJ < (pi/2)^2.

    Extrapolated from below: a chain of joints is no perfect rod, and leaves the maximum early to one side.
    """
    curvature, below = 4.0, np.array([0.8, 0.9])
    critical = (np.pi / 2 / LENGTH) ** 2 * GJ / EI / curvature
    softest = [in_bent_tube(curvature, part * critical, np.pi)[1] for part in below]
    assert softest[0] > softest[1] > 0
    onset = below[1] + (below[1] - below[0]) * softest[1] / (softest[0] - softest[1])
    compare("whip: natural curvature at which the rod snaps, 12 joints, over theory", onset, 1.0, within=0.03)
