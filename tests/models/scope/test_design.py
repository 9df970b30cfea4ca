from dataclasses import replace

import pytest

from haustra.errors import InvalidDesignError
from haustra.models.scope.design import BendingLimits, ScopeSection
from haustra.models.scope.library import DESIGN_NAMES, named_design


@pytest.mark.parametrize("name", DESIGN_NAMES)
def test_named_designs_have_their_working_length(name):
    assert named_design(name).length == pytest.approx(1.68)


def test_an_unknown_design_is_refused_with_the_names_there_are():
    with pytest.raises(InvalidDesignError, match=r"adlut.*Known: adult, paediatric"):
        named_design("adlut")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"diameter": -0.01}, "diameter is -0.01"),
        ({"mass_per_length": float("nan")}, "mass_per_length is nan"),
        ({"shaft": ()}, "no shaft section"),
        (
            {"shaft": (ScopeSection(length=1.0, flexural_rigidity=-1, torsional_rigidity=0.4),)},
            "flexural_rigidity is -1",
        ),
        ({"diameter": 0.009}, "outside"),
        ({"limits": BendingLimits(up=1000.0, left=90.0, down=90.0, right=90.0)}, "tighter than its own radius"),
    ],
)
def test_impossible_values_are_refused_by_name(change, message):
    with pytest.raises(InvalidDesignError, match=message):
        replace(named_design("adult"), **change)
