"""Episodes driven by hand: who assists knows what it would know, had it driven."""

from typing import Any

import numpy as np

from haustra.envs.console.vehicles import make_vehicle


def test_a_policy_remembers_after_a_mark_what_it_saw_before(colon_folder):
    """It proposes the same after the way was gone anew, whether or not it was asked on the way."""
    task = {"mesentery": True, "observation": "lumen", "design": "paediatric-long"}
    about = {"kind": "episode", "task": task, "seed": 0, "policy": "insertion-depth"}
    vehicle: Any = make_vehicle(colon_folder, about)
    for _ in range(20):
        assert vehicle.step(np.array([0.5, 0.0, 0.3, 0.0]))
    there, kept = vehicle.assist(), vehicle.keep()
    assert vehicle.step(there)
    vehicle.put_back(kept)
    np.testing.assert_array_equal(vehicle.assist(), there)
    vehicle.close()
