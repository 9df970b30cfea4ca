"""Environments refuse calls that make no sense, and keep the contracts of those who call them."""

import os
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import NormalizeObservation, RecordEpisodeStatistics, RecordVideo

import haustra.envs
from haustra.envs.tasks.calls import checked_action, whole_steps
from haustra.envs.tasks.device_env import DeviceEnv
from haustra.envs.tasks.navigation import NavigationEnv
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import InvalidOptionError
from haustra.scripts.bench.contracts import check, every_environment
from tests.ring_wall import bent_colon
from tests.task_bank import short_bank
from tests.tube_colon import straight_tube

ASKED: list[tuple[dict[str, Any], str]] = [
    ({"limits": {"seconds": float("nan")}}, "limits.seconds is nan; give 0.002 to 36000 s"),
    ({"limits": {"perforation_force": float("nan")}}, "limits.perforation_force is nan; give 0.01 to 10000 N"),
    ({"limits": {"caecum_margin": 0.4}}, "limits.caecum_margin is 0.4 m; give less than 0.2"),
    ({"weights": {"wall_force": float("nan")}}, "weights.wall_force is nan; give 0 to 10000"),
    ({"drive": {"push_rate": float("nan")}}, "drive.push_rate is nan; give 0.001 to 0.5 m/s"),
    ({"drive": {"wheel_rate": float("nan")}}, "drive.wheel_rate is nan; give 0.05 to 100 1/s"),
    ({"drive": {"hand_lead": -0.01}}, "drive.hand_lead is -0.01; give 0.0001 to 0.1 m"),
    ({"drive": {"control_interval": 0}}, "drive.control_interval is 0; give 0.002 to 1 s"),
    ({"drive": {"control_interval": -0.04}}, "drive.control_interval is -0.04; give 0.002 to 1 s"),
    ({"drive": {"control_interval": float("nan")}}, "drive.control_interval is nan; give 0.002 to 1 s"),
    (
        {"drive": {"control_interval": 0.0041}},
        "control_interval is 0.0041 s; give a whole number of the",
    ),
    ({"randomisation": {"wire_gain": [5, 5]}}, "randomisation.wire_gain[0] is 5; give 0.05 to 1"),
    ({"randomisation": {"wire_slack": [0, 1]}}, "randomisation.wire_slack[1] is 1; give 0 to 0.9"),
    ({"difficulty": "none"}, "difficulty 'none' is not known. Known: any, easy"),
    ({"design": "adlut"}, "design 'adlut' is not known. Known: adult"),
]


@pytest.mark.parametrize(("options", "message"), ASKED, ids=[message[:40] for _, message in ASKED])
def test_rules_that_no_episode_can_keep_are_refused(options: dict[str, Any], message: str) -> None:
    for make in (NavigationEnv, lambda **own: NavigationVectorEnv(2, **own)):
        with pytest.raises(InvalidOptionError) as refusal:
            make(bank=short_bank(), **options)
        assert str(refusal.value).startswith(message)


def environments() -> list[gymnasium.Env]:
    return [NavigationEnv(bank=short_bank()), DeviceEnv("capsule", colons=[straight_tube(0.3)])]


@pytest.mark.parametrize("environment", environments(), ids=lambda one: type(one).__name__)
def test_a_step_before_the_first_reset_and_actions_of_another_shape_are_refused(environment: gymnasium.Env) -> None:
    action = environment.action_space.sample()
    with pytest.raises(InvalidOptionError, match="call reset first"):
        environment.step(action)
    with pytest.raises(InvalidOptionError, match="reset has no option 'csae'"):
        environment.reset(options={"csae": 1})
    environment.reset(seed=0)
    for wrong in (action[:3], np.append(action, 0), action[None], "push", None, [[1], [2, 3]]):
        with pytest.raises(InvalidOptionError, match="The action"):
            environment.step(wrong)


def test_many_worlds_are_called_alike() -> None:
    vector = NavigationVectorEnv(2, bank=short_bank(), observation="state", threads=1)
    with pytest.raises(InvalidOptionError, match="call reset first"):
        vector.step(np.zeros((2, 4)))
    for options, message in (
        ({"reset_mask": [True]}, "reset_mask"),
        ({"reset_mask": np.array([0, 1])}, "give 2 truths"),
        ({"case": 0}, "no option 'case'"),
    ):
        with pytest.raises(InvalidOptionError, match=message):
            vector.reset(options=options)
    with pytest.raises(InvalidOptionError, match="3 seeds for 2 worlds"):
        vector.reset(seed=[1, 2, 3])
    vector.reset(seed=0)
    with pytest.raises(InvalidOptionError, match="shape"):
        vector.step(np.zeros((2, 3)))
    for worlds, threads, message in ((0, 1, "worlds is 0"), (2, 0, "threads is 0")):
        with pytest.raises(InvalidOptionError, match=message):
            NavigationVectorEnv(worlds, threads=threads, bank=short_bank())
    vector.close()


def test_an_interval_is_a_whole_number_of_steps() -> None:
    assert whole_steps(0.04, 0.005) == 8 and whole_steps(0.015, 0.005) == 3
    with pytest.raises(InvalidOptionError, match="whole number"):
        whole_steps(0.002, 0.005)
    assert checked_action([np.nan, 1], (2,)).shape == (2,)


OWN: dict[str, dict[str, Any]] = {
    "scope": {"bank": short_bank()},
    "withdrawal": {"bank": short_bank()},
    "device": {"colons": [bent_colon(bend=0.06, length=0.6)]},
}


@pytest.mark.parametrize(("name", "make"), list(every_environment(**OWN)), ids=lambda value: str(value)[:30])
def test_every_environment_keeps_its_contracts(name: str, make: Any) -> None:
    pytest.importorskip("stable_baselines3")
    assert not check(name, make, seeds=1).problems


def test_wrappers_of_gymnasium_take_it(tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    plain = gymnasium.make("Haustra/Colonoscopy-v0", bank=short_bank(), observation="state", render_mode="rgb_array")
    wrapped = NormalizeObservation(
        RecordEpisodeStatistics(RecordVideo(plain, str(tmp_path / "video"), lambda number: True))
    )
    wrapped.reset(seed=0)
    for _ in range(3):
        seen, *_ = wrapped.step(wrapped.action_space.sample())
        assert np.isfinite(seen).all()
    wrapped.close()


def test_statistics_and_normalised_observations() -> None:
    assert haustra.envs
    plain = gymnasium.make("Haustra/Colonoscopy-v0", bank=short_bank(), observation="state", limits={"seconds": 0.08})
    wrapped = NormalizeObservation(RecordEpisodeStatistics(plain))
    wrapped.reset(seed=0)
    wrapped.step(wrapped.action_space.sample())
    seen, _, _, late, info = wrapped.step(wrapped.action_space.sample())
    assert late and info["episode"]["l"] == 2 and np.isfinite(seen).all()


def _one() -> gymnasium.Env:
    return NavigationEnv(bank=short_bank(), observation="dict")


@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_processes_of_gymnasium_step_it() -> None:
    vector = gymnasium.vector.AsyncVectorEnv([_one], context="spawn")
    seen, _ = vector.reset(seed=0)
    assert vector.observation_space.contains(seen)
    seen, reward, *_ = vector.step(vector.action_space.sample())
    assert vector.observation_space.contains(seen) and np.isfinite(reward).all()
    vector.close()


@pytest.mark.parametrize("environment", environments(), ids=lambda one: type(one).__name__)
@pytest.mark.filterwarnings("ignore::UserWarning")  # it asks for authors and links
def test_minari_records_it_with_infos(environment: gymnasium.Env, tmp_path: Path, monkeypatch) -> None:
    minari = pytest.importorskip("minari")
    monkeypatch.setitem(os.environ, "MINARI_DATASETS_PATH", str(tmp_path))
    collector = minari.DataCollector(environment, record_infos=True)
    for seed in range(2):
        collector.reset(seed=seed)
        for _ in range(3):
            collector.step(collector.action_space.sample())
    assert collector.create_dataset(dataset_id="haustra/test-v0").total_steps == 6
