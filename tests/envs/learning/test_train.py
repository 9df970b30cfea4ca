"""Training at a size for tests: it learns, resumes to the bit, and leaves a policy of plain numbers."""

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("safetensors")

from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.evaluate import evaluate
from haustra.envs.learning.policy import load_policy, save_policy
from haustra.envs.learning.schedule import learning_rate, perforation_force
from haustra.envs.learning.settings import SHIPPED, Training, shipped
from haustra.envs.learning.train import train
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver, RandomDriver
from haustra.envs.tasks.observation import flat
from haustra.errors import InvalidOptionError, UnreadableFileError
from haustra.models.gas.law import MMHG
from tests.task_bank import DESIGN, moving_bank, short_bank

TASK = TaskConfig(design=DESIGN, limits=Limits(seconds=8.0))
SMALL = Training(
    steps=256, leg=128, worlds=4, imitate=0, rollout=16, batch=32, epochs=2, layers=(16,), buffer=512, task=TASK
)


def run(training: Training, folder: Path, **options) -> dict:
    return train(training, folder, bank=short_bank(), threads=1, **options)


@pytest.mark.parametrize("algorithm", ["ppo", pytest.param("sac", marks=pytest.mark.thorough)])
def test_a_resumed_run_is_the_same_run_and_leaves_no_logs_elsewhere(tmp_path, monkeypatch, algorithm):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    training = replace(SMALL, algorithm=algorithm, steps=384 if algorithm == "ppo" else 256)
    run(training, tmp_path / "whole")
    first = run(replace(training, steps=128), tmp_path / "parts")
    less = load_policy(tmp_path / "parts")
    run(training, tmp_path / "parts", resume=True)
    whole, parts = load_policy(tmp_path / "whole"), load_policy(tmp_path / "parts")
    for one, other in zip(whole.weights, parts.weights, strict=True):
        assert np.array_equal(one, other)
    assert first["steps"] == 128
    assert not np.array_equal(less.weights[0], whole.weights[0])
    assert not list((tmp_path / "temporary").glob("SB3*"))


def test_thousands_of_worlds_at_a_size_for_tests(tmp_path):
    """The shipped GPU training, but for its sizes: runs in linear time, stops when time is up, and resumes."""
    sizes = {"worlds": 16, "steps": 1024, "leg": 1024, "rollout": 16, "batch": 64, "layers": (16,)}
    training = replace(shipped("insertion-gpu"), backend="linear", device="cpu", **sizes)
    training = replace(training, task=replace(training.task, design=DESIGN, limits=Limits(seconds=8.0)))
    first = run(training, tmp_path, minutes=0.0)
    assert first["time_up"] and first["steps"] == 16 * 17  # a whole rollout, and the step at which it stops
    before = json.loads((tmp_path / "checkpoint.json").read_text())["normaliser"]["seen"]
    done = run(training, tmp_path, resume=True)
    assert not done["time_up"] and done["steps"] >= 1024
    after = json.loads((tmp_path / "checkpoint.json").read_text())["normaliser"]["seen"]
    assert after[2] > before[2] and before[0] != after[0]
    assert load_policy(tmp_path).config == training.task


def test_time_may_be_up_while_a_policy_still_imitates(tmp_path):
    """It tells how far it is after every step, and leaves what it has learned."""
    told: list[str] = []
    training = replace(SMALL, imitate=100_000)
    done = run(training, tmp_path, minutes=0.0, progress=lambda _, note: told.append(note or ""))
    assert done["time_up"] and done["steps"] < training.steps
    assert "4 steps" in told[0]
    assert load_policy(tmp_path).config == training.task


def test_a_policy_learns_gas_from_the_follower_and_from_reward(tmp_path):
    """The follower leaves gas to the insufflator: it lets all in below the set point."""
    task = replace(
        TASK, mesentery=True, gas=15 * MMHG, gas_start=12 * MMHG, gas_action=True, limits=Limits(seconds=2.0)
    )
    training = replace(SMALL, steps=128, worlds=2, imitate=64, backend="linear", task=task)
    train(training, tmp_path, bank=moving_bank(), threads=1)
    policy = load_policy(tmp_path)
    found = evaluate(
        lambda _: PolicyDriver(policy), "own", task, moving_bank(), episodes=1, threads=1, backend="linear"
    )
    assert all(one.gas_volume_mL for one in found.episodes)
    assert policy.weights[-1].shape == (5, 16)


def test_a_policy_has_the_scaling_of_its_inputs_in_its_layers():
    from stable_baselines3.common.vec_env import VecNormalize

    from haustra.envs.learning.models import build_model, normalised, policy_of
    from haustra.envs.tasks.sb3 import TaskVecEnv
    from haustra.envs.tasks.scope_task import ScopeTask

    training = replace(SMALL, normalise=True, first_push=0.3, log_std=-20.0)
    worlds = normalised(training, TaskVecEnv(ScopeTask(TASK, worlds=4, bank=short_bank()), flat=True))
    assert isinstance(worlds, VecNormalize)
    model = build_model(training, worlds, None)
    worlds.seed(0)
    worlds.reset()
    for _ in range(5):
        worlds.step(np.random.default_rng(0).uniform(-1, 1, (4, 4)).astype(np.float32))
    bare: Any = worlds.get_original_obs()
    ours = policy_of(model, training, {}, worlds).act(bare)
    theirs, _ = model.predict(worlds.normalize_obs(bare), deterministic=True)
    assert ours == pytest.approx(theirs, abs=1e-5)
    assert ours[:, 0] == pytest.approx(0.3, abs=0.2)


def test_a_policy_draws_actions_as_in_training(tmp_path):
    """Mean and deviation of many draws; the deviation survives the file; the same seed draws the same."""
    from haustra.envs.learning.drivers import PolicyDriver
    from haustra.envs.learning.policy import MlpPolicy, save_policy
    from haustra.envs.tasks.observation import sizes

    about: Any = {"activation": "tanh", "squashed": False, "config": TASK}
    layers = {
        "weights": (np.zeros((4, sum(int(np.prod(shape)) for shape in sizes(TASK).values()))),),
        "biases": (np.array([0.1, 0.0, -0.2, 0.0]),),
    }
    save_policy(tmp_path, MlpPolicy(**layers, **about, deviation=np.array([0.05, 0.1, 0.2, 0.0])))
    policy = load_policy(tmp_path)
    seen = {name: np.zeros((20_000, *shape)) for name, shape in sizes(TASK).items()}
    drawn = PolicyDriver(policy, sampled=True, seed=3).act(seen)
    assert drawn.mean(axis=0) == pytest.approx([0.1, 0.0, -0.2, 0.0], abs=0.005)
    assert drawn.std(axis=0) == pytest.approx([0.05, 0.1, 0.2, 0.0], abs=0.005)
    assert np.array_equal(drawn, PolicyDriver(policy, sampled=True, seed=3).act(seen))
    assert np.ptp(PolicyDriver(policy).act(seen), axis=0) == pytest.approx(0)
    with pytest.raises(InvalidOptionError, match="means"):
        PolicyDriver(MlpPolicy(**layers, **about), sampled=True).act(seen)


def test_what_changes_over_a_training():
    training = replace(SMALL, steps=1000, anneal=True, ease=(47.0, 0.5))
    last = training.task.limits.perforation_force
    assert [perforation_force(training, steps) for steps in (0, 250, 500, 900)] == [47.0, (47.0 + last) / 2, last, last]
    assert [learning_rate(training, steps) for steps in (0, 1000)] == pytest.approx([3e-4, 3e-5])
    with pytest.raises(InvalidOptionError, match="ease"):
        replace(SMALL, ease=(1.0, 0.5))
    for task in (TaskConfig(observation="depth"), TaskConfig(depth=True), TaskConfig(observation="pixels")):
        with pytest.raises(InvalidOptionError, match="no network for pictures"):
            Training(task=task)
    with pytest.raises(InvalidOptionError, match="ask for observation 'dict'"):
        Training(task=TaskConfig(observation="state", depth=True))
    with pytest.raises(InvalidOptionError, match="normalise"):
        replace(SMALL, normalise=True, imitate=100)


def test_a_folder_with_a_run_is_not_overwritten(tmp_path):
    run(replace(SMALL, steps=64, leg=64), tmp_path)
    with pytest.raises(InvalidOptionError, match="resume"):
        run(SMALL, tmp_path)
    with pytest.raises(UnreadableFileError, match="checkpoint"):
        run(SMALL, tmp_path / "empty", resume=True)


@pytest.mark.thorough
def test_a_short_training_beats_chance(tmp_path):
    training = replace(SMALL, steps=2048, leg=2048, worlds=8, imitate=4800, layers=(64,), rollout=64, batch=256)
    run(training, tmp_path)
    policy = load_policy(tmp_path)
    config = replace(TASK, limits=Limits(seconds=12.0))
    drivers = {"policy": lambda task: PolicyDriver(policy), "random": RandomDriver, "follower": FollowerDriver}
    ways = {
        name: evaluate(make, name, config, short_bank(), episodes=3, threads=1).summary()["progress"]
        for name, make in drivers.items()
    }
    assert ways["policy"] > ways["random"] + 0.3
    assert ways["follower"] > 0.9


def test_a_policy_reads_as_it_was_written_and_rubbish_is_refused(tmp_path):
    run(replace(SMALL, steps=64, leg=64), tmp_path)
    policy = load_policy(tmp_path)
    save_policy(tmp_path / "again", policy)
    seen = {"state": np.ones((2, 18), np.float32), "lumen": np.zeros((2, 27), np.float32)}
    assert np.array_equal(policy.act(flat(seen)), load_policy(tmp_path / "again").act(flat(seen)))
    document = json.loads((tmp_path / "policy.json").read_text())
    for spoiled in ("", "{}", json.dumps(document | {"layers": 5}), json.dumps(document | {"task": {"smell": 1}})):
        (tmp_path / "policy.json").write_text(spoiled)
        with pytest.raises(UnreadableFileError, match="policy"):
            load_policy(tmp_path)
    (tmp_path / "policy.json").write_text(json.dumps(document))
    (tmp_path / "policy.safetensors").write_bytes(b"\x08\x00\x00\x00\x00\x00\x00\x00rubbish!")
    with pytest.raises(UnreadableFileError):
        load_policy(tmp_path)


def test_stable_baselines_files_need_trust(tmp_path):
    from haustra.envs.learning.sb3_zip import load_zip

    with pytest.raises(InvalidOptionError, match="--trust"):
        load_zip(tmp_path / "model.zip", SMALL, trust=False)
    (tmp_path / "model.zip").write_bytes(b"no zip")
    with pytest.raises(UnreadableFileError):
        load_zip(tmp_path / "model.zip", SMALL, trust=True)


def test_shipped_trainings_are_read_and_never_draw_held_out_colons():
    for name in SHIPPED:
        training = shipped(name)
        assert Training.from_json(json.loads(json.dumps(training.to_json()))) == training
        assert training.task.seeds[1] <= 100_000
    with pytest.raises(InvalidOptionError, match="quick"):
        shipped("slow")
    with pytest.raises(InvalidOptionError, match="stepz"):
        Training.from_json({"stepz": 3})
