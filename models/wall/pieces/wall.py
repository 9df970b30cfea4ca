"""The wall: convex pieces that stand outside the lumen, with their measured error."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from jaxtyping import Float

from haustra.provenance import Provenance


@dataclass(frozen=True)
class WallPiece:
    """One convex solid of the wall."""

    vertices: Float[np.ndarray, "vertices 3"]
    """Corners of the convex hull [m]; no inner points."""
    start: float
    """Arc length where the block it was cut from begins [m]."""
    end: float
    """Arc length where that block ends [m]."""


@dataclass(frozen=True)
class WallAccuracy:
    """How far the pieces' inner face is from the lumen surface, where rays from the centreline outwards meet it.

    The error of a ray is the distance of its hit on the pieces from the lumen surface; the side on which it lies gives
    the sign. What the centreline does not see, behind folds in sharp bends, is not measured.
    """

    intrusion_max_mm: float
    """Deepest point of a piece inside the lumen."""
    intrusion_p95_mm: float
    """95th percentile of the intrusion over all rays, rays without intrusion counting as 0."""
    recess_p95_mm: float
    """95th percentile of the distance by which pieces stand back from the lumen surface, likewise."""
    rms_mm: float
    """Root mean square of the signed error."""
    mean_signed_mm: float
    """Mean signed error; positive where the pieces stand back, negative where they narrow the lumen."""
    seam_step_max_mm: float
    """Largest step of the inner face between neighbouring rays on both sides of a seam, beyond the lumen's own."""
    rays: int
    """Rays cast."""
    leaks: int
    """Rays that ran 3 mm outside the lumen, or into another loop, without meeting a piece."""
    neighbour_max_mm: float | None = None
    """Deepest point of a piece in the lumen of another loop than its own; None for walls of before it was measured."""

    def to_json(self) -> dict[str, float | int | None]:
        """As plain JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class Wall:
    """A colon's wall, ready to stand in a scene. SI units but for `error`."""

    method: str
    """'coacd' or 'prism'."""
    pieces: tuple[WallPiece, ...]
    """Convex solids outside the lumen."""
    error: WallAccuracy
    """Measured, not assumed."""
    provenance: Provenance
    """Colon hash, options and versions that made it."""
    metadata: Mapping[str, object]
    """What a user may want to know beside it: thickness, seconds, whether it came from the cache."""
