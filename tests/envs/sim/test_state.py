"""Records that all backends share: shapes said once, checked at run time, with and without an axis of worlds."""

from importlib.util import find_spec

import numpy as np
import pytest

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.load import backend_of
from haustra.envs.sim.state import Controls, Readings, refuse_others
from haustra.errors import InvalidOptionError

_TIP = {"tip": np.zeros(3), "tip_frame": np.eye(3), "bend": np.zeros(2), "link_forces": np.zeros(5)}
_NUMBERS = dict.fromkeys(("time", "insertion", "roll", "hand_lead", "push_force", "torque"), 0.0)


def test_one_scope_and_many_are_told_in_the_same_record() -> None:
    one = Readings(**_NUMBERS, **_TIP)
    assert one.checked() is one
    many = Readings(**{name: np.tile(np.asarray(value), (2, *[1] * np.ndim(value))) for name, value in _TIP.items()}
                    | {name: np.zeros(2) for name in _NUMBERS})  # fmt: skip
    assert many.checked() is many
    with pytest.raises(InvalidOptionError, match="Readings have tip of shape"):
        many._replace(tip=np.zeros((3, 3))).checked()
    with pytest.raises(InvalidOptionError, match="Readings have bend of shape"):
        one._replace(bend=np.zeros(3)).checked()


def test_controls_are_refused_whose_worlds_disagree() -> None:
    Controls(0.1, 0).checked()
    with pytest.raises(InvalidOptionError, match="Controls have pulls of shape"):
        Controls(np.zeros(2), np.zeros(2)).checked()  # slack wires of one scope do not do for two
    two = Controls(np.zeros(2), np.zeros(2), np.zeros((2, 4)))
    refuse_others(two, 2)
    with pytest.raises(InvalidOptionError, match="give one a world, 3"):
        refuse_others(two, 3)
    with pytest.raises(InvalidOptionError, match="steered by pulls"):
        refuse_others(two._replace(wheels=np.zeros((2, 2))), 2)


def test_backends_of_many_worlds_are_final_and_inherit_from_none_of_each_other() -> None:
    kinds = {backend_of(name) for name in ("native", "linear", *(["warp"] if find_spec("warp") else []))}
    assert len(kinds) > 1
    for kind in kinds:
        assert issubclass(kind, AbstractBackend) and getattr(kind, "__final__", False)
        assert not any(issubclass(kind, other) for other in kinds - {kind})
    with pytest.raises(InvalidOptionError, match="not known"):
        backend_of("bullet")
