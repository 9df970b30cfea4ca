"""What a cohort costs, part by part."""

import json
from pathlib import Path

from haustra.envs.study.costs import COSTS, costs, counted


def test_what_processes_do_at_the_same_time_counts_once(tmp_path: Path) -> None:
    spans = [("stepping", 0.0, 10.0), ("stepping", 5.0, 20.0), ("growing", 0.0, 2.0), ("stepping", 30.0, 31.0)]
    lines = [json.dumps({"part": part, "began": began, "ended": ended}) + "\n" for part, began, ended in spans]
    (tmp_path / COSTS).write_text("".join(lines), encoding="utf-8")
    assert costs(tmp_path) == {"stepping": 21.0, "growing": 2.0}


def test_a_part_is_noted_also_where_it_fails(tmp_path: Path) -> None:
    assert costs(tmp_path) == {}
    try:
        with counted(tmp_path, "growing"):
            raise ValueError
    except ValueError:
        pass
    assert set(costs(tmp_path)) == {"growing"}
