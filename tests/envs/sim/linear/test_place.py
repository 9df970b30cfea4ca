"""Programs of one GPU's worlds find their numbers where the others put them."""

from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.linear import place
from haustra.envs.sim.linear.place import GpuPlace, group_of


class _Kernel:
    """What a GPU would run, without one."""

    def __init__(self, **program: Any) -> None:
        self.group = program.get("group", place.WARP)

    def resident(self, group: int) -> int:
        return 3 if group == self.group else 0


@pytest.mark.parametrize("worlds", [7, 1_024, 4_096, 131_072])
def test_a_program_beside_another_takes_worlds_in_the_same_groups(worlds: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers of worlds lie side by side by groups, whose size hangs on how many worlds there are."""
    monkeypatch.setattr(place, "_kernel", _Kernel)
    monkeypatch.setattr(place, "DeviceArray", np.asarray)
    first: Any = GpuPlace(worlds=worlds, real=np.float32, room=2)
    beside: Any = first.beside()
    assert first._kernel.group == beside._kernel.group == first.lanes == beside.lanes == group_of(worlds)
