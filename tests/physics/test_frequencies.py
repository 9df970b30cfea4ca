"""Natural frequencies of a clamped-free rod: omega = (lambda / L)^2 sqrt(EI / m), cos(lambda) cosh(lambda) = -1.

Source: Euler-Bernoulli beam theory, e.g. Rao, Mechanical Vibrations, 8.5. Torsion: omega = pi / 2L sqrt(GJ / J_m).
"""

import mujoco
import numpy as np
from scipy.linalg import eigh

from haustra.models.devices.scope.rods import UniformRod, hinge_rod

ROD = UniformRod(length=1.2, radius=0.0064, flexural_rigidity=0.03, torsional_rigidity=0.4, mass_per_length=0.3)


def frequencies(rod: UniformRod, joints: int) -> np.ndarray:
    model = hinge_rod(rod, joints).spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    return np.sqrt(eigh(np.diag(model.jnt_stiffness), inertia, eigvals_only=True))


def test_first_three_bending_frequencies(compare):
    found = frequencies(ROD, 40)[:6:2]
    theory = np.array([1.875104, 4.694091, 7.854757]) ** 2 * np.sqrt(0.03 / 0.3) / 1.2**2
    for number, (measured, exact) in enumerate(zip(found, theory, strict=True), start=1):
        compare(f"natural frequency {number} of a cantilever, 40 joints [rad/s]", measured, exact, within=0.01)


def test_first_torsional_frequency(compare):
    thick = UniformRod(
        length=1.2, radius=0.0064, flexural_rigidity=100.0, torsional_rigidity=0.004, mass_per_length=0.3
    )
    theory = np.pi / (2 * 1.2) * np.sqrt(0.004 / (0.3 * 0.0064**2 / 2))
    # Each link is a capsule of uniform density, whose round ends hold less inertia than a cylinder's.
    compare("first torsional frequency, 30 joints [rad/s]", frequencies(thick, 30)[0], theory, within=0.02)
