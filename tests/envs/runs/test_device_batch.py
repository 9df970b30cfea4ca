"""Many colons at once: each run is, to the last bit, what it is alone, so that no study depends on who runs what."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.device_batch import run_devices
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.device_scene import device_options
from haustra.models.devices.base import load_device
from tests.ring_wall import bent_colon

COLONS = [
    replace(bent_colon(bend=bend, leg=0.11, length=0.36, radius=0.017), segments=(ColonSegment("sigmoid", 0.0, 0.36),))
    for bend in (0.06, 0.08, 0.1)
]


@pytest.mark.parametrize("name", ["tracked", "vine", "capsule", "inchworm"])
def test_a_run_among_others_is_the_run_alone(name: str) -> None:
    device = load_device(name)
    options = device_options(device, mesentery=True, start_depth=0.12)
    together = run_devices(device, COLONS, options, seconds=0.3)
    alone = [run_devices(device, [colon], options, seconds=0.3)[0] for colon in COLONS]
    for (ended, records), (own_end, own) in zip(together, alone, strict=True):
        assert ended is own_end
        for reading, values in records.items():
            assert np.array_equal(values, own[reading]), reading
