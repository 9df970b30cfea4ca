"""Training where the physics is, at a size for tests, on the CPU."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("safetensors")

from haustra.envs.learning.device_run import BEST, DeviceRun, _fitting
from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.policy import load_policy
from haustra.envs.learning.settings import Training, shipped
from haustra.envs.learning.train import train
from haustra.envs.tasks import scope_task
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.inspect_driver import InspectDriver
from haustra.envs.tasks.observation import flat, sizes
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.models.gas.law import MMHG
from tests.envs.tasks.test_withdrawal import pushed_in
from tests.task_bank import DESIGN, moving_bank, short_bank

SMALL = Training(
    learner="device",
    backend="linear",
    steps=768,
    leg=256,
    worlds=16,
    rollout=8,
    batch=64,
    epochs=2,
    layers=(16,),
    imitate=0,
    normalise=True,
    stagger=True,
    critic_knows=True,
    most_p_perforation=0.002,
    most_pain=0.01,
    log_std=-0.7,
    first_push=0.4,
    task=TaskConfig(design=DESIGN, limits=Limits(seconds=1.0)),
)


def run(training: Training, folder: Path, **options) -> dict:
    return train(training, folder, bank=short_bank(), threads=1, **options)


def test_a_resumed_run_is_the_same_run(tmp_path):
    whole = run(SMALL, tmp_path / "whole")
    run(replace(SMALL, steps=256), tmp_path / "parts")
    parts = run(SMALL, tmp_path / "parts", resume=True)
    assert whole["steps"] == parts["steps"] == 768 and whole["price_pain"] == parts["price_pain"] > 0.1
    for name in ("policy.safetensors", "curve.csv"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "parts" / name).read_bytes()
    policy = load_policy(tmp_path / "whole")
    assert policy.config == SMALL.task, "the policy does not read what only the critic knows"
    with (tmp_path / "whole" / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert sum(int(row["episodes"]) for row in rows) > 16 and all(float(row["seconds"]) <= 1.0 for row in rows)


def test_a_policy_sees_depth_alone_while_its_critic_reads_all(tmp_path):
    alone = replace(SMALL, steps=256, recalls=(1.0,), task=replace(SMALL.task, observation="lumen"))
    run(alone, tmp_path)
    policy = load_policy(tmp_path)
    assert policy.config.observation == "lumen" and policy.weights[0].shape[1] == 2 * (27 + 4)
    driver = PolicyDriver(policy)
    driver.begin(np.ones(2, bool))
    seen = {"lumen": np.ones((2, 27), np.float32)}
    first = driver.act(seen)
    assert first.shape == (2, 4)
    assert not np.array_equal(driver.act(seen), first), "it knows what it did before"
    driver.begin(np.ones(2, bool))
    assert np.array_equal(driver.act(seen), first), "and forgets it where an episode begins"
    own = shipped("insertion-depth")
    assert set(sizes(own.task)) == {"lumen"} and set(sizes(own.shown)) == {"state", "lumen", "privileged"}


def test_a_policy_of_a_task_with_a_gas_action_lets_gas_in(tmp_path):
    """It reads what is shown of the gas, and its fifth action is gas."""
    gassed = replace(SMALL.task, mesentery=True, gas=12 * MMHG, gas_start=12 * MMHG, gas_action=True)
    train(replace(SMALL, steps=256, task=gassed), tmp_path, bank=moving_bank(), threads=1)
    policy = load_policy(tmp_path)
    assert policy.config == gassed and sizes(gassed)["gas"] == (3,)
    seen = {name: np.zeros((2, *shape), np.float32) for name, shape in sizes(gassed).items()}
    assert policy.act(flat(seen)).shape == (2, 5) and policy.deviation is not None and policy.deviation.shape == (5,)


def test_costs_of_an_episode_come_to_what_it_did(tmp_path):
    """Every step costs what was added to P(perforation) and the largest pain: their sums are the episode's own."""
    task = ScopeTask(SMALL.shown, worlds=SMALL.worlds, backend="linear", bank=short_bank())
    learns = DeviceRun(replace(SMALL, rollout=24, stagger=False), tmp_path, task, None, lambda done, note: None)
    learns._begin(0)
    began = learns._before.clone()
    rollout, _, ended = learns._drive()
    task.close()
    for merit, kept in ((0.3, 0.3), (0.2, 0.3), (0.4, 0.4)):
        learns.learner.log_std.data.fill_(-merit)
        learns._keep_best(merit)
        assert load_policy(tmp_path / BEST).deviation == pytest.approx(np.exp(-kept), rel=1e-6)
    assert not rollout.over.any() and len(ended) == 0
    info = task.info()
    found = (began + rollout.paid[:, :, 1:].sum(0)).numpy()
    np.testing.assert_allclose(found, np.stack([info["p_perforation"], info["pain"]], axis=1), rtol=1e-4, atol=1e-6)
    assert found[:, 1].min() > 0
    np.testing.assert_array_equal(rollout.seen[-1, :, :-18], np.concatenate(learns._observed, axis=1))


def test_a_run_begins_as_a_trained_policy(tmp_path):
    run(replace(SMALL, steps=256), tmp_path / "first")
    held = replace(SMALL, steps=256, start=str(tmp_path / "first"))  # two rollouts, in which only the critic learns
    run(held, tmp_path / "second")
    one, other = (load_policy(tmp_path / name) for name in ("first", "second"))
    seen = {"state": np.ones((3, 18)), "lumen": np.linspace(0, 1, 81).reshape(3, 27)}
    np.testing.assert_allclose(one.act(flat(seen)), other.act(flat(seen)), atol=1e-4)
    assert one.deviation == pytest.approx(other.deviation, rel=1e-6)
    for wrong in (replace(held, layers=(8,)), replace(held, task=replace(SMALL.task, imager=True))):
        with pytest.raises(InvalidOptionError, match="set the same"):
            _fitting(wrong)


def test_what_the_device_does_not_do_is_refused():
    for name, value in (("algorithm", "sac"), ("backend", "native"), ("imitate", 10), ("device", "cuda")):
        with pytest.raises(InvalidOptionError, match="'device'"):
            replace(SMALL, **{name: value})
    with pytest.raises(InvalidOptionError, match="most_pain is for the learner 'device'"):
        Training(most_pain=1.0)
    own = shipped("insertion")
    assert own.learner == "device" and own.most_p_perforation == 0.002


def test_a_withdrawal_is_taught_by_who_inspects_before_rewards_count(tmp_path, monkeypatch):
    """The policy does after teaching what the teacher does, and rewards go on from there."""
    monkeypatch.setattr(scope_task, "inserted_starts", lambda *_, **__: pushed_in())
    task = TaskConfig(design=DESIGN, task="withdrawal", mesentery=True, limits=Limits(seconds=20.0))
    taught = replace(SMALL, task=task, worlds=4, steps=64, leg=64, imitate=1200, layers=(32,), log_std=-3.0)
    about = {"bank": moving_bank(), "threads": 1}
    train(taught, tmp_path / "run", **about)
    assert (tmp_path / "run" / "curve.csv").read_text().rstrip().endswith("coverage")
    policy = load_policy(tmp_path / "run")
    # What the critic reads is left aside; the program is that of the training.
    scopes = ScopeTask(taught.shown, worlds=2, backend="linear", bank=moving_bank())
    seen = scopes.reset(seeds=[0, 1])
    teacher = InspectDriver(scopes)
    teacher.begin(np.ones(2, bool))
    missed, size = [], []
    for _ in range(50):
        asked = teacher.act(seen)
        missed.append(policy.act(flat({name: seen[name] for name in sizes(taught.task)})) - asked)
        size.append(asked)
        seen = scopes.step(asked).observation
    assert np.square(missed).mean() < 0.5 * np.square(size).mean()
    with pytest.raises(InvalidOptionError, match="withdrawals"):
        replace(taught, recalls=(1.0,))
