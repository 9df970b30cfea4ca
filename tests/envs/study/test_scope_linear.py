"""Studies of scopes in linear time: one batch for designs of a kind, halved where memory is short."""

from dataclasses import replace
from pathlib import Path

import pytest

from haustra.envs.study import scope, scope_batch
from haustra.envs.study.scope_linear import LINEAR
from haustra.envs.study.study import Job, Objective, Study, Variable
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.anatomy.store import save_colon
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@pytest.fixture
def study(tmp_path: Path) -> Study:
    bend = swept_colon(winding([(0.1, 0.0), (0.12, 1.2), (0.1, 0.0)]), name="bend")
    end = bend.centreline.length
    segments = (ColonSegment("rectum", 0.0, 0.03), ColonSegment("sigmoid", 0.03, 0.9 * end))
    colon = save_colon(
        replace(bend, segments=(*segments, ColonSegment("descending colon", 0.9 * end, end))), tmp_path / "bend"
    )
    return Study(
        question="scope",
        title="bend",
        base="paediatric",
        variables=(
            Variable(
                name="EI", path="design.shaft.*.flexural_rigidity", unit="N m^2", nominal=0.02, low=0.01, high=0.1
            ),
            Variable(name="diameter", path="scaled.diameter", unit="m", nominal=0.011, low=0.008, high=0.013),
        ),
        conditions={"colon": (str(colon),), "friction": (0.1,)},
        objectives=(Objective("reach", "maximise"),),
        options={"seconds": 6.0, "wall": "prism", "timestep": 0.005, "preset": "balanced"}
        | {"mesentery": False, "driver": "follower"},
    )


_SHORT = {"scene.insertion_limit": 0.16, "scene.shaft_cell": 0.0625, "scene.bending_cell": 0.034}
"""Few joints, so that programs compile soon."""


def _jobs(study: Study) -> list[Job]:
    designs = [{"EI": 0.015, "diameter": 0.011}, {"EI": 0.06, "diameter": 0.011}, {"EI": 0.02, "diameter": -1.0}]
    conditions = {name: values[0] for name, values in study.conditions.items()}
    return [
        Job(id=index, design=index, variables=design, conditions=conditions) for index, design in enumerate(designs)
    ]


def test_designs_share_a_batch_and_differ(study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiffer shaft needs more push in the bend; an impossible design fails alone; short memory changes no row."""
    results = {result.job: result for result in LINEAR.start(study, tmp_path)(_jobs(study))}
    assert [results[index].state for index in range(3)] == ["finished", "finished", "failed"]
    assert "diameter" in results[2].reason
    soft, stiff = (float(results[index].scores["push_force_peak_N"] or 0) for index in range(2))
    assert stiff > 1.5 * soft > 0
    answered, seen = scope_batch._answered, []

    def short_of_memory(colons, worlds, seconds, answer):
        seen.append(len(worlds))
        if len(worlds) > 1:
            raise MemoryError("cuMemAlloc_v2: out of memory")
        return answered(colons, worlds, seconds, answer)

    monkeypatch.setattr(scope_batch, "_answered", short_of_memory)
    again = {result.job: result for result in LINEAR.start(study, tmp_path)(_jobs(study))}
    assert seen == [2, 1, 1]
    assert again[0].scores["push_force_peak_N"] == pytest.approx(soft, rel=1e-3)


def test_rows_do_not_depend_on_the_order_of_jobs(study: Study, tmp_path: Path) -> None:
    """A wire of 5 N bends the tip less than one of 80 N, whichever job comes first, and as each does alone."""
    pulls = Variable(name="pull", path="design.wires.pull_limit", unit="N", nominal=20.0, low=1.0, high=100.0)
    limits = Variable(name="right", path="design.limits.right", unit="deg", nominal=160.0, low=10.0, high=180.0)
    torque = Variable(name="torque", path="scene.torque_limit", unit="N m", nominal=1.0, low=1e-4, high=5.0)
    start = Variable(name="start", path="scene.start_depth", unit="m", nominal=0.03, low=0.02, high=0.1)
    study = replace(study, variables=(pulls, limits, torque, start), options={**study.options, "seconds": 1.6})
    study = replace(study, changes=_SHORT)
    conditions = {name: values[0] for name, values in study.conditions.items()}
    weak = {"pull": 1.0, "right": 160.0, "torque": 1.0, "start": 0.1}
    strong = {"pull": 80.0, "right": 160.0, "torque": 1.0, "start": 0.1}
    straight = {**strong, "right": 12.0}
    shallow = {**strong, "start": 0.03}
    designs = [weak, strong, straight, shallow]
    jobs = [Job(id=i, design=i, variables=each, conditions=conditions) for i, each in enumerate(designs)]

    def rows(some: list[Job]) -> dict[int, dict]:
        return {one.job: dict(one.scores) for one in LINEAR.start(study, tmp_path)(some)}

    forth, back = rows(jobs), rows(jobs[::-1])
    alone = {jobs[0].id: rows(jobs[:1])[jobs[0].id]}
    for name in ("insertion_m", "tip_arc_max_m", "push_force_peak_N", "torque_peak_Nm", "wall_force_peak_N"):
        for job in jobs:
            assert forth[job.id][name] == pytest.approx(back[job.id][name], rel=1e-3, abs=1e-6), (name, job.id)
        for job, row in alone.items():
            assert forth[job][name] == pytest.approx(row[name], rel=1e-3, abs=1e-6), (name, job)
    ways = [(round(row["wall_force_peak_N"], 3), round(row["tip_arc_max_m"], 4)) for row in forth.values()]
    assert len(set(ways)) == len(jobs)
    assert forth[3]["insertion_m"] == pytest.approx(forth[1]["insertion_m"] - 0.07, abs=0.02)


def test_colons_of_a_study_move_when_asked(study: Study, tmp_path: Path) -> None:
    """A bend that hangs by a sigmoid's mesentery takes less push, natively too."""
    cells = {**_SHORT, "scene.insertion_limit": 0.3}
    study = replace(study, changes=cells)
    moving = replace(study, options={**study.options, "mesentery": True})
    jobs = _jobs(study)[1:2]
    fixed, moved = (next(iter(LINEAR.start(each, tmp_path)(jobs))) for each in (study, moving))
    assert fixed.state == moved.state == "finished"
    pushes = [float(one.scores["push_force_peak_N"] or 0) for one in (fixed, moved)]
    assert 0 < pushes[1] < pushes[0]
    assert scope.NATIVE.prepare
    scope.NATIVE.prepare(moving, tmp_path, lambda text: None)
    native = next(iter(scope.NATIVE.start(moving, tmp_path)(jobs)))
    assert native.state == "finished"
    assert float(native.scores["push_force_peak_N"] or 0) == pytest.approx(pushes[1], rel=0.25)


def test_mujoco_warp_answers_too(study: Study, tmp_path: Path) -> None:
    """A scope in a colon that moves, by MuJoCo's own dynamics in batch: pushes and forces within a tenth."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    from haustra.envs.study.scope_warp import WARP

    moving = replace(study, options={**study.options, "mesentery": True, "seconds": 8.0})
    moving = replace(moving, changes={**_SHORT, "scene.insertion_limit": 0.3})
    assert WARP.prepare
    WARP.prepare(moving, tmp_path, lambda text: None)
    mine, theirs = (next(iter(each.start(moving, tmp_path)(_jobs(study)[1:2]))) for each in (WARP, LINEAR))
    assert mine.state == theirs.state == "finished", mine.reason
    for name in ("push_force_peak_N", "wall_force_mean_N", "tip_arc_max_m"):
        assert mine.scores[name] == pytest.approx(theirs.scores[name], rel=0.1), name
