"""What a policy keeps of the past."""

import numpy as np
import pytest

from haustra.envs.learning.recall import Recall, recalled_width


def looked(recall, seen, action=0.0, begins=0.0):
    return recall.look(np.full((2, 3), seen), np.full((2, 1), action), np.full((2, 1), begins))


def test_means_forget_by_1_over_e_within_their_time():
    recall = Recall(np, (1.0,), 0.1)
    looked(recall, 1.0, begins=1.0)
    found = [looked(recall, 0.0) for _ in range(10)][-1]
    assert found.shape == (2, recalled_width(3, 1, 1)) == (2, 8)
    assert found[0, 4] == pytest.approx(-np.exp(-1.0)), "what is left of what was seen a second ago"


def test_the_last_action_is_read_within_its_bounds_and_forgotten_where_episodes_begin():
    recall = Recall(np, (1.0, 5.0), 0.1)
    looked(recall, 1.0, begins=1.0)
    assert looked(recall, 1.0, action=3.0)[0, 3] == 1.0
    found = looked(recall, 0.5, action=3.0, begins=1.0)
    assert np.array_equal(found[0], [0.5, 0.5, 0.5, *np.zeros(9)])


def test_without_times_what_is_seen_is_handed_on():
    seen = np.ones((2, 3))
    assert Recall(np, (), 0.1).look(seen, np.zeros((2, 1)), np.zeros((2, 1))) is seen
    assert recalled_width(3, 4, 0) == 3


def test_tensors_are_remembered_as_arrays_are():
    torch = pytest.importorskip("torch")
    drawn = np.random.default_rng(0).normal(size=(5, 2, 4)).astype(np.float32)
    arrays, tensors = Recall(np, (0.5,), 0.1), Recall(torch, (0.5,), 0.1)
    for step, part in enumerate(drawn):
        begins = np.array([[1.0], [float(step in (0, 3))]], np.float32) if step in (0, 3) else np.zeros((2, 1), "f4")
        one = arrays.look(part[:, :3], part[:, 3:], begins)
        other = tensors.look(*(torch.as_tensor(each) for each in (part[:, :3], part[:, 3:], begins)))
        np.testing.assert_allclose(one, other.numpy(), atol=1e-6)
