"""What a step costs: the scope's cable, the plugin cable, a 1D flex and a plain chain, alone and in a colon."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.rods import RODS, RodModel, UniformRod, hinge_rod
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.pieces.wall import Wall

TIMESTEP = 0.004
"""Time step of every rod [s]: that of scenes."""

TWIST_HINGES = 4
"""Number of twist hinges of the scope's cable, as in scenes."""

_WARM_UP, _ALONE_STEPS = 20, 400
_SIDEWAYS = 0.3
"""Force at the tip that sets a rod in motion [N]."""


def cost_alone(
    design: ScopeDesign, counts: Sequence[int], *, progress: Callable[[float, str], None] = lambda done, note: None
) -> list[dict[str, Any]]:
    """Steps per second and real-time factor of every kind of rod with the design's length and stiffness.

    The scope's cable has two hinges a joint and `TWIST_HINGES` twist hinges; the plugin cable has a ball joint, the
    plain chain two hinges, the 1D flex none. All carry damping K (tau + h), without which none is stable at this time
    step but the flex.
    """
    section = design.shaft[0]
    rod = UniformRod(
        length=design.length,
        radius=design.diameter / 2,
        flexural_rigidity=design.flexural_rigidity(section),
        torsional_rigidity=design.torsional_stiffness(section),
        mass_per_length=design.mass_per_length,
        relaxation_time=design.relaxation_time,
    )
    rows = []
    for number, count in enumerate(counts):
        row: dict[str, Any] = {"joints": count}
        for name, build in RODS.items():
            if build is hinge_rod:
                model = hinge_rod(rod, count, twist_hinges=TWIST_HINGES, timestep=TIMESTEP)
            else:
                model = build(replace(rod, relaxation_time=rod.relaxation_time + TIMESTEP), count)
            row[name] = _rate(model)
        rows.append(row)
        progress(number + 1, f"{count} joints alone")
    return rows


def cost_in_colon(
    colon: Colon,
    wall: Wall,
    design: ScopeDesign,
    counts: Sequence[int],
    *,
    seconds: float,
    progress: Callable[[float, str], None] = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Steps per second and real-time factor while a scope is pushed into a colon at 4 cm/s."""
    rows = []
    for number, count in enumerate(counts):
        engine = NativeEngine(build_scene(colon, wall, design, options_for(colon, design, count), show_lumen=False))
        steps = round(seconds / TIMESTEP)
        began = time.perf_counter()
        done, contacts, inputs = 0, 0, Controls(push_rate=0.04, roll_rate=0.0, pulls=np.zeros(4))
        while done < steps and engine.step(inputs, 5):
            done += 5
            contacts += engine.data.ncon
        spent = time.perf_counter() - began
        rows.append(
            {
                "joints": len(engine.scene.cable.cells),
                "dofs": engine.model.nv,
                "steps_per_s": done / spent,
                "real_time_factor": done * TIMESTEP / spent,
                "contacts_mean": contacts / max(1, done / 5),
                "diverged": done < steps,
            }
        )
        progress(number + 1, f"{count} joints in the colon")
    return rows


def options_for(colon: Colon, design: ScopeDesign, count: int) -> SceneOptions:
    """Scene with about `count` joints: a quarter of them in the bending section, at most 8."""
    steered = min(8, max(2, count // 4))
    modelled = min(design.length, colon.centreline.length + SceneOptions.start_depth)
    shaft = modelled - design.bending.length - design.tip.length
    return SceneOptions(
        timestep=TIMESTEP,
        bending_cell=design.bending.length / steered,
        shaft_cell=shaft / max(1, count - steered),
    )


def _rate(rod: RodModel) -> dict[str, Any]:
    rod.require("native")
    option = rod.spec.option
    option.timestep = TIMESTEP
    option.integrator = rod.integrator
    model = rod.spec.compile()
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body(rod.tip[0]).id, :2] = _SIDEWAYS
    mujoco.mj_step(model, data, _WARM_UP)
    began = time.perf_counter()
    mujoco.mj_step(model, data, _ALONE_STEPS)
    spent = time.perf_counter() - began
    if not np.isfinite(data.qpos).all() or data.warning[int(mujoco.mjtWarning.mjWARN_BADQACC)].number:
        raise HaustraError(f"The rod '{rod.kind}' of {model.nv} degrees of freedom diverged at {TIMESTEP} s.")
    rate = _ALONE_STEPS / spent
    return {"dofs": model.nv, "steps_per_s": rate, "real_time_factor": rate * TIMESTEP}
