"""Eyes that learn from colour what rays say, at a size for tests, on the CPU."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("safetensors")

import torch

from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.eyes import RAYS, Eyes
from haustra.envs.learning.eyes_run import _network
from haustra.envs.learning.policy import MlpPolicy, load_policy, save_policy
from haustra.envs.learning.recall import recalled_width
from haustra.envs.learning.settings import Training, shipped
from haustra.envs.learning.train import train
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.errors import InvalidOptionError, UnreadableFileError
from tests.task_bank import DESIGN, moving_bank

TASK = TaskConfig(design=DESIGN, mesentery=True, observation="pixels", picture_size=16, limits=Limits(seconds=1.0))


def hand(folder: Path) -> Path:
    """A policy that sees depth, and pushes."""
    width = recalled_width(RAYS + 2, 4, 1)
    layers = (np.zeros((8, width), np.float32), np.zeros((4, 8), np.float32))
    biases = (np.zeros(8, np.float32), np.array([0.5, 0, 0, 0], np.float32))
    lumen = replace(TASK, observation="lumen")
    policy = MlpPolicy(layers, biases, "tanh", squashed=False, config=lumen, recalls=(1.0,))
    return save_policy(folder, policy)


def training(start: Path) -> Training:
    return Training(
        learner="eyes",
        backend="linear",
        start=str(start),
        steps=640,
        worlds=16,
        rollout=20,
        batch=64,
        epochs=2,
        imitate=0,
        task=TASK,
    )


def test_eyes_learn_what_rays_say_and_their_policy_drives_by_pictures(tmp_path):
    made = training(hand(tmp_path / "hand"))
    train(made, tmp_path / "run", bank=moving_bank(), threads=1)
    with (tmp_path / "run/curve.csv").open() as file:
        errors = [float(row["error"]) for row in csv.DictReader(file)]
    assert errors[-1] < 0.6 * errors[0]
    policy = load_policy(tmp_path / "run")
    assert policy.eyes is not None and policy.recalls == (1.0,)
    driver = PolicyDriver(policy)
    driver.begin(np.ones(3, bool))
    assert driver.act({"pixels": np.zeros((3, 16, 16, 4), np.uint8)}) == pytest.approx(np.tile([0.5, 0, 0, 0], (3, 1)))
    more = train(replace(made, steps=800), tmp_path / "run", resume=True, bank=moving_bank(), threads=1)
    assert more["steps"] == 800


def test_eyes_see_the_same_with_and_without_torch():
    torch.manual_seed(0)
    network = _network(21)
    held = [value.numpy() for value in network.state_dict().values()]
    weights, biases = held[0::2], held[1::2]
    eyes = Eyes(tuple(weights[:-2]), tuple(biases[:-2]), (weights[-2], weights[-1]), (biases[-2], biases[-1]))
    assert eyes.fits(21) and not eyes.fits(64)
    pictures = np.random.default_rng(0).integers(0, 256, (3, 21, 21, 4), np.uint8)
    with torch.no_grad():
        near = network(torch.as_tensor(pictures[..., :3]).permute(0, 3, 1, 2).float() / 255.0).numpy()
    found = eyes.look(pictures)
    assert found[:, :RAYS] == pytest.approx(near, abs=1e-5)
    pictures[..., 3] = 0
    assert np.array_equal(eyes.look(pictures), found), "the distance that pictures have is not looked at"


def test_a_blind_policy_is_shown_a_lumen_that_is_nowhere(tmp_path):
    made = load_policy(hand(tmp_path))
    first = np.zeros_like(made.weights[0])
    first[0, :RAYS] = 1.0
    second = np.zeros_like(made.weights[1])
    second[1, 0] = 0.5
    sees = replace(made, weights=(first, second))
    far, near = {"lumen": np.ones((1, RAYS + 2), np.float32)}, {"lumen": np.zeros((1, RAYS + 2), np.float32)}
    assert PolicyDriver(sees).act(far)[0, 1] > PolicyDriver(sees).act(near)[0, 1]
    one, other = (PolicyDriver(sees, blind=True).act(seen) for seen in (far, near))
    assert np.array_equal(one, other)
    with pytest.raises(InvalidOptionError, match="does not look"):
        PolicyDriver(replace(made, config=replace(TASK, observation="state")), blind=True)


def test_eyes_that_do_not_fit_are_refused(tmp_path):
    made = training(hand(tmp_path / "hand"))
    train(replace(made, steps=32), tmp_path / "run", bank=moving_bank(), threads=1)
    policy = load_policy(tmp_path / "run")
    assert policy.eyes is not None
    save_policy(tmp_path / "other", replace(policy, config=replace(policy.config, picture_size=64)))
    with pytest.raises(UnreadableFileError, match="fit neither"):
        load_policy(tmp_path / "other")


@pytest.mark.parametrize("recalls", ["12", {"1": 0}, [True], [10**400], [-1.0]])
def test_times_that_are_no_list_of_numbers_are_refused(tmp_path, recalls):
    about = json.loads((hand(tmp_path) / "policy.json").read_text())
    (tmp_path / "policy.json").write_text(json.dumps(about | {"recalls": recalls}))
    with pytest.raises(UnreadableFileError):
        load_policy(tmp_path)


@pytest.mark.parametrize("wrong", [{"backend": "native"}, {"device": "cuda"}, {"start": None}])
def test_what_eyes_do_not_learn_from_is_refused(tmp_path, wrong):
    with pytest.raises(InvalidOptionError, match="learner 'eyes'"):
        replace(training(tmp_path), **wrong)
    with pytest.raises(InvalidOptionError, match="no network for pictures"):
        Training(task=TASK)


def test_colour_ships_as_a_training_of_eyes():
    own = shipped("insertion-colour")
    assert own.learner == "eyes" and own.start == "insertion-depth"
    assert own.task.drive == shipped("insertion-depth").task.drive
