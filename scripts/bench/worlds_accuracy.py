"""How far the scopes of a backend of many worlds are from a fine native scope under the same inputs."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from haustra.envs.control.follower import LumenFollower
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.sim.load import load_backend
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.scope_colon_set import build_bank
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import SceneOptions, build_scene, entry_of


@dataclass(frozen=True)
class Apart:
    """A coarse scope against a fine one, at every control interval."""

    insertion: Float[np.ndarray, " records"]
    """Length of the fine scope inside the patient [m]."""
    tip: Float[np.ndarray, " records"]
    """Distance between both tips [m]."""
    push: Float[np.ndarray, "records 2"]
    """Push force of the coarse and the fine scope [N]."""
    joints: tuple[int, int]
    """Number of joints of the coarse and the fine scope."""

    def summary(self) -> dict[str, float]:
        """Figures as plain JSON values; shares are of the length inside."""
        share = self.tip / self.insertion
        return {
            "joints": self.joints[0],
            "reference_joints": self.joints[1],
            "insertion_m": float(self.insertion[-1]),
            "tip_error_median_share": float(np.median(share)),
            "tip_error_p95_share": float(np.percentile(share, 95)),
            "tip_error_median_mm": float(np.median(self.tip)) * 1e3,
            "tip_error_max_mm": float(self.tip.max()) * 1e3,
            "push_mean_N": float(self.push[:, 0].mean()),
            "push_mean_reference_N": float(self.push[:, 1].mean()),
        }


def compare_with_native(
    colon: Colon, design: ScopeDesign, coarse: SceneOptions, *, cell: float, seconds: float, backend: str = "linear"
) -> Apart:
    """Drive a fine scope in tangent planes by the lumen follower, and the coarse one by the same hand and pulls.

    Args:
        colon: the colon.
        design: the scope.
        coarse: options of the backend of many worlds.
        cell: distance between the fine scope's joints [m]; 0.011 makes 140 of an adult scope.
        seconds: simulated time [s].
        backend: as for `haustra.envs.sim.load.load_backend`.
    """
    bank = build_bank([colon], design, coarse)
    fine = replace(coarse, wall_law="planes", shaft_cell=cell, bending_cell=cell, sample_spacing=None)
    native = NativeEngine(build_scene(colon, None, design, fine, show_lumen=False))
    links = native.scene.cable.tip_links
    follower = LumenFollower(colon.centreline, design, tip_links=links)
    tracker = ArcTracker(colon.centreline, start=fine.start_depth)
    batch = load_backend(backend, bank.scene, bank.tables, worlds=1)
    steps = round(CONTROL_INTERVAL / coarse.timestep)
    entry, axes = entry_of(colon)
    rows = []
    for _ in range(round(seconds / CONTROL_INTERVAL)):
        known = native.read()
        inputs = follower.act(known, tracker.update(known.tip), CONTROL_INTERVAL)
        if not native.step(inputs, steps):
            break
        one = np.ones(1)
        batch.step(Controls(inputs.push_rate * one, inputs.roll_rate * one, np.asarray(inputs.pulls)[None]), steps)
        seen, known = batch.read(), native.read()
        place = entry + axes @ seen.tip[0]
        rows.append((known.insertion, np.linalg.norm(place - known.tip), float(seen.push_force[0]), known.push_force))
    batch.close()
    found = np.array(rows)
    return Apart(found[:, 0], found[:, 1], found[:, 2:], (len(bank.scene.cable.cells), len(native.scene.cable.cells)))
