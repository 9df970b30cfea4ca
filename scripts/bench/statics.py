"""Static shapes of a cable against a rod's data: tip errors as fractions of length, and what a shape costs."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.devices.scope.rods import RodModel, UniformRod, hinge_rod
from haustra.scripts.bench.reference.chain import Load
from haustra.scripts.bench.reference.rod import static_shape
from haustra.scripts.bench.rod_data import RodShapes

_ZERO = np.zeros(3)


@dataclass(frozen=True)
class StaticErrors:
    """How far tips are off."""

    joints: int
    tips: Float[np.ndarray, "shapes 3"]
    """Computed tips [m]."""
    errors: Float[np.ndarray, " shapes"]
    """Distance from the data's tips over the rod's length [1]."""
    seconds_per_shape: float
    iterations: float
    """Newton iterations per shape, on average."""


def static_errors(
    rod: UniformRod, shapes: RodShapes, joints: int, *, progress: Callable[[int], None] | None = None
) -> StaticErrors:
    """Solve every shape with a cable of `joints` joints. The time counts the solution alone, not the model's build."""
    built = hinge_rod(rod, joints)
    built.require("native")
    model = built.spec.compile()
    data = mujoco.MjData(model)
    tip_body, tip_place = model.body(built.tip[0]).id, np.array(built.tip[1])
    tips, iterations = [], 0
    began = time.perf_counter()
    for index in range(len(shapes.tip)):
        loads = wrench_loads(
            model,
            built,
            mid=(shapes.mid_force[index], shapes.mid_moment[index]),
            tip=(shapes.tip_force[index], shapes.tip_moment[index]),
        )
        found = static_shape(model, data, loads=loads, gravity=shapes.gravity[index])
        tips.append(data.xpos[tip_body] + data.xmat[tip_body].reshape(3, 3) @ tip_place)
        iterations += found.iterations
        if progress and index % 20 == 19:
            progress(index + 1)
    spent = time.perf_counter() - began
    errors = np.linalg.norm(np.array(tips) - shapes.tip, axis=1) / rod.length
    return StaticErrors(joints, np.array(tips), errors, spent / len(tips), iterations / len(tips))


def wrench_loads(
    model: mujoco.MjModel,
    built: RodModel,
    *,
    mid: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]],
    tip: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]],
) -> list[Load]:
    """Dead loads for a force [N] and a moment [N m] at mid-length and at the tip."""
    name, place = built.tip
    loads = [Load(model.body(name).id, np.array(place), *tip)]
    for name, place, share in built.mid:
        loads.append(Load(model.body(name).id, np.array(place), share * mid[0], share * mid[1]))
    return loads


def observed_order(rows: list[StaticErrors]) -> list[float | None]:
    """Order of convergence of each row, from how its tips differ from those of finer rows; None where none is finer.

    The data cannot show the order once its own floor is reached. Against the finest row, the mean distance of tips is
    C (n^-p - N^-p); p is found from two rows and the finest.
    """
    finest = max(rows, key=lambda row: row.joints)
    coarser = sorted((row for row in rows if row.joints < finest.joints), key=lambda row: row.joints)
    gaps = {row.joints: float(np.linalg.norm(row.tips - finest.tips, axis=1).mean()) for row in coarser}
    orders: dict[int, float] = {}
    for first, second in pairwise(coarser):
        orders[first.joints] = _order(first.joints, second.joints, finest.joints, gaps)
    return [orders.get(row.joints) for row in rows]


def _order(coarse: int, fine: int, finest: int, gaps: dict[int, float]) -> float:
    from scipy.optimize import brentq

    ratio = gaps[coarse] / gaps[fine]

    def excess(order: float) -> float:
        return (coarse**-order - finest**-order) / (fine**-order - finest**-order) - ratio

    return float(np.asarray(brentq(excess, 0.05, 8.0))) if excess(0.05) * excess(8.0) < 0 else float("nan")
