"""Ranking, Pareto fronts, effects and comparisons on tables whose answers are known."""

from dataclasses import replace

import numpy as np
import polars
import pytest

from haustra.envs.study.ranking import DesignTable, compare, design_table, interval, main_effect, pareto_front, ranked
from haustra.envs.study.study import ScoreError
from tests.envs.study.studies import study

OBJECTIVES = [{"score": "force_N", "goal": "maximise"}, {"score": "ripple_fraction", "goal": "minimise"}]


def _table(force, ripple) -> DesignTable:
    force, ripple = np.array(force, float), np.array(ripple, float)
    count = len(force)
    return DesignTable(
        study=study(objectives=OBJECTIVES),
        designs=np.arange(count),
        names=tuple(f"design {number}" for number in range(count)),
        variables={"spacing": np.arange(count, dtype=float)},
        scores={"force_N": force, "ripple_fraction": ripple},
    )


def test_a_front_is_what_nothing_beats() -> None:
    points = np.array([[1.0, 4.0], [2.0, 2.0], [4.0, 1.0], [3.0, 3.0], [2.0, 2.0]])
    assert pareto_front(points).tolist() == [True, True, True, False, True]


def test_the_front_comes_first_and_incomplete_designs_not_at_all() -> None:
    # 0 is best in force, 2 in ripple, 1 is beaten by 0, 3 misses a condition.
    table = _table([[3, 3], [2, 2], [1, 1], [9, np.nan]], [[0.2, 0.2], [0.3, 0.3], [0.1, 0.1], [0.0, 0.0]])
    found = ranked(table)
    assert set(found.places[:2].tolist()) == {0, 2}
    assert found.places[2] == 1
    assert found.front.tolist() == [True, True, False]
    assert found.ranks.tolist() == [1, 2, 3]


def test_designs_within_the_numerical_error_share_a_rank() -> None:
    """5 % of 10 N are 0.5 N: 10.0 and 9.7 N are one rank, 9.0 N is another; by the tie, the fourth is fourth."""
    table = _table([[9.0, 9.0], [10.0, 10.0], [9.7, 9.7], [8.9, 8.9]], np.full((4, 2), 0.2))
    assert ranked(table).ranks.tolist() == [1, 2, 3, 4], "nobody measured an error"
    found = ranked(replace(table, errors={"force_N": ScoreError(relative=0.05)}))
    assert found.places.tolist() == [1, 2, 0, 3]
    assert found.ranks.tolist() == [1, 1, 3, 3]
    assert found.front.tolist() == [True, True, False, False]


def test_designs_within_the_interval_over_conditions_share_a_rank() -> None:
    """Differences of 1 and -0.9 N have a mean of 0.05 N and say nothing; of 1 and 0.9 N they do."""
    ripple = np.full((2, 2), 0.2)
    assert ranked(_table([[5.0, 5.0], [6.0, 4.1]], ripple)).ranks.tolist() == [1, 1]
    assert ranked(_table([[5.0, 5.0], [6.0, 5.9]], ripple)).ranks.tolist() == [1, 2]


def test_one_objective_is_enough_to_tell_designs_apart() -> None:
    table = _table([[10.0, 10.0], [10.01, 10.01]], [[0.1, 0.1], [0.3, 0.3]])
    found = ranked(replace(table, errors={"force_N": ScoreError(relative=0.05)}))
    assert found.ranks.tolist() == [1, 2]


def test_a_difference_below_the_numerical_error_is_none() -> None:
    table = _table([[10, 20], [10.2, 20.4]], np.zeros((2, 2)))
    (found,) = compare(table, [0, 1], ["force_N"])
    assert found.surely_differs(1)
    (found,) = compare(replace(table, errors={"force_N": ScoreError(relative=0.03)}), [0, 1], ["force_N"])
    assert not found.surely_differs(1)
    (found,) = compare(replace(table, errors={"force_N": ScoreError(absolute=0.2)}), [0, 1], ["force_N"])
    assert found.surely_differs(1)


def test_an_interval_covers_the_mean_as_often_as_it_says() -> None:
    """95 % of the bootstrap's intervals, less the 2 to 3 that it is known to lack for twenty values."""
    draw = np.random.default_rng(3)
    hits = 0
    for _ in range(100):
        found = interval(draw.normal(1.0, 1.0, 20))
        assert found.low is not None and found.high is not None
        hits += found.low <= 1.0 <= found.high
    assert 86 <= hits <= 99


def test_many_values_have_the_interval_of_a_normal_mean() -> None:
    values = np.random.default_rng(0).normal(5.0, 2.0, 1000)
    found = interval(values)
    assert found.high == pytest.approx(found.mean + 1.96 * values.std(ddof=1) / np.sqrt(1000), rel=1e-4)


def test_one_value_has_no_interval() -> None:
    assert interval(np.array([2.0])).low is None
    assert interval(np.array([2.0, 2.0])).high == 2.0


def test_pairing_sees_a_difference_that_conditions_would_blur() -> None:
    conditions = np.linspace(1, 10, 12)
    table = _table([conditions, conditions + 0.1 + 0.01 * np.sin(conditions)], np.zeros((2, 12)))
    (found,) = compare(table, [0, 1], ["force_N"])
    assert found.each[0].high is not None and found.each[1].low is not None
    assert found.each[0].high > found.each[1].low, "the intervals overlap"
    assert found.surely_differs(1)
    assert found.against_first[1].mean == pytest.approx(0.1, abs=0.01)


def test_only_conditions_that_all_finished_are_compared() -> None:
    (found, _) = compare(_table([[1, 100], [2, np.nan]], [[0, 0], [0, 0]]), [0, 1], ["force_N", "ripple_fraction"])
    assert [each.mean for each in found.each] == [1, 2]


def test_a_main_effect_is_the_mean_at_each_level() -> None:
    at = np.repeat([1.0, 2.0, 3.0], 4)
    score = at**2 + np.tile([-1.0, 1.0, -2.0, 2.0], 3)
    score[0] = np.nan
    effect = main_effect("x", at, score, exact=True)
    assert effect.levels.tolist() == [1, 2, 3]
    assert [each.mean for each in effect.means[1:]] == pytest.approx([4, 9])
    binned = main_effect("x", np.linspace(0, 1, 400), np.linspace(0, 1, 400), exact=False)
    assert len(binned.levels) == 8
    assert binned.means[0].mean == pytest.approx(binned.levels[0])


def test_a_table_puts_jobs_where_they_belong() -> None:
    frame = polars.DataFrame(
        {
            "job": [0, 1, 3],
            "design": [0, 0, 1],
            "spacing": [2.0, 2.0, 3.0],
            "pressure_Pa": [0.0, 0.0, 1.0],
            "force_N": [1.0, None, 4.0],
        }
    )
    table = design_table(frame, study(objectives=[]), ["force_N"])
    np.testing.assert_array_equal(table.scores["force_N"], [[1, np.nan], [np.nan, 4]])
    assert table.variables["pressure_Pa"].tolist() == [0, 1]
