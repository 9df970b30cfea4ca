"""The colon: lumen surface, centreline, radius field and segments, as one frozen value."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from haustra.provenance import Provenance


@dataclass(frozen=True)
class Surface:
    """A closed triangle surface, wound so that normals point out of the lumen."""

    vertices: Float[np.ndarray, "vertices 3"]
    """Positions [m]."""
    faces: Int[np.ndarray, "triangles 3"]
    """Vertex indices, counter-clockwise seen from outside the lumen."""


@dataclass(frozen=True)
class Centreline:
    """The path through the lumen, from anus to caecum, sampled at equal arc length."""

    points: Float[np.ndarray, "stations 3"]
    """Positions [m]."""
    arc: Float[np.ndarray, " stations"]
    """Arc length from the anus [m]."""
    frames: Float[np.ndarray, "stations 3 3"]
    """Rotation-minimising frames: columns are first normal, second normal, tangent (towards the caecum)."""

    @property
    def length(self) -> float:
        """Arc length from anus to caecum [m]."""
        return float(self.arc[-1])


@dataclass(frozen=True)
class ColonSegment:
    """A named stretch of the colon."""

    name: str
    """rectum, sigmoid, descending, transverse, ascending or caecum."""
    start: float
    """Arc length at its anal end [m]."""
    end: float
    """Arc length at its caecal end [m]."""


@dataclass(frozen=True)
class Lesion:
    """A lesion that was put into a grown colon: geometry only. SI units."""

    kind: str
    """stricture, diverticulum or polyp."""
    type: str
    """Shape: concentric; sac; sessile, pedunculated or flat."""
    size_class: str
    """Name of the class in which its size lies."""
    size: float
    """Throat of a stricture, sac of a diverticulum, width of a polyp [m]."""
    extent: float
    """Length of a stricture's throat, depth of a diverticulum, height of a polyp [m]."""
    segment: str
    """Segment of the colon."""
    arc: float
    """Arc length from the anus [m]."""
    angle: float | None
    """Direction from the centreline's first normal towards the second [rad]; None all around."""
    position: tuple[float, float, float]
    """Its foot on the wall, or the middle of a stricture's throat on the centreline [m]."""


@dataclass(frozen=True)
class Colon:
    """A simulated patient's colon. SI units."""

    name: str
    """What a person calls this case."""
    lumen: Surface
    """The inner surface of the wall."""
    centreline: Centreline
    """From anus to caecum, inside the lumen everywhere."""
    radius: Float[np.ndarray, "stations angles"]
    """Distance from the centreline to the wall [m], at angle 2*pi*k/angles from the first normal towards the second."""
    segments: tuple[ColonSegment, ...]
    """From anus to caecum, without gaps."""
    provenance: Provenance
    """Input hash, options and versions that made it."""
    landmarks: Mapping[str, float] = field(default_factory=dict)
    """Arc length of named places [m]."""
    warnings: tuple[str, ...] = ()
    """What was repaired, and what a user should know."""
    lesions: tuple[Lesion, ...] = ()
    """Strictures, diverticula and polyps that were put in."""
