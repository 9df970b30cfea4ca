"""What one action in many worlds led to."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.tasks.observation import Observation


@dataclass(frozen=True)
class Step:
    """What one action led to; arrays over worlds."""

    observation: Observation
    reward: Float[np.ndarray, " worlds"]
    terminated: Bool[np.ndarray, " worlds"]
    """The end of the way was reached, the wall was perforated or left, or the world diverged."""
    truncated: Bool[np.ndarray, " worlds"]
    """Time is up."""
    info: dict[str, np.ndarray]
    """Ground truth that no device knows, and why an episode ended; of scopes also terms of the reward. `p_perforation`
    is the share of people whose colon the episode has torn so far (`haustra.models.injury`), `perforation_arc` where
    [m]; `pain` is the largest so far, 1 where it is taken to begin. Under gas, `gas_pressure_peak` is the highest of
    any segment so far [Pa], `gas_volume` what the colon holds, and `water_volume` what of water, where there is any
    [m^3]. Where the task keeps account of bleeding, `bleeding_places` and `bleeding_pulled` count places of two
    centimetres that were sheared or sucked at too much so far, and `suction_pull` is how hard suction pulls at the
    mucosa now [Pa] (`haustra.envs.tasks.blood`)."""
