"""A heavy rod pushed through a horizontal tube: it snakes at 2 sqrt(EI w/r), winds up from 2.83 sqrt(EI w/r).

Sources: Dawson and Paslay, J. Petroleum Technology 36 (1984) 1734; Chen, Lin and Cheatham, J. Energy Resources Tech.
112 (1990) 149 (energy of straight and helical states equal); Lubinski et al., J. Petroleum Technology 14 (1962) 655
(pitch 2 pi sqrt(2 EI/F), contact force r F^2 / 4 EI). w: weight per length, r: radial clearance, F: push.
"""

import mujoco
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from haustra.envs.statics.chain import Load, SerialChain
from haustra.envs.statics.descent import find_minimum
from haustra.envs.statics.newton import find_equilibrium
from haustra.models.scope.rods import UniformRod, hinge_rod

EI, LENGTH, JOINTS, CLEARANCE, WALL, PIN = 0.033, 4.0, 80, 0.0086, 2e4, 1e5
MASS, GRAVITY, ZERO = 0.4, np.array([-9.81, 0.0, 0.0]), np.zeros(3)
UNIT = np.sqrt(EI * MASS * 9.81 / CLEARANCE)
ROD = UniformRod(
    length=LENGTH, radius=0.0064, flexural_rigidity=EI, torsional_rigidity=0.435, mass_per_length=MASS, loss_time=0.0
)


class TubeRod:
    """The rod on the wall of the tube, clamped at its base, its tip pinned sideways and pushed along the axis.

    The wall is a spring both ways, since all of the rod touches it; that it never has to pull is checked.
    """

    def __init__(self) -> None:
        self.model = hinge_rod(ROD, JOINTS, twist_hinges=4).spec.compile()
        self.data = mujoco.MjData(self.model)
        self.chain = SerialChain(self.model)
        self.bodies = np.arange(self.model.nbody - JOINTS, self.model.nbody)
        self.names = [self.model.joint(joint).name for joint in range(self.model.njnt)]
        self.tip = np.array([0, 0, LENGTH / JOINTS / 2])

    def out_of_balance(self, push: float, weight: float = 1.0):
        """Force and derivative as a function of the angles."""

        def at(qpos):
            chain, data = self.chain, self.data
            chain.place(data, qpos)
            points = data.xpos[self.bodies]
            pushes, stiff = self._wall(points)
            tip = data.xpos[self.bodies[-1]] + data.xmat[self.bodies[-1]].reshape(3, 3) @ self.tip
            end = np.array([-PIN * tip[0], -PIN * tip[1], -push])
            loads = [Load(int(b), ZERO, f, ZERO) for b, f in zip(self.bodies, pushes, strict=True)]
            loads.append(Load(int(self.bodies[-1]), self.tip, end, ZERO))
            value, slope = chain.forces(data, loads, weight * GRAVITY)
            moving = chain.jacobian(data, np.append(self.bodies, self.bodies[-1]), np.vstack([points, tip]))
            stiff = np.concatenate([stiff, np.diag([PIN, PIN, 0.0])[None]])
            _, torque, spring = chain.springs(qpos)
            added = np.einsum("bqi,bij,brj->qr", moving, stiff, moving, optimize=True)
            return torque - value, np.diag(spring) - slope + added

        return at

    def _wall(self, points):
        """Push of the wall on points, and its stiffness: radially a spring, around the tube force over radius."""
        offset = points[:, :2] - [CLEARANCE, 0.0]
        radius = np.linalg.norm(offset, axis=1)
        out = offset / np.maximum(radius, 1e-9)[:, None]
        depth = radius - CLEARANCE
        pushes, stiff = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
        pushes[:, :2] = -WALL * depth[:, None] * out
        radial = out[:, :, None] * out[:, None, :]
        around = np.eye(2) - radial
        stiff[:, :2, :2] = WALL * (radial + (depth / np.maximum(radius, 1e-9))[:, None, None] * around)
        return pushes, stiff

    def solve(self, push: float, start, weight: float = 1.0):
        scale = float(self.chain.stiffness.max())
        evaluate = self.out_of_balance(push, weight)
        return find_equilibrium(evaluate, start, scale=scale, tolerance=1e-7, most_iterations=200).qpos

    def helix(self, push: float, weight: float = 1.0):
        """The rod set free from Lubinski's helix."""
        balance = self.out_of_balance(push, weight)
        return find_minimum(
            lambda qpos: (self.energy(qpos, push, weight), *balance(qpos)),
            self.laid_helix(push),
            scale=float(self.chain.stiffness.max()),
            tolerance=1e-6,
        ).qpos

    def laid_helix(self, push: float):
        """The rod laid along Lubinski's helix, which leaves the floor of the tube at both ends."""
        wave = np.sqrt(push / (2 * EI))
        turns = max(1, round(wave * LENGTH / (2 * np.pi)))
        phase = 2 * np.pi * turns * np.minimum(np.arange(JOINTS + 1) / (JOINTS - 1), 1)
        path = CLEARANCE * np.stack([1 - np.cos(phase), np.sin(phase)], axis=1)
        return self._laid_along(path)

    def _laid_along(self, path):
        """Angles that turn every link towards the next point of the path, hinges in the order they stand in."""
        cell = LENGTH / JOINTS
        across = np.diff(path, axis=0) / cell
        frame = np.eye(3)
        qpos = np.zeros(self.model.nq)
        for number, (x, y) in enumerate(across):
            bends = [
                index for index, name in enumerate(self.names) if name.endswith(f"_{number:03d}") and "bend" in name
            ]
            first, second = (self.model.jnt_axis[bend] for bend in bends)
            ahead = frame.T @ [x, y, np.sqrt(1 - x * x - y * y)]
            # The second hinge turns the tangent to its part along the first; the first turns the rest.
            towards = np.cross(second, [0, 0, 1])
            angles = np.zeros(2)
            angles[1] = np.arcsin(ahead @ first / (towards @ first))
            angles[0] = np.arctan2(ahead @ np.cross(first, [0, 0, 1]), ahead[2])
            qpos[bends] = angles
            frame = frame @ Rotation.from_rotvec(angles[0] * first).as_matrix()
            frame = frame @ Rotation.from_rotvec(angles[1] * second).as_matrix()
        return qpos

    def energy(self, qpos, push: float, weight: float = 1.0) -> float:
        """Potential energy of springs, wall, weight and push [J]."""
        self.chain.place(self.data, qpos)
        radius = np.linalg.norm(self.data.xpos[self.bodies][:, :2] - [CLEARANCE, 0.0], axis=1)
        tip = self.data.xpos[self.bodies[-1]] + self.data.xmat[self.bodies[-1]].reshape(3, 3) @ self.tip
        return (
            self.chain.springs(qpos)[0]
            + 0.5 * WALL * ((radius - CLEARANCE) ** 2).sum()
            - weight * self.model.body_mass @ self.data.xipos @ GRAVITY
            + 0.5 * PIN * (tip[:2] ** 2).sum()
            + push * (tip[2] - LENGTH)
        )


@pytest.fixture(scope="module")
def rod():
    return TubeRod()


def test_it_snakes_at_the_load_of_dawson_and_paslay(rod, compare):
    def softest(push):
        straight = rod.solve(push, np.zeros(rod.model.nq))
        return np.linalg.eigvalsh(rod.out_of_balance(push)(straight)[1])[0]

    onset = brentq(softest, 1.5 * UNIT, 2.6 * UNIT, xtol=0.01 * UNIT)
    compare("tube: onset of snaking, Dawson and Paslay [N]", onset, 2 * UNIT, within=0.1)


def test_a_helix_presses_on_the_wall_as_lubinski_says(rod, compare):
    push = 12.0
    rod.chain.place(rod.data, rod.helix(push, weight=0.0))
    pushes, _ = rod._wall(rod.data.xpos[rod.bodies])
    middle = slice(JOINTS // 4, 3 * JOINTS // 4)
    inwards = CLEARANCE * np.array([1.0, 0.0]) - rod.data.xpos[rod.bodies][:, :2]
    assert (np.einsum("bi,bi->b", pushes[:, :2], inwards)[middle] > 0).all()
    per_length = np.linalg.norm(pushes[middle], axis=1).mean() * JOINTS / LENGTH
    compare("tube: contact force of a helix, Lubinski [N/m]", per_length, CLEARANCE * push**2 / (4 * EI), within=0.1)


def test_helix_and_straight_rod_have_equal_energy_at_the_load_of_chen(rod, compare):
    def difference(push):
        straight = rod.solve(push, np.zeros(rod.model.nq))
        return rod.energy(rod.laid_helix(push), push) - rod.energy(straight, push)

    onset = brentq(difference, 2.3 * UNIT, 3.4 * UNIT, xtol=0.02 * UNIT)
    compare("tube: onset of winding up, Chen [N]", onset, np.sqrt(8) * UNIT, within=0.1)
