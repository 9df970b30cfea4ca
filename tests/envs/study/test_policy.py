"""Designs judged under drivers that were trained with them, at a size for tests."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from haustra.envs.learning.policy import MlpPolicy, load_policy, save_policy
from haustra.envs.study import policy_training
from haustra.envs.study.questions import find_backend
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.study_file import load_study, read_study
from haustra.envs.tasks.bank import make_bank
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.observation import sizes
from haustra.errors import InvalidOptionError, InvalidStudyError
from tests.task_bank import DESIGN, short_bank

TASK = TaskConfig(design=DESIGN, limits=Limits(seconds=2.0))


def start(folder: Path) -> str:
    """A policy that pushes, whatever it sees."""
    seen = sum(size[0] for size in sizes(TASK).values())
    layers = [np.zeros((4, seen), np.float32), np.zeros((4, 4), np.float32)]
    biases = [np.zeros(4, np.float32), np.array([0.9, 0, 0.9, 0], np.float32)]
    save_policy(folder, MlpPolicy(tuple(layers), tuple(biases), "tanh", False, TASK, {}, np.full(4, 0.3, np.float32)))
    return str(folder)


def study(folder: Path, **options):
    own = {"start": start(folder / "start"), "steps": 640, "worlds": 1, "colons": 1, "held_out": 1, "episodes": 2}
    table = {
        "question": "policy",
        "base": {"design": DESIGN},
        "options": own | options,
        "variables": [
            {"name": "EI", "path": "design.shaft.*.flexural_rigidity", "unit": "N m^2"}
            | {"nominal": 0.018, "low": 0.01, "high": 0.03, "values": [0.01, 0.03], "distribution": "choice"}
        ],
        "conditions": {"seed": [3]},
        "objectives": [{"score": "completion", "goal": "maximise"}],
        "sampler": {"kind": "grid"},
    }
    return read_study(table, folder / "study.toml")


def test_each_design_is_driven_by_what_learned_with_it(tmp_path, monkeypatch):
    designs = []

    def bank(seeds, design, **_):
        designs.append(design)
        return make_bank(short_bank().cases[:1], design, short_bank().options)

    monkeypatch.setattr(policy_training, "grown_bank", bank)
    asked = study(tmp_path)
    run = find_backend("policy", "linear").start(asked, tmp_path)
    rows = list(run(list(jobs_of(asked, designs_of(asked)))))
    assert [row.state for row in rows] == ["finished", "finished"], [row.reason for row in rows]
    assert len({one.shaft[0].flexural_rigidity for one in designs}) == 2
    for row in rows:
        about = load_policy(tmp_path / "policies" / str(row.job)).about
        assert row.scores["training_steps"] == about["steps"] == 640
        assert about["training"]["seed"] == 3 and about["training"]["start"].endswith("start")
        assert row.scores["progress"] != row.scores["progress_before"]
    befores = {row.scores["peak_force_N_before"] for row in rows}
    assert len(befores) == 2, "the same policy moves a stiffer shaft otherwise"


def test_what_cannot_be_trained_is_refused(tmp_path):
    with pytest.raises(InvalidStudyError, match="not of the learner 'device'"):
        study(tmp_path, training="quick")
    with pytest.raises(InvalidStudyError, match="nowhere"):
        study(tmp_path, start="nowhere")
    with pytest.raises(InvalidOptionError, match="does not answer"):
        find_backend("policy", "native")
    assert load_study("policy-stiffness").options["start"] == "insertion"
