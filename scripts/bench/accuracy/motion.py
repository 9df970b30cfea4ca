"""Question: what does a time step cost in accuracy, by integrator, while a rod swings freely?"""

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.devices.scope.rods import UniformRod, hinge_rod
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, sound, stepping, timed_front
from haustra.scripts.bench.reference.chain import Load
from haustra.scripts.bench.reference.rod import static_shape
from haustra.scripts.bench.result import Table, Value, observed_orders

ROD = UniformRod(
    length=0.5,
    radius=0.0064,
    flexural_rigidity=0.03,
    torsional_rigidity=0.39,
    mass_per_length=0.3,
    relaxation_time=0.002,
)
"""A scope's shaft that swings: its loss time is a fifteenth of a real one's, so that steps and not damping decide."""
JOINTS, SECONDS, INTERVAL = 12, 0.32, 0.004
LOAD = 2.0
"""Over EI / L^2: held so, then let go."""
FINEST = 1.25e-5
"""Time step of the reference, RK4 [s]: an eighth of the smallest in the sweep."""
STEPS = (1e-4, 2e-4, 4e-4, 1e-3, 2e-3, 4e-3)
"""[s]."""
_KINDS = mujoco.mjtIntegrator
SCHEMES = {
    "Euler": (_KINDS.mjINT_EULER, False, 1),
    "implicitfast": (_KINDS.mjINT_IMPLICITFAST, False, 1),
    "implicitfast, damping K (tau + h)": (_KINDS.mjINT_IMPLICITFAST, True, 1),
    "discrete": (_KINDS.mjINT_DISCRETE, False, 1),
    "RK4": (_KINDS.mjINT_RK4, False, 4),
}
"""Integrator, whether joints carry damping and armature for the step as in scenes, and the order in theory."""


def swing(
    integrator: mujoco.mjtIntegrator, step: float, *, for_scenes: bool = False, joints: int = JOINTS
) -> tuple[Float[np.ndarray, "records 3"], mujoco.MjModel, mujoco.MjData]:
    """Tip every `INTERVAL` of a rod let go from its shape under a tip load [m]."""
    # Bent in one plane: twist hinges would only set the limit of explicit integrators, far below that of bending.
    built = hinge_rod(ROD, joints, twist_hinges=0, timestep=step if for_scenes else None)
    option = built.spec.option
    option.timestep, option.integrator = step, integrator
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model = built.spec.compile()
    data = mujoco.MjData(model)
    name, place = built.tip
    body = model.body(name).id
    force = np.array([LOAD * ROD.flexural_rigidity / ROD.length**2, 0, 0])
    static_shape(model, data, loads=[Load(body, np.array(place), force, np.zeros(3))])
    data.qvel[:] = 0
    track = []
    for _ in range(round(SECONDS / INTERVAL)):
        mujoco.mj_step(model, data, round(INTERVAL / step))
        if not sound(data):
            break
        mujoco.mj_kinematics(model, data)
        track.append(data.xpos[body] + data.xmat[body].reshape(3, 3) @ place)
    return np.array(track).reshape(-1, 3), model, data


def answer(effort: Effort) -> Answer:
    """Sweep integrators and time steps; joints stay, so that the error is that of time alone."""
    effort.tell("swinging rod: reference")
    finest = FINEST * (2 if effort.quick else 1)
    reference, *_ = swing(_KINDS.mjINT_RK4, finest)
    coarser, *_ = swing(_KINDS.mjINT_RK4, 4 * finest)
    floor = _rms(coarser, reference)
    candidates, rows = [], []
    for name, (integrator, for_scenes, theory) in SCHEMES.items():
        effort.tell(f"swinging rod: {name}")
        errors = []
        for step in STEPS:
            track, model, data = swing(integrator, step, for_scenes=for_scenes)
            fine = len(track) == len(reference)
            error = _rms(track, reference) if fine else np.inf
            setting = f"integrator={name}, timestep={step:g}"
            errors.append(error)
            candidates.append(
                Candidate(setting, error, name, stepping(model, data, steps=200))
                if fine
                else Candidate(setting, np.inf, name, None, "diverged")
            )
        rows.append(_order(name, errors, theory, floor))
    front = timed_front(
        "swinging rod, error of time alone",
        candidates,
        reference=f"RK4 at {finest:g} s with the same joints; at {4 * finest:g} s it differs by {floor:.1g}",
        error_unit="rms tip gap / L",
    )
    note = "Median over the three smallest steps that are above ten times the reference's own error."
    return Answer([front], [Table("Order of convergence in the time step", tuple(rows), note)])


def _order(name: str, errors: list[float], theory: int, floor: float) -> dict[str, Value]:
    clear = [(step, error) for step, error in zip(STEPS, errors, strict=True) if 10 * floor < error < np.inf][:3]
    orders = observed_orders(*zip(*clear, strict=True)) if len(clear) > 1 else ()
    stable = [step for step, error in zip(STEPS, errors, strict=True) if error < np.inf]
    return {
        "integrator": name,
        "observed_order": float(np.median(orders)) if orders else None,
        "theory": theory,
        "largest_step_that_did_not_diverge_s": max(stable, default=None),
    }


def _rms(track: Float[np.ndarray, "records 3"], reference: Float[np.ndarray, "records 3"]) -> float:
    return float(np.sqrt(((track - reference) ** 2).sum(1).mean())) / ROD.length
