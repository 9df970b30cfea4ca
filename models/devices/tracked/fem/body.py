"""A hyperelastic body on quadrilaterals with one mean volume ratio an element (Q1P0): forces and stiffness."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from haustra.errors import MissingDependencyError
from haustra.models.devices.tracked.fem.mooney import MooneyRivlin


@dataclass(frozen=True)
class Body:
    """Mesh, shape-function gradients and law of one body."""

    nodes: Float[np.ndarray, "n 2"]
    """Rest positions [m]."""
    quads: Int[np.ndarray, "e 4"]
    """Corner nodes."""
    gradients: Float[np.ndarray, "e q 4 2"]
    """Gradients of the shape functions at 2 x 2 Gauss points [1/m]."""
    weights: Float[np.ndarray, "e q"]
    """Areas of the Gauss points [m^2]."""
    law: MooneyRivlin
    bulk_modulus: float
    """Penalty on the element's mean volume change [Pa]."""

    @classmethod
    def on_grid(
        cls,
        x: Float[np.ndarray, " nx"],
        y: Float[np.ndarray, " ny"],
        law: MooneyRivlin,
        *,
        bulk_ratio: float,
        removed=None,
    ) -> "Body":
        """Tensor grid of lines x and y [m], less the cells whose centre `removed(cx, cy)` says are empty.

        Raises:
            MissingDependencyError: when scikit-fem is not installed.
        """
        try:
            from skfem import Basis, ElementQuad1, MeshQuad
        except ImportError as error:
            raise MissingDependencyError("The tread reference needs scikit-fem: pip install 'haustra[fem]'.") from error
        mesh = MeshQuad.init_tensor(x, y)
        if removed is not None:
            centres = mesh.p[:, mesh.t].mean(axis=1)
            mesh = mesh.remove_elements(np.flatnonzero(removed(centres[0], centres[1])))
        basis = Basis(mesh, ElementQuad1(), intorder=3)
        gradients = np.stack([np.asarray(shape[0].grad) for shape in basis.basis])  # corner, axis, element, point
        return cls(
            nodes=mesh.p.T.copy(),
            quads=basis.element_dofs.T.copy(),
            gradients=np.ascontiguousarray(gradients.transpose(2, 3, 0, 1)),
            weights=basis.dx.copy(),
            law=law,
            bulk_modulus=bulk_ratio * law.shear_modulus,
        )

    def deformation(self, u: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "e q 2 2"]:
        """In-plane deformation gradient at the Gauss points."""
        return np.eye(2) + np.einsum("eai,eqaj->eqij", u[self.quads], self.gradients)

    def energy(self, u: Float[np.ndarray, "n 2"]) -> float:
        """Strain energy per unit width [J/m]."""
        f = self.deformation(u)
        j = np.linalg.det(f)
        theta = (j * self.weights).sum(1) / self.weights.sum(1)
        isochoric = (self.law.energy(np.einsum("eqij,eqij->eq", f, f), j) * self.weights).sum()
        return float(isochoric + (0.5 * self.bulk_modulus * (theta - 1) ** 2 * self.weights.sum(1)).sum())

    def forces(self, u: Float[np.ndarray, "n 2"]) -> tuple[Float[np.ndarray, "e 4 2"], Float[np.ndarray, "e 8 8"]]:
        """Inner nodal forces [N/m] and their derivative [N/m^2] per element, both exact derivatives of `energy`."""
        f = self.deformation(u)
        cof = np.empty_like(f)
        cof[..., 0, 0], cof[..., 1, 1] = f[..., 1, 1], f[..., 0, 0]
        cof[..., 0, 1], cof[..., 1, 0] = -f[..., 1, 0], -f[..., 0, 1]
        j = f[..., 0, 0] * f[..., 1, 1] - f[..., 0, 1] * f[..., 1, 0]
        t = (f * f).sum((-1, -2))
        volume = self.weights.sum(1)
        pressure = self.bulk_modulus * ((j * self.weights).sum(1) / volume - 1)
        w_t, w_j, w_tt, w_tj, w_jj = self.law.derivatives(t, j)
        w_j = w_j + pressure[:, None]
        stress = 2 * w_t[..., None, None] * f + w_j[..., None, None] * cof
        force = np.einsum("eqij,eqaj,eq->eai", stress, self.gradients, self.weights, optimize=True)

        along_f = np.einsum("eqij,eqaj->eqai", f, self.gradients).reshape(*j.shape, 8)
        along_c = np.einsum("eqij,eqaj->eqai", cof, self.gradients).reshape(*j.shape, 8)
        w = self.weights
        scaled_f = (4 * w_tt * w)[..., None] * along_f + (2 * w_tj * w)[..., None] * along_c
        scaled_c = (2 * w_tj * w)[..., None] * along_f + (w_jj * w)[..., None] * along_c
        stiffness = np.swapaxes(scaled_f, 1, 2) @ along_f + np.swapaxes(scaled_c, 1, 2) @ along_c
        mean_c = (w[..., None] * along_c).sum(1)
        stiffness += (self.bulk_modulus / volume)[:, None, None] * mean_c[:, :, None] * mean_c[:, None, :]
        g = self.gradients
        laplace = np.swapaxes((2 * w_t * w)[..., None, None] * g, 2, 3)  # e q j a
        laplace = np.einsum("eqja,eqbj->eab", laplace, g, optimize=True)
        curl = np.einsum("eq,eqa,eqb->eab", w_j * w, g[..., 0], g[..., 1], optimize=True)
        curl = curl - np.swapaxes(curl, 1, 2)
        blocks = stiffness.reshape(-1, 4, 2, 4, 2)
        blocks[:, :, 0, :, 0] += laplace
        blocks[:, :, 1, :, 1] += laplace
        blocks[:, :, 0, :, 1] += curl
        blocks[:, :, 1, :, 0] -= curl
        return force, stiffness

    def von_mises(self, u: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " e"]:
        """Mean von Mises stress of each element [Pa]."""
        values = self.law.von_mises(self.deformation(u))
        return (values * self.weights).sum(1) / self.weights.sum(1)
