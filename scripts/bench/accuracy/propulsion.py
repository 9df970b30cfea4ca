"""Question: what do time step and solver cost in the tracked robot's propulsion force and its ripple?"""

import mujoco
import numpy as np

from haustra.envs.runs.measure.propulsion import Pull, pull_model
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.law import PadLaw, load_table
from haustra.models.devices.tracked.published import SPEEDS, SURFACES
from haustra.models.devices.tracked.rig import TIMESTEP, Rig, flat_rig
from haustra.scripts.bench.accuracy.knobs import Knob, Tweak, cones, impedance_ratios, integrators, solvers, unchanged
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, stepping, timed_front

SPEED = SPEEDS[2]
"""Speed of the tread [m/s]: the middle of the published five."""


def _pull(timestep: float, turn: Tweak = unchanged) -> tuple[Rig, mujoco.MjModel, Pull]:
    design = TrackedDesign()
    law = PadLaw.fit(load_table(design.tread))
    indentation = law.indentation(design.bellows.preload / 2)
    rig = flat_rig(design, friction=SURFACES["tissue"], indentation=indentation, timestep=timestep)
    turn(rig.spec)
    model = rig.spec.compile()
    rig.tracked.set_speed(model, SPEED)
    return rig, model, pull_model(model, rig, SPEED)


def answer(effort: Effort) -> Answer:
    """Sweep time steps, integrators and solvers of one track on a strip."""
    finest = TIMESTEP / (4 if effort.quick else 16)
    effort.tell("propulsion: reference")
    tight = solvers()[-2].turn
    reference, coarser = (_pull(step, tight)[2] for step in (finest, 2 * finest))
    mean, ripple = reference.mean, float(reference.ripple()[0])
    floors = abs(coarser.mean / mean - 1), abs(float(coarser.ripple()[0]) / ripple - 1)
    steps = [Knob(f"timestep={step:g}", "timestep", unchanged) for step in (0.0005, 0.001, 0.002, 0.004)]
    forces, ripples = [], []
    for knob in (*steps, *integrators(), *solvers(), *cones(), *impedance_ratios(1, 10)):
        effort.tell(f"propulsion: {knob.setting}")
        step = float(knob.setting.split("=")[1]) if knob.group == "timestep" else TIMESTEP
        rig, model, run = _pull(step, knob.turn)
        fine = run.outcome == "completed"
        block = _block(rig, model) if fine else None
        for found, error in (
            (forces, abs(run.mean / mean - 1)),
            (ripples, abs(float(run.ripple()[0]) / ripple - 1)),
        ):
            error = error if fine else np.inf
            found.append(Candidate(knob.setting, error, knob.group, block, "completed" if fine else "diverged"))
    fronts = [
        timed_front(
            f"tracked robot: {what}",
            candidates,
            reference=f"time step {finest:g} s, tolerance 1e-8; at {2 * finest:g} s it differs by {floor:.1g}",
            error_unit=f"relative error of the {what}",
        )
        for what, candidates, floor in (
            ("propulsion force", forces, floors[0]),
            ("ripple at the tooth frequency", ripples, floors[1]),
        )
    ]
    return Answer(fronts)


def _block(rig: Rig, model: mujoco.MjModel):
    """Steps with treads in motion, from a quarter second on."""
    data = mujoco.MjData(model)
    pads = [model.actuator(pad.actuator).id for pad in rig.tracked.pads]
    travel = SPEED * 0.25
    data.ctrl[pads] = rig.tracked.phase_controls(np.array([travel]))[0]
    mujoco.mj_step(model, data, round(0.25 / model.opt.timestep))
    return stepping(model, data, steps=200)
