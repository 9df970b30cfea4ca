"""Anatomical colons grown from a seed."""

from collections.abc import Callable

import numpy as np

from haustra.errors import InvalidMeshError, InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.course import Course, lay_course
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.haustration import haustral_radius
from haustra.models.anatomy.landmarks import BORDERS, SEGMENTS, segments_between
from haustra.models.anatomy.mesh_colon import ANGLES, STATION_STEP
from haustra.models.anatomy.rays import LumenRays, radius_field
from haustra.models.anatomy.recipe import ColonRecipe, draw_recipe
from haustra.models.anatomy.tube import tube
from haustra.provenance import Provenance

RING_STEP = 2.8e-3
"""Distance between rings of vertices [m]: nine from fold to fold."""
RING_ANGLES = 48
"""Vertices on a ring: sixteen from taenia to taenia."""
ATTEMPTS = 20
"""Courses that are tried for one case before it is given up."""
ENOUGH_ROOM = 0.9
"""A course is taken when its gap and its bends reach this share of what the recipe asks."""


def grow_colon(*, seed: int, progress: Callable[[str], None] = lambda stage: None) -> Colon:
    """Grow an adult, insufflated colon: the same one for the same seed.

    Args:
        seed: Any integer from 0 to 2^63.
        progress: Called with the name of each stage as it begins.

    Raises:
        InvalidOptionError: when the seed is negative or too large.
        InvalidMeshError: when no course without self-contact was found.
    """
    if not 0 <= seed < 2**63:
        raise InvalidOptionError(f"Seed {seed} must be from 0 to 2^63.")
    rng = np.random.Generator(np.random.PCG64(seed))
    recipe = draw_recipe(rng)
    progress("laying the course")
    course = _free_course(recipe, rng)
    progress("raising haustra and folds")
    rings = centreline_through(course.points, RING_STEP)
    scale = recipe.length / rings.length  # the chain keeps its length to a fraction of a per cent
    radius = haustral_radius(recipe, rng, rings.arc * scale, RING_ANGLES)
    lumen = tube(rings.points, rings.frames, radius)
    progress("measuring the radius")
    line = centreline_through(course.points, STATION_STEP)
    borders = recipe.borders()
    places = {"anus": 0.0} | {
        border: borders[name][1] / recipe.length * line.length for border, name in zip(BORDERS, SEGMENTS, strict=False)
    }
    return Colon(
        name=f"grown-{seed}",
        lumen=lumen,
        centreline=line,
        radius=radius_field(LumenRays(lumen), line.points, line.frames, ANGLES),
        segments=segments_between(places, line.length),
        provenance=Provenance(inputs={}, configuration={"method": "grown", "seed": seed, "recipe": recipe.to_json()}),
        landmarks=places,
    )


def _free_course(recipe: ColonRecipe, rng: np.random.Generator) -> Course:
    for _ in range(ATTEMPTS):
        course = lay_course(recipe, rng)
        roomy = course.gap >= ENOUGH_ROOM * recipe.gap
        if roomy and course.radius_of_curvature >= ENOUGH_ROOM * recipe.flexure_radius:
            return course
    raise InvalidMeshError(f"No course without self-contact was found in {ATTEMPTS} attempts: take another seed.")
