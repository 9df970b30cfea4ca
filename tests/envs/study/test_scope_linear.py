"""Studies of scopes in linear time: one batch for designs of a kind, halved where memory is short."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.study import scope, scope_batch, scope_linear
from haustra.envs.study.pool import Claim, JobMap
from haustra.envs.study.run import answer_all
from haustra.envs.study.sampling import conditions_of, designs_of, jobs_of
from haustra.envs.study.scope_colons import RADIUS_STEP
from haustra.envs.study.scope_linear import LINEAR
from haustra.envs.study.store import open_store
from haustra.envs.study.study import Job, Objective, Result, Sampler, Study, Variable
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.anatomy.store import load_colon, save_colon
from haustra.models.devices.scope.files import find_design
from haustra.models.wall.lumen_table import lumen_table
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
_TORQUE = 1e-3
"""Torque limit below what the tip's weight asks for when it is bent aside [N m]."""


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


@pytest.fixture
def limits(study: Study) -> Study:
    """Six designs that differ in what their limits are and in where they start, lying on their side."""
    variables = (
        Variable(name="pull", path="design.wires.pull_limit", unit="N", nominal=80.0, low=1.0, high=100.0),
        Variable(name="right", path="design.limits.right", unit="deg", nominal=160.0, low=10.0, high=180.0),
        Variable(name="torque", path="scene.torque_limit", unit="N m", nominal=1.0, low=1e-4, high=5.0),
        Variable(name="start", path="scene.start_depth", unit="m", nominal=0.1, low=0.02, high=0.1),
    )
    usual = {variable.name: variable.nominal for variable in variables}
    apart = ({"pull": 1.0}, {}, {"right": 12.0}, {"start": 0.03}, {"torque": _TORQUE}, {"pull": 5.0, "start": 0.05})
    designs = tuple({"name": f"{index}", **usual, **own} for index, own in enumerate(apart))
    return replace(
        study,
        variables=variables,
        sampler=Sampler(kind="list", designs=designs),
        changes={**_SHORT, "scene.gravity.2": -9.81},
        options={**study.options, "seconds": 1.6},
    )


def test_rows_do_not_depend_on_the_order_of_jobs(limits: Study, tmp_path: Path) -> None:
    """Limits of pulls, bends and torque and the start are each design's own, whichever comes first, as alone."""
    answer, jobs = LINEAR.start(limits, tmp_path), list(jobs_of(limits, designs_of(limits)))

    def rows(some: list[Job]) -> dict[int, dict]:
        return {one.job: dict(one.scores) for one in answer(some)}

    forth = rows(jobs)
    _require_same(rows(jobs[::-1]), forth)
    _require_same(rows(jobs[4:] + jobs[:4]), forth)
    alone = [job.id for job in jobs[::2]]
    _require_same({own: rows([jobs[own]])[own] for own in alone}, {own: forth[own] for own in alone})
    ways = [(round(row["wall_force_peak_N"], 3), round(row["tip_arc_max_m"], 4)) for row in forth.values()]
    assert len(set(ways)) == len(jobs)
    weak, usual, straight, shallow, limp, _ = (forth[job.id] for job in jobs)
    assert weak["tip_arc_max_m"] < usual["tip_arc_max_m"] > straight["tip_arc_max_m"]
    assert shallow["insertion_m"] == pytest.approx(usual["insertion_m"] - 0.07, abs=0.02)
    assert limp["torque_peak_Nm"] == pytest.approx(_TORQUE, rel=1e-3)
    assert usual["torque_peak_Nm"] > 2 * _TORQUE


def test_rows_do_not_depend_on_an_interruption(limits: Study, tmp_path: Path) -> None:
    """Whoever stops after a first row and resumes has the others computed in other company, to the same rows."""
    answer, count = LINEAR.start(limits, tmp_path), len(limits.sampler.designs)

    def answers(claim: Claim, *, most: int | None = None) -> Iterator[Result]:
        while jobs := claim(count):
            for done, result in enumerate(answer(jobs), 1):
                yield result
                if done == most:
                    raise KeyboardInterrupt

    def compute(folder: Path, some: JobMap, *, resume: bool = False) -> dict[int, dict]:
        jobs = partial(jobs_of, limits, designs_of(limits))
        with open_store(tmp_path / folder, limits, jobs, kind="sweep", resume=resume) as store:
            store.begin_session(backend="linear", pool="here")
            with suppress(KeyboardInterrupt):
                answer_all(store, some)
            assert len({row["session"] for row in store.rows()}) == len(store.sessions())
            return {row["id"]: row["scores"] for row in store.rows() if row["state"] == "finished"}

    halted = compute(Path("halted"), partial(answers, most=1))
    assert len(halted) == 1
    resumed = compute(Path("halted"), answers, resume=True)
    assert len(resumed) == count and resumed | halted == resumed
    _require_same(resumed, compute(Path("whole"), answers))


def _require_same(found: dict[int, dict], known: dict[int, dict]) -> None:
    assert found.keys() == known.keys()
    for name in ("insertion_m", "tip_arc_max_m", "push_force_peak_N", "torque_peak_Nm", "wall_force_peak_N"):
        for job, row in found.items():
            assert row[name] == pytest.approx(known[job][name], rel=1e-3, abs=1e-6), (name, job)


def test_each_diameter_meets_a_wall_tabulated_for_it(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Folds keep a thick scope further away than by its radius: the base's table, shifted by that, is another wall.

    Colons are tabulated for radii 1 mm apart; in between, tables are made of both neighbours.
    """
    walls: dict[float, tuple[float, np.ndarray]] = {}

    class Spied(scope_linear.LinearInsertions):
        def __init__(self, scene, tables, colons, *, scopes, **own) -> None:
            super().__init__(scene, tables, colons, scopes=scopes, **own)
            self._met = tables, scopes.radius

        def begin(self, case, conditions, given=None) -> None:
            tables, radii = self._met
            for radius, own in zip(radii, case, strict=True):
                rows = slice(tables.first[own], tables.first[own] + tables.count[own])
                walls[float(radius)] = float(tables.device_radius[own]), tables.wall[rows, :, 0]
            super().begin(case, conditions, given)

    monkeypatch.setattr(scope_linear, "LinearInsertions", Spied)
    study = replace(study, changes=_SHORT, options={**study.options, "seconds": 0.5})
    (conditions,), usual = conditions_of(study), find_design("paediatric").diameter
    asked = [{"EI": 0.02, "diameter": diameter} for diameter in (usual, usual + 2e-3, usual - 2e-3, usual + 7e-4)]
    jobs = [Job(id=i, design=i, variables=each, conditions=conditions) for i, each in enumerate(asked)]
    assert {one.state for one in LINEAR.start(study, tmp_path)(jobs)} == {"finished"}
    assert sorted(walls) == pytest.approx(sorted(each["diameter"] / 2 for each in asked))
    colon = load_colon(Path(str(conditions["colon"])))
    base = lumen_table(colon, device_radius=usual / 2).tables.wall[..., 0]
    for radius, (tabulated, wall) in walls.items():
        assert tabulated == pytest.approx(radius, abs=RADIUS_STEP / 2)
        known = lumen_table(colon, device_radius=radius).tables.wall[..., 0]
        assert np.percentile(np.abs(wall - known), 95) < 1e-4
        if abs(radius - usual / 2) > 5e-4:
            assert np.percentile(np.abs(base - (radius - usual / 2) - known), 95) > 2e-4


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
