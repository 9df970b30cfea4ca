"""A strip of tread over a strip of tissue, pressed by strut tips: the quasi-static plane-strain problem."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from haustra.errors import HaustraError, InvalidOptionError
from haustra.models.devices.tracked.fem.body import Body
from haustra.models.devices.tracked.fem.contact import Patch, round_tips, sliding_faces
from haustra.models.devices.tracked.fem.mooney import TISSUE, TREAD
from haustra.models.devices.tracked.tread import TreadGeometry

RESIDUAL_TOLERANCE = 1e-3
"""Largest nodal residual [N/m], about 1e-5 of a tip's force: far below the mesh's own error."""
_MAX_ITERATIONS = 16
_CELL = 0.33e-3
"""Mean cell length along the tread [m]; a strut tip's contact is about half a millimetre long."""
_LOAD_STEP = 5e-5
"""Indentation [m] a load step, halved where Newton's method fails; twice as much often does."""
_LARGEST_MOVE = 1e-4
"""No node moves further [m] in one iteration: half a cell of the tissue's surface, so that none turns over."""
_SMALLEST_STEP = 1e-7
"""Indentation step [m] below which a solution counts as lost."""


class TreadReferenceError(HaustraError):
    """The finite-element reference found no equilibrium."""


@dataclass(frozen=True, kw_only=True)
class MeshOptions:
    """Numerical choices, each shown to be converged in docs/theory/tracked.md."""

    refinement: int = 1
    """Multiplies the number of cells along every edge."""
    bulk_ratio: float = 500.0
    """Bulk modulus over shear modulus: Poisson's ratio 0.499."""
    tooth_penalty: float = 4e9
    """Tooth on tissue [Pa/m]: some micrometres of penetration."""
    tip_penalty: float = 6e10
    """Tip on belt [Pa/m]."""
    free_length: float = 40e-3
    """Tread beyond the outermost tip, at least [m]: the paper's stress levels out there."""


@dataclass(frozen=True)
class Equilibrium:
    """A solved state. Forces over the whole width."""

    displacement: Float[np.ndarray, "n 2"]
    """Displacement of the tread's nodes, then the tissue's [m]."""
    indentation: float
    """Outward displacement of the tips beyond the clearance [m]."""
    tip_forces: Float[np.ndarray, " tips"]
    """Outward force of each tip [N]."""
    contact_force: float
    """Normal force between teeth and tissue [N]."""
    friction_force: float
    """Force along the track on the tread, and so on the device [N]."""
    penetration: float
    """Deepest penalty penetration of teeth into tissue [m]."""
    iterations: int
    """Newton iterations spent."""


@dataclass(frozen=True)
class Strip:
    """Meshes of one geometry; tips may stand anywhere below it."""

    geometry: TreadGeometry
    options: MeshOptions
    tread: Body
    tissue: Body
    _fixed: np.ndarray = field(repr=False)
    _faces: np.ndarray = field(repr=False)
    _belly: np.ndarray = field(repr=False)
    _surface: np.ndarray = field(repr=False)

    @classmethod
    def build(cls, geometry: TreadGeometry, *, span: float, options: MeshOptions | None = None) -> "Strip":
        """Mesh a tread of whole pitches, a tooth centred at x = 0, that covers `span` [m] plus the free lengths.

        Raises:
            MissingDependencyError: when scikit-fem is not installed.
        """
        options = options or MeshOptions()
        g = geometry
        teeth = int(np.ceil((span / 2 + options.free_length) / g.pitch))
        x = _lines(g, teeth, options.refinement)
        belt, tooth = -g.tooth_height - g.belt_thickness, -g.tooth_height
        n = options.refinement
        belt_cells = max(3, round(g.belt_thickness / 0.4e-3))
        y = np.concatenate([np.linspace(belt, tooth, belt_cells * n + 1), np.linspace(tooth, 0, 4 * n + 1)[1:]])

        def between_teeth(cx):
            return np.abs((cx + g.pitch / 2) % g.pitch - g.pitch / 2) > g.tooth_width / 2

        def in_gap(cx, cy):
            return (cy > tooth) & between_teeth(cx)

        tread = Body.on_grid(x, y, TREAD, bulk_ratio=options.bulk_ratio, removed=in_gap)
        depth = g.clearance + np.linspace(0, 1, 9 * n + 1) ** 1.7 * g.tissue_thickness
        tissue = Body.on_grid(x, depth, TISSUE, bulk_ratio=options.bulk_ratio)
        first = len(tread.nodes)
        ends = np.abs(np.abs(tread.nodes[:, 0]) - x[-1]) < 1e-9
        tops = _pairs(tread.nodes, 0.0)
        outer = np.abs(tissue.nodes[:, 1] - depth[-1]) < 1e-9
        return cls(
            g,
            options,
            tread,
            tissue,
            np.concatenate([ends, outer]),
            tops[~between_teeth(tread.nodes[tops, 0].mean(1))],
            _pairs(tread.nodes, belt),
            first + _row(tissue.nodes, g.clearance),
        )

    @property
    def positions(self) -> Float[np.ndarray, "n 2"]:
        """Rest positions of the tread's nodes, then the tissue's [m]."""
        return np.concatenate([self.tread.nodes, self.tissue.nodes])

    def press(
        self,
        tips: Sequence[float],
        indentation: float,
        *,
        friction: float,
        start: Equilibrium | None = None,
    ) -> Equilibrium:
        """Equilibrium with tips at x = `tips` pressed outwards by `indentation` beyond the clearance [m].

        Args:
            tips: Positions along the tread [m]; x = 0 is a tooth's centre.
            indentation: Outward displacement of the tips beyond the clearance [m].
            friction: Coulomb's coefficient between teeth and tissue.
            start: A state near by to begin from; otherwise the load is raised in steps.

        Raises:
            InvalidOptionError: when the friction is negative or the indentation is not positive.
            TreadReferenceError: when no equilibrium is found.
        """
        if not (0 <= friction <= 2 and indentation > 0):
            raise InvalidOptionError(
                f"Cannot press by {indentation} m at friction {friction}: give an indentation > 0 and friction 0 to 2."
            )
        at = np.asarray(tips, float)
        u, reached = (
            (np.zeros_like(self.positions), -self.geometry.clearance)
            if start is None
            else (start.displacement, start.indentation)
        )
        before, step, spent = None, _LOAD_STEP, 0
        while True:
            load = indentation if abs(indentation - reached) < step else reached + np.sign(indentation - reached) * step
            guess = u if before is None else u + (load - reached) / (reached - before[1]) * (u - before[0])
            solved, count = self._newton(guess, at, load, friction)
            spent += count
            if solved is None:
                step /= 2
                before = None
                if step < _SMALLEST_STEP:
                    raise TreadReferenceError(
                        f"No equilibrium beyond {reached * 1e3:.3f} mm of indentation: press less or soften penalties."
                    )
                continue
            before = (u, reached) if load != reached else None
            u, reached, step = solved, load, min(_LOAD_STEP, 1.5 * step)
            if reached == indentation:
                return self._state(u, at, indentation, friction, spent)

    def _newton(self, u, tips, indentation, friction):
        free = ~np.repeat(self._fixed, 2)
        residual, stiffness = self._system(u, tips, indentation, friction)
        size = np.abs(residual[free]).max()
        for iteration in range(_MAX_ITERATIONS):
            if size < RESIDUAL_TOLERANCE:
                return u, iteration
            lu = splu(
                stiffness[free][:, free],
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=1e-3,
                options={"SymmetricMode": True},
            )
            step = np.zeros(u.size)
            step[free] = -lu.solve(residual[free])
            scale = min(1.0, _LARGEST_MOVE / max(np.abs(step).max(), 1e-12))
            for _ in range(6):
                trial = u + scale * step.reshape(u.shape)
                try:
                    trial_residual, stiffness = self._system(trial, tips, indentation, friction)
                except FloatingPointError:
                    scale /= 2
                    continue
                trial_size = np.abs(trial_residual[free]).max()
                if trial_size < 2 * size or trial_size < RESIDUAL_TOLERANCE:
                    break
                scale /= 2
            else:
                return None, iteration
            u, residual, size = trial, trial_residual, trial_size
        return None, _MAX_ITERATIONS

    def _system(self, u, tips, indentation, friction):
        """Residual and stiffness of all degrees of freedom; FloatingPointError when an element has turned over."""
        first = len(self.tread.nodes)
        residual = np.zeros_like(u)
        rows, columns, values = [], [], []

        def add(nodes, forces, slopes):
            np.add.at(residual, nodes, forces)
            dofs = (2 * nodes[:, :, None] + np.arange(2)).reshape(len(nodes), 2 * nodes.shape[1])
            rows.append(np.repeat(dofs, dofs.shape[1], axis=1).ravel())
            columns.append(np.tile(dofs, dofs.shape[1]).ravel())
            values.append(slopes.ravel())

        with np.errstate(invalid="raise", divide="raise"):
            for body, nodes, part in (
                (self.tread, self.tread.quads, u[:first]),
                (self.tissue, self.tissue.quads + first, u[first:]),
            ):
                add(nodes, *body.forces(part))
        teeth, tip, _ = self._contacts(u, tips, indentation, friction)
        for patch in (teeth, tip):
            add(patch.nodes, -patch.forces, -patch.slopes)
        shape = (u.size, u.size)
        matrix = csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
        return residual.ravel(), matrix

    def _contacts(self, u, tips, indentation, friction) -> tuple[Patch, Patch, np.ndarray]:
        g, rest = self.geometry, self.positions
        x = rest + u
        teeth = sliding_faces(
            x,
            self._faces,
            np.diff(rest[self._faces, 0], axis=1)[:, 0],
            self._surface,
            stiffness=self.options.tooth_penalty,
            friction=friction,
        )
        height = g.clearance + indentation - g.tooth_height - g.belt_thickness - g.tip_radius
        centres = np.column_stack([tips, np.full(len(tips), height)])
        tip, owner = round_tips(
            x,
            self._belly,
            np.diff(rest[self._belly, 0], axis=1)[:, 0],
            centres,
            g.tip_radius,
            stiffness=self.options.tip_penalty,
        )
        return teeth, tip, owner

    def _state(self, u, tips, indentation, friction, iterations) -> Equilibrium:
        teeth, tip, owner = self._contacts(u, tips, indentation, friction)
        on_tread = teeth.forces[:, :2].sum((0, 1)) * self.geometry.width
        # pull = -n + friction t with unit n, t: |pull| gives the normal force whatever the face's tilt
        normal = np.linalg.norm(teeth.forces[:, :2].sum(1), axis=1).sum() * self.geometry.width
        return Equilibrium(
            displacement=u,
            indentation=indentation,
            tip_forces=np.bincount(owner, tip.forces[:, :, 1].sum(1), len(tips)) * self.geometry.width,
            contact_force=float(normal / np.hypot(1, friction)),
            friction_force=float(on_tread[0]),
            penetration=teeth.depth,
            iterations=iterations,
        )


def _lines(g: TreadGeometry, teeth: int, refinement: int) -> np.ndarray:
    """Grid lines: each tooth and each gap graded towards the tooth's edges, where pressure peaks."""
    tooth = (_graded(g.tooth_width, refinement) - 0.5) * g.tooth_width
    gap = g.tooth_width / 2 + _graded(g.pitch - g.tooth_width, refinement) * (g.pitch - g.tooth_width)
    pitch = np.concatenate([tooth[:-1], gap[:-1]])
    lines = np.concatenate([pitch + k * g.pitch for k in range(-teeth, teeth)] + [tooth + teeth * g.pitch])
    overhang = g.pitch / 4
    return np.concatenate([[lines[0] - overhang], lines, [lines[-1] + overhang]])


def _graded(length: float, refinement: int) -> np.ndarray:
    """From 0 to 1, cells of about `_CELL` on average, shorter at both ends."""
    cells = max(6, round(length / _CELL)) * refinement
    even = np.linspace(0, 1, cells + 1)
    return 0.6 * (1 - np.cos(np.pi * even)) / 2 + 0.4 * even


def _row(nodes: np.ndarray, y: float) -> np.ndarray:
    """Nodes at height y, left to right."""
    found = np.flatnonzero(np.abs(nodes[:, 1] - y) < 1e-9)
    return found[np.argsort(nodes[found, 0])]


def _pairs(nodes: np.ndarray, y: float) -> np.ndarray:
    """Neighbouring nodes on the line at height y, left to right."""
    row = _row(nodes, y)
    return np.column_stack([row[:-1], row[1:]])
