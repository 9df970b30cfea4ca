"""Run time against error: references are right, knobs do what their names say, finished questions are kept."""

import json

import numpy as np
import pytest

from haustra.envs.bench.accuracy import elastica, motion, propulsion
from haustra.envs.bench.accuracy.question import Effort
from haustra.envs.bench.accuracy.run import QUESTIONS, run_questions
from haustra.envs.bench.accuracy.timing import Candidate, timed_front
from haustra.errors import InvalidOptionError
from haustra.scripts.main import BAD_INPUT, SUCCESS, main


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


def test_the_verb_writes_what_it_prints(tmp_path, capsys):
    call = ["bench", "accuracy", "--quick", "--questions", "wires,buckling", "-o", str(tmp_path), "--json"]
    assert main(call) == SUCCESS
    result = json.loads(capsys.readouterr().out)
    assert json.loads((tmp_path / "accuracy.json").read_text()) == result
    assert [bar["met"] for bar in result["bars"]] == [True, True]
    assert result["machine"]["processor"]


def test_every_question_has_its_module():
    for name in QUESTIONS:
        module = __import__(f"haustra.envs.bench.accuracy.{name}", fromlist=["answer"])
        assert callable(module.answer)
