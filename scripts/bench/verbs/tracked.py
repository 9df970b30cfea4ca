"""`haustra bench tracked`: how fast the tracked robot steps on one core."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from haustra.fields import number


@dataclass(frozen=True)
class BenchTracked:
    """Step one track, the whole device and an empty scene on one core, and time the five-by-two study."""

    seconds: float = number("s", 0.02, 36_000.0, default=1.0)
    """Processor time spent on each [s]."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure CPU time, so that other programs on the machine matter less."""
        from haustra.models.devices.tracked.design import TrackedDesign
        from haustra.models.devices.tracked.law import PadLaw, load_table
        from haustra.models.devices.tracked.rig import flat_rig, tube_rig
        from haustra.scripts.propulsion import track_rows

        design = TrackedDesign()
        law = PadLaw.fit(load_table(design.tread))
        track = flat_rig(design, friction=0.4, indentation=law.indentation(design.bellows.preload / 2))
        rates = {
            "empty_scene": self._rate(_empty(), None),
            "one_track": self._rate(track.spec.compile(), track),
            "whole_device": self._rate_of(lambda: tube_rig(design, friction=0.4)),
        }
        began = time.process_time()
        for surface in ("tissue", "plastic"):
            track_rows(design, surface)
        study = time.process_time() - began
        return {
            "steps_per_cpu_second": rates,
            "over_empty_scene": {name: rate / rates["empty_scene"] for name, rate in rates.items()},
            "criteria": {"one_track": 100_000, "whole_device": 40_000, "study_s": 10},
            "study_cpu_s": study,
        }

    def _rate_of(self, build: Callable[[], Any]) -> float:
        rig = build()
        return self._rate(rig.spec.compile(), rig)

    def _rate(self, model, rig) -> float:
        """Steps a CPU second at 150 rpm, in runs of two seconds as the study's; the best of three."""
        import mujoco
        import numpy as np
        from mujoco import rollout

        if rig is not None:
            rig.tracked.set_speed(model, 32.5e-3)
        data = mujoco.MjData(model)
        start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        best, steps = 0.0, 2000
        for _ in range(3):
            spent = done = 0.0
            while spent < self.seconds / 3:
                controls = np.zeros((1, steps, model.nu))
                if rig is not None:
                    travel = 32.5e-3 * model.opt.timestep * np.arange(steps)
                    pads = [model.actuator(pad.actuator).id for pad in rig.tracked.pads]
                    controls[0][:, pads] = rig.tracked.phase_controls(travel)
                began = time.process_time()
                rollout.rollout(model, data, start[None], controls)
                spent += time.process_time() - began
                done += steps
            best = max(best, done / spent)
        return best


def _empty():
    """A lone ball: what a step costs before there is anything to simulate."""
    import mujoco

    spec = mujoco.MjSpec()
    ball = spec.worldbody.add_body()
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0, 0])
    return spec.compile()
