"""Question: how far is a clamped rod's tip from beam theory at small loads and from the elastica at large ones?

Sources: Euler-Bernoulli beam; Bisshopp and Drucker, Q. Appl. Math. 3 (1945) 272. The elastica is integrated here to
1e-11, so that the reference adds nothing.
"""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from haustra.models.devices.scope.rods import RODS, RodModel, UniformRod
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.accuracy.timing import Candidate, processor_seconds, sound, stepping, timed_front
from haustra.scripts.bench.reference.chain import Load
from haustra.scripts.bench.reference.rod import static_shape
from haustra.scripts.bench.result import ParetoFront, Table, Value, observed_orders

ROD = UniformRod(
    length=0.5, radius=0.0064, flexural_rigidity=0.03, torsional_rigidity=0.39, mass_per_length=0.3, relaxation_time=0.3
)
"""EI and mass of a scope's shaft, damped so that it comes to rest within seconds."""
STEP = 0.004
"""Time step of what is stepped [s], with damping of K h beside the rod's own."""
LARGE, SMALL = 5.0, 1e-3
"""Tip load over EI / L^2: a tip angle of 70 degrees, and one that is linear to 1e-7."""
THEORY = {"hinges": 2, "linear hinges": 2, "1D flex": 2, "plain chain": 1, "cable plugin": 1}
"""Orders that are to be expected: half cells at both ends are of second order, a whole rigid first link of first."""
_ZERO = np.zeros(3)
_REST, _LONGEST = 1e-6, 8.0
"""Joint speed of a rod at rest [rad/s], and the time it has for that [s]."""


def elastica_tip(load: float) -> tuple[float, float]:
    """Deflection and height of the tip over the length, under a dead load across of `load` EI / L^2."""

    def bent(curvature: float) -> np.ndarray:
        slopes = lambda s, y: [y[1], -load * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])]  # noqa: E731
        return solve_ivp(slopes, (0, 1), [0, curvature, 0, 0], rtol=1e-11, atol=1e-12).y[:, -1]

    found = bent(float(np.asarray(brentq(lambda start: bent(start)[1], 0.0, load, xtol=1e-12))))
    return float(found[2]), float(found[3])


def static_tip(built: RodModel, load: float) -> tuple[Float[np.ndarray, "3"], Callable[[], float]]:
    """Tip of a chain of hinges under a load across [m], by Newton's method, and a block that solves it again."""
    model = built.spec.compile()
    data = mujoco.MjData(model)
    name, place = built.tip
    body = model.body(name).id
    force = load * ROD.flexural_rigidity / ROD.length**2
    loads = [Load(body, np.array(place), np.array([force, 0, 0]), _ZERO)]
    static_shape(model, data, loads=loads)
    tip = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
    return tip, lambda: processor_seconds(lambda: static_shape(model, data, loads=loads))


def stepped_tip(built: RodModel, load: float) -> tuple[Float[np.ndarray, "3"], mujoco.MjModel, mujoco.MjData]:
    """Tip of any loaded rod, found by stepping until it is still."""
    option = built.spec.option
    option.timestep, option.integrator = STEP, built.integrator
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model = built.spec.compile()
    data = mujoco.MjData(model)
    name, place = built.tip
    body = model.body(name).id
    force = np.array([load * ROD.flexural_rigidity / ROD.length**2, 0, 0])
    tip = _ZERO
    while data.time < _LONGEST and sound(data):
        mujoco.mj_kinematics(model, data)
        tip = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
        data.xfrc_applied[body] = [*force, *np.cross(tip - data.xipos[body], force)]
        mujoco.mj_step(model, data, 5)
        if np.abs(data.qvel).max() < _REST:
            break
    return tip, model, data


def answer(effort: Effort) -> Answer:
    """Sweep kinds of rods and numbers of joints."""
    counts = (5, 10, 20, 40) if effort.quick else (5, 10, 20, 40, 80)
    errors: dict[tuple[str, str], list[float]] = {}
    fronts = []
    for what, load in (("cantilever, small load", SMALL), ("elastica, P L^2 / EI = 5", LARGE)):
        effort.tell(what)
        fronts.append(_solved(what, load, counts, errors))
    effort.tell("elastica, stepped to rest")
    fronts.append(_stepped(counts[:4], errors))
    return Answer(fronts, [_orders(counts, errors)], notes=["Shapes: damping plays no part in where a rod rests."])


def _solved(what: str, load: float, counts: Sequence[int], errors: dict) -> ParetoFront:
    across, up = elastica_tip(load)
    candidates = []
    for kind in ("hinges", "linear hinges", "plain chain"):
        for count in counts:
            tip, block = static_tip(RODS[kind](ROD, count), load)
            error = np.hypot(tip[0] / ROD.length - across, tip[2] / ROD.length - up) / across
            errors.setdefault((what, kind), []).append(float(error))
            candidates.append(Candidate(f"rod={kind}, joints={count}", float(error), kind, block))
    return timed_front(
        what,
        candidates,
        reference="elastica, integrated to 1e-11",
        error_unit="tip gap / deflection",
        cost_unit="processor s / shape (Newton's method)",
    )


def _stepped(counts: Sequence[int], errors: dict) -> ParetoFront:
    across, up = elastica_tip(LARGE)
    title = "elastica, stepped to rest"
    candidates = []
    for kind, build in RODS.items():
        for count in counts:
            rod = UniformRod(**{**ROD.__dict__, "relaxation_time": ROD.relaxation_time + STEP})
            tip, model, data = stepped_tip(build(rod, count), LARGE)
            if not sound(data):
                candidates.append(Candidate(f"rod={kind}, joints={count}", np.inf, kind, None, "diverged"))
                continue
            error = np.hypot(np.hypot(*tip[:2]) / ROD.length - across, tip[2] / ROD.length - up) / across
            errors.setdefault((title, kind), []).append(float(error))
            candidates.append(Candidate(f"rod={kind}, joints={count}", float(error), kind, stepping(model, data)))
    return timed_front(title, candidates, reference="elastica, integrated to 1e-11", error_unit="tip gap / deflection")


def _orders(counts: Sequence[int], errors: dict[tuple[str, str], list[float]]) -> Table:
    rows: list[dict[str, Value]] = []
    for (what, kind), found in errors.items():
        orders = observed_orders([1 / count for count in counts[: len(found)]], found)
        rows.append(
            {
                "question": what,
                "rod": kind,
                "coarsest_error": found[0],
                "finest_error": found[-1],
                "observed_order": float(np.median(orders)),
                "theory": THEORY[kind],
            }
        )
    note = f"Median of the orders between {', '.join(map(str, counts))} joints."
    return Table("Order of convergence in the number of joints", tuple(rows), note)
