"""Every kind of device is a sound environment, by Gymnasium's checker and by Stable-Baselines3's."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import haustra.envs  # noqa: F401
from haustra.models.devices.base import load_device
from tests.tube_colon import straight_tube


@pytest.mark.parametrize("name", ["vine", "inchworm"])
def test_a_kind_is_a_sound_environment(name: str) -> None:
    tube = straight_tube(0.5)
    made = gymnasium.make("Haustra/Device-v0", device=name, colons=[tube])
    check_env(made.unwrapped, skip_render_check=True)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(made.unwrapped, warn=False)
    device, (shown, _) = load_device(name), made.reset(seed=0)
    assert made.action_space.shape == (len(device.controls),)
    assert shown.shape == (6 + len(device.readings),) and np.isfinite(shown).all()
    made.close()
