"""Large deflections, roll-up, buckling and post-buckling of a clamped rod against the elastica.

Sources: dead tip load: Bisshopp and Drucker, Q. Appl. Math. 3 (1945) 272; buckling: Euler 1744, the clamped-free column
being half of a pinned one; post-buckling: Timoshenko and Gere, Theory of Elastic Stability, 2.7. Reference values were
computed from the elliptic integrals to 1e-9.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest

from haustra.models.devices.scope.rods import UniformRod, hinge_rod
from haustra.scripts.bench.reference.chain import Load, SerialChain
from haustra.scripts.bench.reference.descent import find_minimum
from haustra.scripts.bench.reference.rod import static_shape

EI, LENGTH, ZERO = 0.03, 0.5, np.zeros(3)
ROD = UniformRod(length=LENGTH, radius=0.0064, flexural_rigidity=EI, torsional_rigidity=13 * EI, mass_per_length=0.3)


def bent(joints: int, *, force: Sequence[float] | np.ndarray = ZERO, moment: np.ndarray = ZERO, start=None, cubic=True):
    """Tip position [m] and frame of a rod under a dead tip load, and its joint angles."""
    built = hinge_rod(ROD, joints, cubic=cubic)
    model = built.spec.compile()
    data = mujoco.MjData(model)
    name, place = built.tip
    body = model.body(name).id
    load = Load(body, np.array(place), np.array(force), np.array(moment))
    found = static_shape(model, data, loads=[load], start=start)
    frame = data.xmat[body].reshape(3, 3)
    return data.xpos[body] + frame @ place, frame, found.qpos


@pytest.mark.parametrize(
    ("load", "angle", "across", "along"),
    [
        (1, 26.4335, 0.30172, 0.05643),
        (2, 44.7910, 0.49346, 0.16064),
        (5, 69.6355, 0.71379, 0.38763),
        (10, 81.9493, 0.81061, 0.55500),
    ],
)
@pytest.mark.parametrize("side", [0.0, 40.0])
def test_dead_tip_load(load, angle, across, along, side, compare):
    direction = np.array([np.cos(np.radians(side)), np.sin(np.radians(side)), 0.0])
    tip, frame, _ = bent(40, force=load * EI / LENGTH**2 * direction)
    what = f"elastica, PL^2/EI = {load}, 40 joints, load at {side:.0f} degrees"
    compare(f"{what}: deflection / L", tip @ direction / LENGTH, across, within=0.002, scale=1)
    compare(f"{what}: shortening / L", 1 - tip[2] / LENGTH, along, within=0.002, scale=1)
    compare(f"{what}: tip angle [degrees]", np.degrees(np.arccos(frame[2, 2])), angle, within=0.002)


def test_the_elastica_converges_with_order_two():
    gaps = [abs(bent(n, force=[5 * EI / LENGTH**2, 0, 0])[0][0] / LENGTH - 0.7137915) for n in (10, 20, 40)]
    assert np.log2(gaps[0] / gaps[1]) > 1.8
    assert np.log2(gaps[1] / gaps[2]) > 1.8


@pytest.mark.parametrize(("side", "joints"), [(0.0, 25), (0.0, 40), (20.0, 25), (20.0, 40), (45.0, 40)])
def test_a_moment_of_2_pi_ei_over_l_rolls_the_rod_up(side, joints, compare):
    """In whatever plane: hinges turned from joint to joint, and their cubic springs, leave no stiff direction."""
    axis = np.array([-np.sin(np.radians(side)), np.cos(np.radians(side)), 0.0])
    tip, _, _ = bent(joints, moment=2 * np.pi * EI / LENGTH * axis)
    what = f"roll-up at {side:.0f} degrees, {joints} joints: gap / L"
    compare(what, float(np.linalg.norm(tip)) / LENGTH, 0.0, within=0.002, scale=1)


def test_linear_springs_close_the_roll_up_alike_in_every_plane():
    """What backends without cubic springs get: two hinges a joint are phi^2 / 12 too stiff, 0.2 % at 40 joints."""
    gaps = []
    for side in (0.0, 20.0, 45.0):
        axis = np.array([-np.sin(np.radians(side)), np.cos(np.radians(side)), 0.0])
        tip, _, _ = bent(40, moment=2 * np.pi * EI / LENGTH * axis, cubic=False)
        gaps.append(float(np.linalg.norm(tip)) / LENGTH)
    assert gaps == pytest.approx([(2 * np.pi / 40) ** 2 / 12] * 3, rel=0.02)


def test_euler_load_of_a_clamped_free_column(compare):
    model = hinge_rod(ROD, 20).spec.compile()
    data = mujoco.MjData(model)
    chain = SerialChain(model)
    chain.place(data, np.zeros(model.nq))
    unit = Load(model.nbody - 1, np.array([0, 0, LENGTH / 40]), np.array([0, 0, -1.0]), ZERO)
    _, slope = chain.forces(data, [unit], ZERO)
    scale = np.sqrt(chain.stiffness)
    softening = np.linalg.eigvalsh(slope / np.outer(scale, scale)).max()
    theory = np.pi**2 * EI / (4 * LENGTH**2)
    compare("Euler load of a clamped-free column, 20 joints [N]", 1 / softening, theory, within=0.01)


def buckled(push: float):
    """Tip position [m] and frame of the rod in its state of least energy under an axial push [N]."""
    built = hinge_rod(ROD, 40)
    model = built.spec.compile()
    data = mujoco.MjData(model)
    chain = SerialChain(model)
    body, place = model.body(built.tip[0]).id, np.array(built.tip[1])

    def tip() -> np.ndarray:
        return data.xpos[body] + data.xmat[body].reshape(3, 3) @ place

    def potential(qpos):
        chain.place(data, qpos)
        energy, torque, stiffness = chain.springs(qpos)
        value, slope = chain.forces(data, [Load(body, place, np.array([0, 0, -push]), ZERO)], ZERO)
        return energy + push * tip()[2], torque - value, np.diag(stiffness) - slope

    find_minimum(potential, 0.02 * model.jnt_axis[:, 1], scale=float(chain.stiffness.max()), tolerance=1e-9)
    return tip(), data.xmat[body].reshape(3, 3)


@pytest.mark.parametrize(
    ("angle", "ratio", "chord", "deflection"),
    [(20, 1.01540, 0.96973, 0.10971), (60, 1.15172, 0.74102, 0.29660), (120, 1.88480, 0.12316, 0.40159)],
)
def test_after_buckling(angle, ratio, chord, deflection, compare):
    critical = np.pi**2 * EI / (4 * LENGTH**2)
    tip, frame = buckled(ratio * critical)
    # Post-buckling grows steeply with load at small angles: d(angle)/d(load) there magnifies every error.
    bar = 0.02 if angle < 30 else 0.005
    what = f"after buckling, P/Pe = {ratio}, 40 joints"
    compare(f"{what}: end angle [degrees]", np.degrees(np.arccos(frame[2, 2])), angle, within=bar)
    compare(f"{what}: chord / L", tip[2] / LENGTH, chord, within=0.004, scale=1)
    across = float(np.linalg.norm(tip[:2]))  # the plane that it leaves in is its own choice
    compare(f"{what}: mid deflection / L", across / (2 * LENGTH), deflection, within=bar)
