"""Whose colons are grown, against the sources' distributions."""

from collections import Counter

import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.person import Person, draw_person, name_difficulty, priors
from haustra.models.anatomy.recipe import ColonRecipe, draw_recipe

CASES = 600


def draw(seed: int, **options) -> tuple[Person, ColonRecipe]:
    rng = np.random.Generator(np.random.PCG64(seed))
    person = draw_person(rng, **options)
    return person, draw_recipe(rng, person)


@pytest.mark.parametrize(
    ("cohort", "sex", "mean", "sd"),
    [("japan-ctc", "female", 1.543, 0.181), ("japan-ctc", "male", 1.471, 0.183), ("us-ctc", "any", 1.895, 0.263)],
)
def test_lengths_are_those_of_utano_and_khashab(cohort, sex, mean: float, sd: float):
    lengths = np.array([draw(seed, cohort=cohort, sex=sex)[1].length for seed in range(CASES)])
    assert lengths.mean() == pytest.approx(mean, abs=3 * sd / np.sqrt(CASES))
    assert lengths.std() == pytest.approx(sd, rel=0.1)
    known = priors()[f"cohort.{cohort}.female"]
    assert lengths.min() >= known.low and lengths.max() <= known.high


def test_difficult_colons_are_as_frequent_as_saunders_found():
    """Saunders 1996: colonoscopy judged difficult in 31 % of women and 16 % of men."""
    for sex, share in (("female", 0.31), ("male", 0.16)):
        found = Counter(draw(seed, sex=sex)[0].difficulty for seed in range(CASES))
        judged = (found["difficult"] + found["hard"]) / CASES
        assert judged == pytest.approx(share, abs=3 * np.sqrt(share * (1 - share) / CASES))


def test_flexures_are_as_many_as_khashab_counted():
    flexures = np.array([draw(seed, cohort="us-ctc")[1].flexures for seed in range(CASES)])
    assert flexures.mean() == pytest.approx(10.9, abs=0.3)
    assert flexures.std() == pytest.approx(2.4, rel=0.1)


def test_women_have_the_longer_transverse_colon():
    """Saunders 1996: 0.48 m in women, 0.40 m in men; no other differs, though the sigmoid takes what is left."""
    mean = {
        sex: np.mean([[draw(seed, sex=sex)[1].lengths[name] for name in SEGMENTS] for seed in range(200)], axis=0)
        for sex in ("female", "male")
    }
    longer = dict(zip(SEGMENTS, mean["female"] - mean["male"], strict=True))
    assert longer.pop("transverse") == pytest.approx(0.08, abs=0.01)
    assert all(abs(difference) < 0.02 for difference in longer.values())


def test_harder_is_longer_and_more_winding_with_tighter_bends():
    drawn = {
        band: [draw(seed, difficulty=band) for seed in range(150)] for band in ("easy", "moderate", "difficult", "hard")
    }
    for person, _ in (pair for pairs in drawn.values() for pair in pairs):
        assert name_difficulty(person.tortuosity) == person.difficulty
    for measure in (
        lambda recipe: recipe.length,
        lambda recipe: recipe.flexures,
        lambda recipe: -recipe.flexure_radius,
        lambda recipe: recipe.lengths["sigmoid"],
    ):
        means = [np.mean([measure(recipe) for _, recipe in pairs]) for pairs in drawn.values()]
        assert means == sorted(means)


def test_recipes_keep_to_their_ranges():
    known = priors()
    for seed in range(CASES):
        _, recipe = draw(seed)
        assert recipe.length == pytest.approx(recipe.person.length, abs=1e-5)
        for name in SEGMENTS:
            diameter = known[f"diameter.{name}"]
            assert diameter.low <= recipe.diameters[name] <= diameter.high
            if name != "transverse":
                length = known[f"length.{name}"]
                assert length.low - 1e-3 <= recipe.lengths[name] <= length.high + 1e-3


@pytest.mark.parametrize("option", [{"cohort": "mars"}, {"sex": "f"}, {"difficulty": "redundant"}])
def test_unknown_options_are_named_with_those_known(option):
    with pytest.raises(InvalidOptionError, match=r"is not known\. Known: "):
        draw_person(np.random.default_rng(0), **option)
