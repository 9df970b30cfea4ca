"""A heavy rod pushed through a horizontal tube, in equilibrium: how it buckles.

Sources: Dawson and Paslay, J. Petroleum Technology 36 (1984) 1734; Chen, Lin and Cheatham, J. Energy Resources Tech.
112 (1990) 149 (energy of straight and helical states equal); Lubinski et al., J. Petroleum Technology 14 (1962) 655
(pitch 2 pi sqrt(2 EI/F)). w: weight per length, r: radial clearance, F: push.
"""

from collections.abc import Callable

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from haustra.models.devices.scope.rods import UniformRod, hinge_rod
from haustra.scripts.bench.reference.chain import Load, SerialChain
from haustra.scripts.bench.reference.descent import find_minimum
from haustra.scripts.bench.reference.newton import find_equilibrium

EI, LENGTH, CLEARANCE = 0.033, 4.0, 0.0086
"""Flexural rigidity [N m^2], length [m] and radial clearance [m]."""
WALL, PIN = 2e4, 1e5
"""Stiffness of the tube at each joint, and of the pin at the tip [N/m]."""
MASS, GRAVITY = 0.4, np.array([-9.81, 0.0, 0.0])
"""Mass per length [kg/m] and gravity [m/s^2]."""
UNIT = float(np.sqrt(EI * MASS * 9.81 / CLEARANCE))
"""sqrt(EI w / r) [N]: the sinusoidal buckling load is 2 of them (Dawson and Paslay), the helical one sqrt(8) (Chen)."""
ROD = UniformRod(length=LENGTH, radius=0.0064, flexural_rigidity=EI, torsional_rigidity=0.435, mass_per_length=MASS)
_ZERO = np.zeros(3)


class TubeRod:
    """The rod on the wall of the tube, clamped at its base, its tip pinned sideways and pushed along the axis.

    The wall is a spring both ways, since all of the rod touches it; that it never has to pull is for callers to check.
    """

    def __init__(self, joints: int = 80) -> None:
        """A rod of that many joints."""
        self.joints = joints
        self.model = hinge_rod(ROD, joints, twist_hinges=4).spec.compile()
        self.data = mujoco.MjData(self.model)
        self.chain = SerialChain(self.model)
        self.bodies = np.arange(self.model.nbody - joints, self.model.nbody)
        self.names = [self.model.joint(joint).name for joint in range(self.model.njnt)]
        self.tip = np.array([0, 0, LENGTH / joints / 2])

    def sinusoidal_load(self) -> float:
        """Push at which the straight rod becomes unstable [N]."""

        def softest(push: float) -> float:
            straight = self.solve(push, np.zeros(self.model.nq))
            return float(np.linalg.eigvalsh(self.out_of_balance(push)(straight)[1])[0])

        return float(np.asarray(brentq(softest, 1.5 * UNIT, 2.6 * UNIT, xtol=0.01 * UNIT)))

    def helical_load(self) -> float:
        """Push at which a helix has as much energy as the straight rod [N]."""

        def difference(push: float) -> float:
            straight = self.solve(push, np.zeros(self.model.nq))
            return self.energy(self.laid_helix(push), push) - self.energy(straight, push)

        return float(np.asarray(brentq(difference, 2.3 * UNIT, 3.4 * UNIT, xtol=0.02 * UNIT)))

    def out_of_balance(
        self, push: float, weight: float = 1.0
    ) -> Callable[[Float[np.ndarray, " q"]], tuple[np.ndarray, np.ndarray]]:
        """Force and derivative as a function of the angles."""

        def at(qpos):
            chain, data = self.chain, self.data
            chain.place(data, qpos)
            points = data.xpos[self.bodies]
            pushes, stiff = self.wall(points)
            tip = data.xpos[self.bodies[-1]] + data.xmat[self.bodies[-1]].reshape(3, 3) @ self.tip
            end = np.array([-PIN * tip[0], -PIN * tip[1], -push])
            loads = [Load(int(b), _ZERO, f, _ZERO) for b, f in zip(self.bodies, pushes, strict=True)]
            loads.append(Load(int(self.bodies[-1]), self.tip, end, _ZERO))
            value, slope = chain.forces(data, loads, weight * GRAVITY)
            moving = chain.jacobian(data, np.append(self.bodies, self.bodies[-1]), np.vstack([points, tip]))
            stiff = np.concatenate([stiff, np.diag([PIN, PIN, 0.0])[None]])
            _, torque, spring = chain.springs(qpos)
            added = np.einsum("bqi,bij,brj->qr", moving, stiff, moving, optimize=True)
            return torque - value, np.diag(spring) - slope + added

        return at

    def wall(self, points: Float[np.ndarray, "points 3"]) -> tuple[np.ndarray, np.ndarray]:
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

    def solve(self, push: float, start: Float[np.ndarray, " q"], weight: float = 1.0) -> Float[np.ndarray, " q"]:
        """Angles of the equilibrium next to `start` [rad]."""
        scale = float(self.chain.stiffness.max())
        evaluate = self.out_of_balance(push, weight)
        return find_equilibrium(evaluate, start, scale=scale, tolerance=1e-7, most_iterations=200).qpos

    def helix(self, push: float, weight: float = 1.0) -> Float[np.ndarray, " q"]:
        """The rod set free from Lubinski's helix."""
        balance = self.out_of_balance(push, weight)
        return find_minimum(
            lambda qpos: (self.energy(qpos, push, weight), *balance(qpos)),
            self.laid_helix(push),
            scale=float(self.chain.stiffness.max()),
            tolerance=1e-6,
        ).qpos

    def laid_helix(self, push: float) -> Float[np.ndarray, " q"]:
        """The rod laid along Lubinski's helix, which leaves the floor of the tube at both ends."""
        wave = np.sqrt(push / (2 * EI))
        turns = max(1, round(wave * LENGTH / (2 * np.pi)))
        phase = 2 * np.pi * turns * np.minimum(np.arange(self.joints + 1) / (self.joints - 1), 1)
        path = CLEARANCE * np.stack([1 - np.cos(phase), np.sin(phase)], axis=1)
        return self._laid_along(path)

    def _laid_along(self, path: Float[np.ndarray, "nodes 2"]) -> Float[np.ndarray, " q"]:
        """Angles that turn every link towards the next point of the path, hinges in the order they stand in."""
        cell = LENGTH / self.joints
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

    def energy(self, qpos: Float[np.ndarray, " q"], push: float, weight: float = 1.0) -> float:
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
