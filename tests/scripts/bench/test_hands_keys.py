"""Real keys alone bring a scope past the sigmoid of a grown colon that moves; no driver helps."""

import pytest

from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import save_colon
from haustra.scripts.bench.browser import chromium
from haustra.scripts.bench.hands_keys import measure_keys
from haustra.scripts.drivable import Drivable

pytest.importorskip("aiohttp")


@pytest.mark.thorough
def test_keys_alone_bring_the_scope_past_the_sigmoid(tmp_path):
    if chromium() is None:
        pytest.skip("no Chromium is installed")
    folder = save_colon(grow_colon(seed=100_000), tmp_path / "colon")
    configuration = Drivable(colon=folder, preset="fast").configuration()
    assert configuration["options"]["mesentery"], "the colon moves"
    found = measure_keys(folder, configuration, seconds=300.0, folder=tmp_path)
    assert found["keys_reached"] and found["keys_goal_m"] > 0.5
    assert not found["driver_helped"] and found["key_events"] > 20
    assert found["keys_wall_force_max_N"] < 40.0
    assert (tmp_path / "keys-before.png").stat().st_size > 10_000 < (tmp_path / "keys-after.png").stat().st_size
