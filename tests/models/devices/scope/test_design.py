from dataclasses import replace

import pytest

from haustra.errors import InvalidDesignError
from haustra.models.devices.scope.design import BendingLimits, ScopeSection
from haustra.models.devices.scope.library import DESIGN_NAMES, named_design
from haustra.models.devices.scope.wires import WireSet


@pytest.mark.parametrize("name", DESIGN_NAMES)
def test_named_designs_have_their_working_length(name):
    assert named_design(name).length == pytest.approx(2.0 if name.endswith("-long") else 1.68)


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


def with_section(**changes):
    design = named_design("adult")
    return replace(design, shaft=(replace(design.shaft[0], **changes),))


def with_bending(**changes):
    design = named_design("adult")
    return replace(design, bending=replace(design.bending, **changes))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: with_bending(bias_up_deg=200.0), "pre-curved beyond its own limits"),
        (lambda: with_bending(bias_left_deg=-170.0), "pre-curved beyond its own limits"),
        (lambda: with_section(minimum_bend_radius=0.5, bias_up_deg=720.0), "pre-curved tighter than it may bend"),
        (lambda: with_section(minimum_bend_radius=0.001), "smaller than the scope's own radius"),
        (lambda: replace(named_design("adult"), wires=WireSet(0.005, 60.0, hysteresis=1.0)), "give 0 to 0.99"),
        (lambda: replace(named_design("adult"), variable_stiffness=1.5), "give 0 to 1"),
        (lambda: replace(named_design("adult"), working_length=1.5), "add up to"),
    ],
)
def test_parts_that_do_not_fit_are_refused(make, message):
    with pytest.raises(InvalidDesignError, match=message):
        make()
