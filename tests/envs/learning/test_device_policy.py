"""Any device is trained, judged and run by a policy as scopes are: taught by its own driver, then by reward."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("safetensors")

from haustra.envs.learning.curve import read_curve
from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.evaluate_device import evaluate_device
from haustra.envs.learning.hands import require_shown
from haustra.envs.learning.pilot import Pilot
from haustra.envs.learning.policy import (
    SHIPPED_POLICIES,
    MlpPolicy,
    load_any_policy,
    load_policy,
    policy_folder,
    save_policy,
)
from haustra.envs.learning.settings import Training
from haustra.envs.learning.train import train
from haustra.envs.runs.device_run import run_device
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.device_task import DeviceRules, DeviceTask, entries_of
from haustra.envs.tasks.drivers import OwnDriver
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.store import save_colon
from haustra.models.device_scene import device_options
from haustra.models.devices.base import DeviceReadings, load_device
from haustra.scripts.main import SUCCESS, main
from tests.task_bank import short_bank
from tests.tube_colon import straight_tube

RULES = DeviceRules(device="capsule", friction=(0.05, 0.05), wall_stiffness=(1000.0, 1000.0), seconds=4.0)
CAPSULE = load_device("capsule")
THRUSTER = replace(CAPSULE, led_by="wrench", frame="own")
"""A capsule that pushes and turns itself."""


def any_policy(rules: DeviceRules) -> MlpPolicy:
    """Weights at random: it goes somewhere."""
    random, entries, actions = np.random.default_rng(0), entries_of(CAPSULE), len(CAPSULE.controls)
    weights = (random.normal(size=(actions, entries)).astype(np.float32) / 10,)
    return MlpPolicy(weights, (np.zeros(actions, np.float32),), "tanh", False, TaskConfig(), drives=rules)


def test_a_device_is_trained_and_leaves_a_policy_of_plain_numbers(tmp_path: Path) -> None:
    training = Training(
        steps=128, leg=64, worlds=4, imitate=64, rollout=16, batch=32, epochs=2, layers=(16,), drives=RULES
    )
    done = train(training, tmp_path, bank=short_bank(), threads=1)
    assert done["steps"] >= 128
    policy = load_any_policy(tmp_path)
    assert policy.drives == RULES and policy.widths == (entries_of(CAPSULE), len(CAPSULE.controls))
    assert policy.interval == RULES.control_interval
    with pytest.raises(InvalidOptionError, match="drives 'capsule'"):
        load_policy(tmp_path)


def test_a_curve_of_a_device_has_no_column_of_pain(tmp_path: Path) -> None:
    rules = replace(RULES, seconds=0.4)
    training = Training(steps=256, leg=256, worlds=16, imitate=0, rollout=16, batch=64, epochs=1, drives=rules)
    train(training, tmp_path, bank=short_bank(), threads=1)
    curve = read_curve(tmp_path / "curve.csv")
    assert "pain" not in curve and (curve["episodes"] >= 16).all() and (curve["progress"] <= 1).all()


@pytest.mark.parametrize("wrong", [{"learner": "device"}, {"ease": (60.0, 0.5)}, {"task": TaskConfig(design="adult")}])
def test_what_only_scopes_have_is_refused(wrong: dict) -> None:
    with pytest.raises(InvalidOptionError, match="another device than a scope"):
        Training(drives=RULES, **wrong)


def test_drivers_are_judged_in_the_same_episodes() -> None:
    tubes = [straight_tube(0.3), straight_tube(0.5)]
    tasks = [DeviceTask(replace(RULES, friction=(0.03, 0.1)), colons=tubes, worlds=count) for count in (1, 3)]
    one, many = (evaluate_device(OwnDriver, "own", task, episodes=2) for task in tasks)
    assert [row["seed"] for row in one.rows()] == [0, 1, 1000, 1001]
    for left, right in zip(one.episodes, many.episodes, strict=True):
        assert (left.colon, left.friction, left.outcome) == (right.colon, right.friction, right.outcome)
        assert left.progress == pytest.approx(right.progress, abs=1e-9)
    assert one.further_than(many)["more"] == pytest.approx(0.0, abs=1e-9)
    summary = one.summary()
    assert summary["outcomes"] == {"time_up": 4} and 0.1 < summary["progress"] < 1.0


def test_a_pilot_in_a_single_run_does_what_the_policy_does_in_episodes() -> None:
    """At the interval of runs: a device's own laws are asked once in each."""
    rules, tube = replace(RULES, control_interval=CONTROL_INTERVAL), straight_tube(0.5)
    policy = any_policy(rules)
    task, driver = DeviceTask(rules, device=THRUSTER, colons=[tube]), PolicyDriver(policy)
    seen = task.reset(seeds=[0])
    driver.begin(np.ones(1, bool))
    for _ in range(round(2.0 / CONTROL_INTERVAL)):
        seen = task.step(driver.act(seen)).observation
    options = device_options(THRUSTER, mesentery=False, friction=0.05, wall_stiffness=1000.0)
    pilot = Pilot(policy, THRUSTER, length=tube.centreline.length)
    run = run_device(THRUSTER, tube, options, seconds=2.0, pilot=pilot, driver="any")
    assert run.records["tip_arc"][-1] == pytest.approx(float(task.backend.read().tip_arc[0]), abs=1e-9)
    assert run.configuration["driver"] == "any"


def test_a_pilot_decides_at_the_policys_own_pace() -> None:
    tube, decided = straight_tube(0.5), list[np.ndarray]()
    pilot = Pilot(any_policy(replace(RULES, control_interval=4 * CONTROL_INTERVAL)), THRUSTER, length=0.5)

    def watched(seen: DeviceReadings, own: dict) -> np.ndarray:
        decided.append(pilot(seen, own)[0].copy())
        return decided[-1][None]

    run_device(THRUSTER, tube, device_options(THRUSTER, mesentery=False), seconds=0.32, pilot=watched)
    changed = [number for number in range(1, len(decided)) if not np.array_equal(decided[number], decided[number - 1])]
    assert changed == [4, 8, 12]


def test_a_pilot_of_another_device_is_refused(tmp_path: Path) -> None:
    policy = load_any_policy(save_policy(tmp_path, any_policy(RULES)))
    with pytest.raises(InvalidOptionError, match="not trained for a device like"):
        Pilot(policy, load_device("vine"), length=1.0)
    with pytest.raises(InvalidOptionError, match="moved in the patient's axes"):
        Pilot(policy, CAPSULE, length=1.0)


def test_each_repeat_of_a_run_has_a_pilot_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A repeat with nothing finer is the run itself; a pilot that had driven before would hold its last commands."""
    device, errors = load_device("inchworm"), []
    weights = np.random.default_rng(0).normal(size=(len(device.controls), entries_of(device))).astype(np.float32)
    drives = replace(RULES, device="inchworm")
    policy = MlpPolicy((weights,), (np.zeros(len(weights), np.float32),), "tanh", False, TaskConfig(), drives=drives)
    own = str(save_policy(tmp_path / "policy", policy))
    save_colon(straight_tube(0.3), tmp_path / "colon")
    write = lambda folder, *, error, **_: errors.append(error) or {}  # noqa: E731
    monkeypatch.setattr("haustra.envs.view.device_folder.write_device_run", write)
    monkeypatch.setattr("haustra.envs.runs.error.half_step", lambda options: {"again": options})
    call = ["run", "--colon", str(tmp_path / "colon"), "--device", "inchworm", "--driver", own, "--fixed", "--error"]
    assert main([*call, "--seconds", "0.2", "-o", str(tmp_path / "run"), "--json"]) == SUCCESS
    assert set(errors[0].differences["again"].values()) == {0.0}


def test_a_policy_of_another_device_drives_no_scope() -> None:
    with pytest.raises(UnsupportedSceneError, match="drives 'inchworm': name one for a scope"):
        require_shown(load_any_policy(policy_folder("inchworm")))


@pytest.mark.parametrize("name", SHIPPED_POLICIES)
def test_policies_that_ship_drive_what_they_are_named_for(name: str) -> None:
    policy = load_any_policy(policy_folder(name))
    if name in ("inchworm", "tracked"):
        assert policy.drives is not None and policy.drives.device.startswith(name)
    else:
        assert policy.drives is None and policy.config.task == ("withdrawal" if name == "withdrawal" else "insertion")
