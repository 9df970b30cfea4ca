"""The trial of demonstrations: arms differ in what they are shown alone, and its page says what its numbers say."""

from pathlib import Path

import pytest

from haustra.scripts.bench.pages.teaching_page import teaching_page
from haustra.scripts.bench.teaching import Lesson, gains, interval

LESSON = Lesson(training="insertion-easy", episodes=20, steps=1000, seeds=3, held_out=4, seconds=60.0)


def test_arms_differ_in_demonstrations_and_nothing_else():
    arms = LESSON.arms(Path("shown"))
    assert arms["endoscopist, then rewards"] == {"demonstrations": str(Path("shown/endoscopist"))}
    assert arms["rewards alone"] == {}
    assert LESSON.bare(2).seed == 2 and LESSON.bare(2).steps == 1000
    assert LESSON.task.seeds == (0, 20) and LESSON.task.mesentery


def test_intervals_are_students():
    assert interval([1.0, 2.0, 3.0]) == pytest.approx([2.0, 2.0 - 2.484, 2.0 + 2.484], abs=1e-3)
    assert interval([1.0]) == [1.0, 1.0, 1.0]


def test_the_page_tells_better_from_not_told_apart():
    others = ("rewards alone", "rewards alone, as shipped trainings explore")
    progress = {"endoscopist, then rewards": [0.6, 0.7, 0.65], others[0]: [0.1, 0.2, 0.1], others[1]: [0.6, 0.75, 0.6]}
    arms = {name: {"progress": row, "completion": [0.0], "peak_force_N": [5.0]} for name, row in progress.items()}
    driver = {"shown_steps": 9, "progress": 0.7, "completion": 0.5, "peak_force_N": 6.0}
    table = {"lesson": vars(LESSON), "teachers": {"endoscopist": driver}, "arms": arms, "gains": gains(arms)}
    page = teaching_page({"lessons": [table]})
    assert "it gets further than rewards alone (+0.517" in page
    assert "is not told apart from rewards alone, as shipped trainings explore" in page
    assert "--steps 1000" in page and "| endoscopist, the driver itself | 0.70 | 0.50 | 6.0 |" in page
