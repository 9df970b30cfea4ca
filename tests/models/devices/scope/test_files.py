from dataclasses import replace

import pytest

from haustra.errors import InvalidDesignError, UnreadableFileError
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.files import design_text, find_design, load_design, save_design
from haustra.models.devices.scope.library import DESIGN_NAMES, at_body_temperature, named_design


@pytest.mark.parametrize("name", DESIGN_NAMES)
def test_a_design_survives_its_file(name, tmp_path):
    design = replace(at_body_temperature(named_design(name)), variable_stiffness=0.4, name='a "quoted" \\ name')
    design = replace(design, bending=replace(design.bending, bias_up_deg=-20.0, minimum_bend_radius=0.02))
    assert load_design(save_design(design, tmp_path / "scope.toml")) == design


def test_a_file_is_found_by_its_ending_and_a_shipped_design_by_name(tmp_path):
    save_design(named_design("adult"), tmp_path / "mine.toml")
    assert find_design(str(tmp_path / "mine.toml")) == find_design("adult")
    with pytest.raises(InvalidDesignError, match=r"Known: adult.*\.toml"):
        find_design("adlut")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("diameter = ", "diametre = "), "'diametre' is not known. Known: name, diameter"),
        (("relaxation_time = 0.03\n", ""), "'relaxation_time' is missing"),
        (("relaxation_time = 0.03", "relaxation_time = '0.03'"), "relaxation_time is '0.03'; give 1e-12 to 10 s"),
        (("relaxation_time = 0.03", "relaxation_time = true"), "relaxation_time is True; give"),
        (("relaxation_time = 0.03", "relaxation_time = nan"), "relaxation_time is nan"),
        (("flexural_rigidity = 0.033", "flexural_rigidity = -1"), "shaft\\[0\\]\\.flexural_rigidity is -1"),
        (("[[shaft]]", "[shaft]"), "give a list of tables"),
        (("working_length", "name_again"), "'name_again' is not known"),
        (("working_length = 1.68", "working_length = 1.5"), "add up to 1.6800 m, not to its working length of 1.5"),
    ],
)
def test_a_broken_file_is_refused_by_key(change, message, tmp_path):
    text = "working_length = 1.68\n" + design_text(named_design("adult"))
    assert change[0] in text
    path = tmp_path / "scope.toml"
    path.write_text(text.replace(change[0], change[1], 1))
    with pytest.raises(InvalidDesignError, match=message):
        load_design(path)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"[[["])
def test_what_is_not_toml_is_refused(content, tmp_path):
    path = tmp_path / "scope.toml"
    path.write_bytes(content)
    with pytest.raises(UnreadableFileError, match=r"scope\.toml"):
        load_design(path)
    with pytest.raises(UnreadableFileError, match=r"none\.toml"):
        load_design(tmp_path / "none.toml")


def test_stiffness_in_use_follows_temperature_and_setting():
    design: ScopeDesign = named_design("adult-variable")
    shaft = design.shaft[0]
    stiff = replace(design, variable_stiffness=1.0)
    assert stiff.flexural_rigidity(shaft) == pytest.approx(1.3 * design.flexural_rigidity(shaft))
    assert stiff.flexural_rigidity(design.bending) == design.flexural_rigidity(design.bending)
    warm = at_body_temperature(design)
    assert warm.flexural_rigidity(shaft) == pytest.approx(0.83 * shaft.flexural_rigidity)
    assert warm.torsional_stiffness(shaft) == pytest.approx(0.93 * shaft.torsional_rigidity)
