"""Anatomical colons grown from a seed."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace

import numpy as np

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Centreline, Colon, Surface
from haustra.models.anatomy.course import SIGMOID_COURSES, lay_free_course
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.haustration import haustral_radius
from haustra.models.anatomy.landmarks import BORDERS, SEGMENTS, segments_between
from haustra.models.anatomy.lesion import LesionOrder
from haustra.models.anatomy.lesion_placing import Placer
from haustra.models.anatomy.lesion_shapes import add_solids, narrow
from haustra.models.anatomy.mesh_colon import ANGLES, STATION_STEP
from haustra.models.anatomy.person import draw_person, tidy
from haustra.models.anatomy.rays import LumenRays, lumen_table
from haustra.models.anatomy.recipe import ColonRecipe, draw_recipe
from haustra.models.anatomy.tube import tube
from haustra.models.gas.numbers import diameter_share, gas_numbers
from haustra.provenance import Provenance

RING_STEP = 2.8e-3
"""Distance between rings of vertices [m]: nine from fold to fold."""
RING_ANGLES = 48
"""Vertices on a ring: sixteen from taenia to taenia."""
EXACT = 8
"""Decimals of a metre to which the centreline is rounded: the last bits of another machine's arithmetic do not show."""
EXACT_RADIUS = 7
"""Decimals of a metre of the measured radius, whose rays cross triangles at all angles."""

LEAST_PRESSURE = 1333.0
"""Lowest gas pressure at which colons are grown [Pa], 10 mmHg: below it the law closes segments."""


def grow_colon(
    *,
    seed: int,
    cohort: str = "japan-ctc",
    sex: str = "any",
    difficulty: str = "any",
    lesions: Sequence[LesionOrder] = (),
    pressure: float | None = None,
    sigmoid: str = "coiled",
    progress: Callable[[str], None] = lambda stage: None,
) -> Colon:
    """Grow an adult, insufflated colon: the same one for the same seed and options, on any machine.

    Each part is drawn from its own stream: lesions change nothing else, and neither does any option change what it
    does not name.

    Args:
        seed: Any integer from 0 to 2^63.
        cohort: Whose lengths.
        sex: female, male, or any to draw it.
        difficulty: A band of tortuosity, or any to draw from all.
        lesions: Strictures, diverticula and polyps to put in.
        pressure: Gas pressure at which its diameters are those of the pressure-volume law [Pa]; the set point of CT
            colonography when None. Its course is laid for those diameters.
        sigmoid: How the sigmoid lies: coiled over the rectum, or in one bow, omega.
        progress: Called with the name of each stage as it begins.

    Raises:
        InvalidOptionError: when an option is not known, or a lesion does not fit.
        InvalidMeshError: when no course without self-contact was found.
    """
    if not 0 <= seed < 2**63:
        raise InvalidOptionError(f"Seed {seed} must be from 0 to 2^63.")
    if sigmoid not in SIGMOID_COURSES:
        raise InvalidOptionError(f"Sigmoid '{sigmoid}' is not known. Known: {', '.join(SIGMOID_COURSES)}.")
    streams = [np.random.Generator(np.random.PCG64(child)) for child in np.random.SeedSequence(seed).spawn(5)]
    person = draw_person(streams[0], cohort=cohort, sex=sex, difficulty=difficulty)
    recipe = _opened(draw_recipe(streams[1], person), pressure)
    progress("laying the course")
    course = lay_free_course(recipe, streams[2], sigmoid=sigmoid)
    progress("raising haustra and folds")
    rings = centreline_through(course.points, RING_STEP)
    scale = recipe.length / rings.length  # the chain keeps its length to a fraction of a per cent
    radius = haustral_radius(recipe, streams[3], rings.arc * scale, RING_ANGLES)
    line = _exact(centreline_through(course.points, STATION_STEP))
    borders = recipe.borders()
    places = {"anus": 0.0} | {
        border: borders[name][1] / recipe.length * line.length for border, name in zip(BORDERS, SEGMENTS, strict=False)
    }
    segments = segments_between(places, line.length)
    placer = Placer(streams[4], line, segments, lesions)
    radius, found = narrow(placer, rings.arc * (line.length / rings.length), radius)
    lumen = tube(rings.points, rings.frames, radius)
    lumen, solid = add_solids(placer, lumen)
    progress("measuring the radius")
    return Colon(
        name=f"grown-{seed}",
        lumen=lumen,
        centreline=line,
        radius=_radius(lumen, line),
        segments=segments,
        provenance=Provenance(
            inputs={},
            configuration={
                "method": "grown",
                "seed": seed,
                "cohort": cohort,
                "sex": sex,
                "difficulty": difficulty,
                "lesions": [asdict(order) for order in lesions],
                "recipe": recipe.to_json(),
                **({} if pressure is None else {"pressure": pressure}),
                **({} if sigmoid == "coiled" else {"sigmoid": sigmoid}),
            },
        ),
        landmarks=places,
        lesions=(*found, *solid),
    )


def _opened(recipe: ColonRecipe, pressure: float | None) -> ColonRecipe:
    """A recipe with the diameters of another pressure [Pa]."""
    if pressure is None:
        return recipe
    highest = gas_numbers()["pain_pressure"]
    if not LEAST_PRESSURE <= pressure <= highest:
        raise InvalidOptionError(
            f"A colon cannot be grown at {pressure:g} Pa: give {LEAST_PRESSURE:g} Pa, below which segments collapse, "
            f"to {highest:g} Pa, which hurts."
        )
    wide = {name: tidy(each * float(diameter_share(np, name, pressure))) for name, each in recipe.diameters.items()}
    return replace(recipe, diameters=wide)


def _exact(line: Centreline) -> Centreline:
    # Adding zero turns a negative zero, whose sign is chance, into zero.
    return Centreline(*(np.round(part, EXACT) + 0.0 for part in (line.points, line.arc, line.frames)))


def _radius(lumen: Surface, line: Centreline) -> np.ndarray:
    return np.round(lumen_table(LumenRays(lumen), line.points, line.frames, ANGLES), EXACT_RADIUS)
