import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.course import BULGE, lay_course, radius_along, smallest_gap
from haustra.models.anatomy.frames import arc_length, curvature
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.properties import Clearance, describe
from haustra.models.anatomy.recipe import draw_recipe, priors
from haustra.models.anatomy.store import colon_hash


@pytest.fixture(scope="module")
def colon() -> Colon:
    return grow_colon(seed=0)


def test_same_seed_same_colon_and_another_seed_another(colon: Colon):
    assert colon_hash(grow_colon(seed=0)) == colon_hash(colon)
    assert colon_hash(grow_colon(seed=1)) != colon_hash(colon)


def test_seed_zero_is_an_ordinary_adult(colon: Colon):
    measures = describe(colon)
    assert measures["length_m"] == pytest.approx(1.5, abs=0.1)
    assert 1.2e-3 < measures["volume_m3"] < 2.6e-3  # CT colonography, low-pressure CO2: 1.6 +- 0.6 L (NUMBERS 1.2)
    assert measures["watertight"] and measures["genus"] == 0
    assert 20_000 <= measures["triangles"] <= 65_000
    assert measures["centreline_min_clearance_m"] > 0.0064  # an adult colonoscope's radius


def test_parts_stand_where_anatomy_has_them(colon: Colon):
    at = {
        name: colon.centreline.points[np.searchsorted(colon.centreline.arc, arc)]
        for name, arc in colon.landmarks.items()
    }
    assert at["splenic_flexure"][2] > at["hepatic_flexure"][2] > at["caecum"][2] > at["anus"][2]
    assert at["splenic_flexure"][0] > 0.05 and at["hepatic_flexure"][0] < -0.05  # x points to the patient's left
    transverse = next(s for s in colon.segments if s.name == "transverse")
    arc = colon.centreline.arc
    hanging = colon.centreline.points[(arc > transverse.start) & (arc < transverse.end)]
    assert hanging[:, 2].min() < at["hepatic_flexure"][2] - 0.03
    assert hanging[:, 1].min() < at["splenic_flexure"][1]  # it hangs in front


def test_three_taeniae_part_the_haustra(colon: Colon):
    arc = colon.centreline.arc
    ascending = next(s for s in colon.segments if s.name == "ascending")
    rows = colon.radius[(arc > ascending.start) & (arc < ascending.end)]
    spread = rows.std(axis=0)
    spectrum = np.abs(np.fft.rfft(spread - spread.mean()))
    assert spectrum.argmax() == 3


@pytest.mark.parametrize("seed", range(2, 8))
def test_course_has_its_length_bends_wider_than_its_lumen_and_room(seed: int):
    rng = np.random.Generator(np.random.PCG64(seed))
    recipe = draw_recipe(rng)
    course = lay_course(recipe, rng)
    arc = arc_length(course.points)
    outer = BULGE * radius_along(recipe, arc)
    assert arc[-1] == pytest.approx(recipe.length, rel=0.01)
    assert smallest_gap(course.points, outer) > 0.006
    assert (curvature(course.points)[2:-2] * outer[2:-2]).max() < 0.9


def test_recipes_keep_to_their_sources():
    known = priors()
    recipes = [draw_recipe(np.random.Generator(np.random.PCG64(seed))) for seed in range(300)]
    lengths = np.array([recipe.length for recipe in recipes])
    total, spread = known["length.total"], known["length.total_sd"].value
    assert lengths.min() >= total.low - 1e-9 and lengths.max() <= total.high + 1e-9
    assert lengths.mean() == pytest.approx(total.value, abs=3 * spread / np.sqrt(len(lengths)))
    for name in SEGMENTS:
        diameter = known[f"diameter.{name}"]
        assert all(diameter.low <= recipe.diameters[name] <= diameter.high for recipe in recipes)


def test_lumen_encloses_its_centreline(colon: Colon):
    clearance = Clearance(colon.lumen)(colon.centreline.points)
    np.testing.assert_array_less(clearance, colon.radius.min(axis=1) + 1e-3)


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_impossible_seed(seed: int):
    with pytest.raises(InvalidOptionError, match="Seed"):
        grow_colon(seed=seed)
