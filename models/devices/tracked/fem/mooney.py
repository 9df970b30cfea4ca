"""Mooney-Rivlin energies of an isochoric deformation in plane strain, with their exact derivatives."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.models.devices.tracked.tread import NUMBERS


@dataclass(frozen=True, kw_only=True)
class MooneyRivlin:
    """W = C10 a + C01 b + C11 a b + C20 a^2 + C02 b^2, with a = I1bar - 3 and b = I2bar - 3; constants in Pa.

    Barred invariants are those of the volume-preserving part of the deformation. In plane strain both depend only on
    t = F:F and J = det F of the in-plane gradient F (2 x 2):
    I1bar = J^(-2/3) (t + 1), I2bar = J^(-4/3) t + J^(2/3).
    """

    c10: float
    c01: float
    c11: float = 0.0
    c20: float = 0.0
    c02: float = 0.0

    @property
    def shear_modulus(self) -> float:
        """At small strain, 2 (C10 + C01) [Pa]."""
        return 2.0 * (self.c10 + self.c01)

    def energy(self, t: Float[np.ndarray, "..."], j: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        """Energy density [J/m^3]."""
        a, b = j ** (-2 / 3) * (t + 1) - 3, j ** (-4 / 3) * t + j ** (2 / 3) - 3
        return self.c10 * a + self.c01 * b + self.c11 * a * b + self.c20 * a**2 + self.c02 * b**2

    def derivatives(self, t: Float[np.ndarray, "..."], j: Float[np.ndarray, "..."]) -> tuple[np.ndarray, ...]:
        """W_t, W_J, W_tt, W_tJ, W_JJ of `energy`, by the chain rule through a and b [Pa]."""
        a_t, a_j, a_tj, a_jj = _first_invariant(t, j)
        b_t, b_j, b_tj, b_jj = _second_invariant(t, j)
        w_a, w_b = self._slopes(t, j)
        w_aa, w_ab, w_bb = 2 * self.c20, self.c11, 2 * self.c02
        return (
            w_a * a_t + w_b * b_t,
            w_a * a_j + w_b * b_j,
            w_aa * a_t**2 + 2 * w_ab * a_t * b_t + w_bb * b_t**2,
            w_aa * a_t * a_j + w_ab * (a_t * b_j + a_j * b_t) + w_bb * b_t * b_j + w_a * a_tj + w_b * b_tj,
            w_aa * a_j**2 + 2 * w_ab * a_j * b_j + w_bb * b_j**2 + w_a * a_jj + w_b * b_jj,
        )

    def von_mises(self, f: Float[np.ndarray, "... 2 2"]) -> Float[np.ndarray, "..."]:
        """Von Mises stress of the Cauchy stress, out-of-plane stress included [Pa].

        Deviator of (2/J) [(W_a J^(-2/3) + W_b J^(-4/3) I1) B - W_b J^(-4/3) B^2] with B = F F^T and B_zz = 1.
        """
        j = np.linalg.det(f)
        t = np.einsum("...ij,...ij->...", f, f)
        w_a, w_b = self._slopes(t, j)
        left = np.zeros((*f.shape[:-2], 3, 3))
        left[..., :2, :2] = f @ np.swapaxes(f, -1, -2)
        left[..., 2, 2] = 1.0
        linear = w_a * j ** (-2 / 3) + w_b * j ** (-4 / 3) * (t + 1)
        stress = (2 / j)[..., None, None] * (
            linear[..., None, None] * left - (w_b * j ** (-4 / 3))[..., None, None] * (left @ left)
        )
        mean = np.trace(stress, axis1=-2, axis2=-1) / 3
        deviator = stress - mean[..., None, None] * np.eye(3)
        return np.sqrt(1.5 * np.einsum("...ij,...ij->...", deviator, deviator))

    def _slopes(self, t, j):
        a, b = j ** (-2 / 3) * (t + 1) - 3, j ** (-4 / 3) * t + j ** (2 / 3) - 3
        return self.c10 + self.c11 * b + 2 * self.c20 * a, self.c01 + self.c11 * a + 2 * self.c02 * b


def _first_invariant(t, j):
    """I1bar's derivatives by t, J, tJ and JJ (tt vanishes)."""
    return j ** (-2 / 3), -2 / 3 * j ** (-5 / 3) * (t + 1), -2 / 3 * j ** (-5 / 3), 10 / 9 * j ** (-8 / 3) * (t + 1)


def _second_invariant(t, j):
    """I2bar's derivatives by t, J, tJ and JJ (tt vanishes)."""
    return (
        j ** (-4 / 3),
        -4 / 3 * j ** (-7 / 3) * t + 2 / 3 * j ** (-1 / 3),
        -4 / 3 * j ** (-7 / 3),
        28 / 9 * j ** (-10 / 3) * t - 2 / 9 * j ** (-4 / 3),
    )


def _published(material: str) -> MooneyRivlin:
    constants = {name.rpartition(".")[2]: number.value for name, number in NUMBERS.items() if f".{material}." in name}
    return MooneyRivlin(**constants)


TISSUE = _published("tissue")
"""VMQ silicone, the paper's colon wall, three parameters."""

TREAD = _published("rubber")
"""Smooth-Sil 960, five parameters in the paper's order. In plane strain only sums of them act (a = b when J = 1)."""
