"""Studies of any device: which colons they know."""

import pytest

from haustra.envs.study.device import _colon, _how_grown
from haustra.envs.study.study_file import load_study
from haustra.errors import InvalidStudyError
from haustra.models.anatomy.grown import grow_colon


def test_a_colon_is_grown_as_its_name_says() -> None:
    assert _how_grown("grown-7") == {"seed": 7, "difficulty": "any", "pressure": None}
    assert _how_grown("grown-7-hard-2.5kPa") == {"seed": 7, "difficulty": "hard", "pressure": 2500.0}
    assert _how_grown("grown-7-2kPa") == {"seed": 7, "difficulty": "any", "pressure": 2000.0}
    poor, usual = _colon("grown-310007-2kPa"), grow_colon(seed=310007)
    assert poor.radius.mean() < 0.95 * usual.radius.mean()
    assert poor.centreline.length == pytest.approx(usual.centreline.length, rel=1e-3)


@pytest.mark.parametrize("name", ["grown-", "grown-x", "grown-7-steep", "grown-7-2kPa-hard", "grown-7-1.5.2kPa"])
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(InvalidStudyError, match=f"Colon '{name}' is not known"):
        _how_grown(name)


def test_the_search_for_bends_starts_from_several_places_in_none_of_the_twenty_colons() -> None:
    study = load_study("tracked-bends")
    assert len(study.conditions["start"]) == 4 and study.objectives[0].score == "came_m"
    assert not any(300000 <= int(_how_grown(str(name))["seed"]) < 300020 for name in study.conditions["colon"])
