"""Run time against error: references are right, knobs do what their names say, finished questions are kept."""

import json
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.repair import is_watertight
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.scope.rods import RODS
from haustra.scripts.bench.accuracy import elastica, motion, propulsion, timing
from haustra.scripts.bench.accuracy.drive import compare, record_script, replay
from haustra.scripts.bench.accuracy.insertion import refined
from haustra.scripts.bench.accuracy.plain_scope import plain_scope
from haustra.scripts.bench.accuracy.question import Effort
from haustra.scripts.bench.accuracy.refined_mesh import with_triangles
from haustra.scripts.bench.accuracy.run import QUESTIONS, run_questions
from haustra.scripts.bench.accuracy.timing import Candidate, timed_front
from haustra.scripts.bench.pages.accuracy_page import accuracy_log, draw
from haustra.scripts.main import BAD_INPUT, SUCCESS, main
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube, wedge_wall


@pytest.mark.parametrize(
    ("load", "across", "along"), [(1, 0.30172, 0.05643), (5, 0.71379, 0.38763), (10, 0.81061, 0.55500)]
)
def test_the_reference_is_bisshopp_and_druckers_elastica(load, across, along):
    found = elastica.elastica_tip(load)
    assert found == pytest.approx((across, 1 - along), abs=2e-5)


def test_half_cells_are_of_second_order_and_whole_first_links_of_first():
    table = elastica.answer(Effort(quick=True)).tables[0]
    for row in table.rows:
        assert row["observed_order"] == pytest.approx(row["theory"], abs=0.2), row


def test_a_flex_rod_bends_as_it_should_under_its_own_integrator_alone():
    built, load = RODS["1D flex"](elastica.ROD, 10), 0.1
    tip, _, data = elastica.stepped_tip(built, load)
    across, _ = elastica.elastica_tip(load)
    assert timing.sound(data)
    assert tip[0] / elastica.ROD.length == pytest.approx(across, rel=0.01)
    explicit = replace(built, integrator=mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    assert not timing.sound(elastica.stepped_tip(explicit, load)[2])
    with pytest.raises(UnsupportedSceneError, match="'mjx' cannot honour the rod '1D flex'"):
        built.require("mjx")


def test_integrators_have_their_order_in_time():
    found = motion.answer(Effort(quick=True))
    orders = {row["integrator"]: row["observed_order"] for row in found.tables[0].rows}
    for name in ("Euler", "implicitfast", "discrete"):
        assert orders[name] == pytest.approx(1.0, abs=0.1)
    assert orders["RK4"] == pytest.approx(4.5, abs=1.0)
    assert any(point.outcome == "diverged" for point in found.fronts[0].points)


def test_a_cone_that_scales_with_friction_is_seen_in_the_propulsion_force():
    errors = {point.setting: point.error for point in propulsion.answer(Effort(quick=True)).fronts[0].points}
    assert errors["timestep=0.001"] < 1e-3
    assert errors["cone=pyramidal"] > 0.05


def test_costs_are_medians_over_turns_and_nothing_is_timed_that_diverged():
    spent = {"a": iter([9.0, 1.0, 2.0, 30.0]), "b": iter([9.0, 4.0, 5.0, 6.0])}
    turns = []

    def block(name):
        def run():
            turns.append(name)
            return next(spent[name])

        return run

    front = timed_front(
        "q",
        [
            Candidate("a", 0.1, "g", block("a")),
            Candidate("c", np.inf, "g", None, "diverged"),
            Candidate("b", 0.2, "g", block("b")),
        ],
        reference="r",
        error_unit="1",
        repeats=3,
    )
    assert [point.cost for point in front.points] == [2.0, np.inf, 5.0]
    assert turns == ["a", "b"] * 4
    assert [point.setting for point in front.best()] == ["a"]


def test_finished_questions_are_kept_until_the_effort_changes(tmp_path):
    told = []
    first = run_questions(["wires"], Effort(quick=True), folder=tmp_path)
    again = run_questions(["wires"], Effort(quick=True, tell=told.append), folder=tmp_path)
    assert again.fronts == first.fronts
    kept = tmp_path / "questions" / "wires.json"
    kept.write_text(kept.read_text()[:100])  # half a file: the question is asked anew
    anew = run_questions(["wires"], Effort(quick=True), folder=tmp_path)
    assert [point.error for point in anew.fronts[0].points] == [point.error for point in first.fronts[0].points]
    assert anew.fronts != first.fronts


def test_an_unknown_question_is_refused_by_name(capsys):
    with pytest.raises(InvalidOptionError, match=r"Known: elastica"):
        run_questions(["nothing"], Effort())
    assert main(["bench", "accuracy", "--questions", "nothing", "--json"]) == BAD_INPUT
    assert capsys.readouterr().err.count("\n") == 1


@pytest.fixture(scope="module")
def answered(tmp_path_factory) -> Path:
    """Folder of two questions that the verb has answered, and what it printed."""
    folder = tmp_path_factory.mktemp("accuracy")
    call = ["bench", "accuracy", "--quick", "--questions", "wires,buckling", "-o", str(folder), "--json"]
    with redirect_stdout(StringIO()) as printed:
        assert main(call) == SUCCESS
    (folder / "printed.json").write_text(printed.getvalue())
    return folder


def test_the_verb_writes_what_it_prints(answered):
    result = json.loads((answered / "printed.json").read_text())
    assert json.loads((answered / "accuracy.json").read_text()) == result
    assert [criterion["met"] for criterion in result["criteria"]] == [True, True]
    assert result["machine"]["processor"]


def test_a_finer_model_is_nearer_to_a_converged_one_under_the_same_script():
    colon = swept_colon(winding([(0.05, 0.0), (0.06, 1.4), (0.1, 0.0)]), name="bent tube")
    design = named_design("adult")
    usual = refined(1, 1, 0.005)
    coarse = replace(usual, shaft_cell=0.1, bending_cell=0.05)
    script = record_script(colon, design, usual, seconds=1.2)
    finer, first, second = (replay(script, colon, None, design, each) for each in (refined(2, 2, 0.005), usual, coarse))
    assert compare(first, finer).tip < 0.6 * compare(second, finer).tip
    assert script.deepest(0.03) >= finer.insertion.max()


def test_the_plain_scene_is_the_same_scope():
    """Its tip goes where ours goes, through the same wall, and it has neither our damping nor our contact."""
    colon, wall = straight_tube(), wedge_wall()
    design = named_design("adult")
    plain = plain_scope(colon, wall, design, segments=30, timestep=0.002, damped=True)
    data = plain.begin()
    for _ in range(250):
        data.ctrl[0] = 0.04 * data.time
        mujoco.mj_step(plain.model, data)
    mujoco.mj_kinematics(plain.model, data)
    assert plain.tip_of(data) == pytest.approx([0, 0, 0.03 + 0.04 * 0.5], abs=2e-3)
    assert plain.model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert plain.model.body_mass[2:].sum() == pytest.approx(0.5 + design.mass_per_length * 0.63, rel=0.1)


@pytest.mark.parametrize("count", [30_000, 30_001])
def test_a_mesh_is_cut_into_exactly_so_many_triangles_and_stays_where_it_was(count):
    colon = straight_tube()
    fine = with_triangles(colon, count)
    assert len(fine.lumen.faces) == count - count % 2
    assert is_watertight(fine.lumen.faces)
    assert area(fine.lumen) == pytest.approx(area(colon.lumen), rel=1e-12)
    with pytest.raises(InvalidOptionError, match="triangles already"):
        with_triangles(fine, 100)


def area(surface) -> float:
    corners = surface.vertices[surface.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(across, axis=1).sum()) / 2


def test_the_page_shows_every_bar_and_the_best_of_every_front(answered, tmp_path):
    bench = json.loads((answered / "accuracy.json").read_text())
    log = accuracy_log(bench)
    for criterion in bench["criteria"]:
        assert criterion["what"] in log
    for front in bench["fronts"]:
        assert all(f"| {name} |" in log for name in front["best"])
    assert draw(tmp_path / "a.png", bench["fronts"]).stat().st_size > 10_000


def test_every_question_has_its_module():
    for name in QUESTIONS:
        module = __import__(f"haustra.scripts.bench.accuracy.{name}", fromlist=["answer"])
        assert callable(module.answer)
