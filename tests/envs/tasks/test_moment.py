"""How far episodes are, and what ends them."""

import numpy as np

from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.moment import Dealt, Kept, Sensed, begun, moment, over

TRUE, FALSE = np.array([True]), np.array([False])
DEALT = Dealt(gain=1.0, slack=0.0, friction=0.05, length=np.array([1.03]), valve=np.array([0.95]), bears=30.0)


def begin(arc: float) -> Kept:
    old = Kept(*np.ones((len(Kept._fields), 1)))
    return begun(np, TRUE, old, np.array([arc]))


def sensed(arc: float, *, force: float = 0.0, load: float = 0.0, pain: float = 0.0) -> Sensed:
    values = arc, arc + 0.1, force, load, arc, pain, 1.0, 0.0
    return Sensed(*(np.array([value]) for value in values))


def test_progress_is_the_furthest_share_of_the_way_and_place_where_the_tip_is():
    config, kept = TaskConfig(), begin(0.0)
    for arc, progress in ((0.5, 0.5), (0.25, 0.5), (0.75, 0.75)):
        now, kept = moment(np, config, DEALT, kept, sensed(arc), TRUE)
        np.testing.assert_allclose([now.progress, now.place, now.excess], [[progress], [arc], [0.1]])
    assert not now.reached and not kept.in_caecum
    now, kept = moment(np, config, DEALT, kept, sensed(1.0), TRUE)
    assert now.reached and kept.in_caecum == 1 and now.progress == 1


def test_a_withdrawal_goes_the_other_way():
    config, kept = TaskConfig(task="withdrawal"), begin(1.04)
    now, kept = moment(np, config, DEALT, kept, sensed(0.54), TRUE)
    np.testing.assert_allclose(now.progress, 0.5)
    assert moment(np, config, DEALT, kept, sensed(0.04), TRUE)[0].reached


def test_a_world_that_diverged_keeps_what_it_had_and_is_over():
    config = TaskConfig()
    _, kept = moment(np, config, DEALT, begin(0.0), sensed(0.5, load=0.3, pain=2.0), TRUE)
    now, later = moment(np, config, DEALT, kept, sensed(1.0, force=1e6, load=9.0, pain=9.0), FALSE)
    assert not now.reached and not now.perforated
    np.testing.assert_array_equal(
        [later.progress, later.load, later.load_arc, later.pain], [[0.5], [0.3], [0.5], [2.0]]
    )
    assert over(now, np.array([1.0]), 10, FALSE) == (TRUE, FALSE)


def test_an_episode_ends_by_what_happens_before_its_time_is_up():
    config = TaskConfig()
    calm, _ = moment(np, config, DEALT, begin(0.0), sensed(0.1, force=29.0), TRUE)
    torn, _ = moment(np, config, DEALT, begin(0.0), sensed(0.1, force=31.0), TRUE)
    assert over(calm, np.array([9.0]), 10, TRUE) == (FALSE, FALSE)
    assert over(calm, np.array([10.0]), 10, TRUE) == (FALSE, TRUE)
    assert over(torn, np.array([10.0]), 10, TRUE) == (TRUE, FALSE)
