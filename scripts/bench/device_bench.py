"""A virtual bench for devices: what engineers plot of an insertion tube, and what other devices pull and hold with.

Stiffness is measured on the chain of joints that runs use: a dead moment bends or twists it, and what each stretch
turns by says EI and GJ. Buckling is that of the same joints as struts of rigid cells (Hencky). Tip angle, wires and
optics follow from the design by the laws that runs use.
"""

import math
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.physics.wires import yielded_pulls
from haustra.envs.view.picture.lens import lens_of
from haustra.models.devices.base import Device
from haustra.models.devices.scope.cable import add_scope
from haustra.models.devices.scope.cells import Cell, cut_into_cells
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import at_body_temperature
from haustra.models.devices.scope.wires import passed_part
from haustra.scripts.bench.curved_tube import BEND_RADIUS
from haustra.scripts.bench.devices import row
from haustra.scripts.bench.reference.chain import Load
from haustra.scripts.bench.reference.rod import static_shape

MOMENT = 1e-3
"""Dead moment that bends and twists the chain [N m]; engineering choice: so little that a tube stays nearly straight,
which a dead moment would else turn out of its plane."""
TARGET = 0.05
"""Distance of the target of ISO 8600-3 from the distal window [m]; engineering choice."""
PUPIL = 0.002
"""Depth of the entrance pupil behind the distal window [m]; engineering choice: lenses of endoscopes are some
millimetres long, and their makers do not say."""
TIP_TORQUE = 0.1
"""Torque that holds the tip back while the shaft is turned [N m]; engineering choice."""
_CELL = 0.05, 0.017
"""Largest cells of shaft and bending section [m], as runs of devices have."""
_TWISTS = 8
_CLAMP = 100.0
"""Stiffness of what holds the handle end [N/m, N m/rad]: links are measured against each other, not against it."""
_STIFFEST = 1e-9
"""Stretch of a wire that is taken not to stretch [m/N]."""
_ROUNDS = 4
"""Times that both wires of a pair are solved for, each with what the other pulls."""
_STILL_DEG = 0.5
"""Less than this of the tip is no answer to the knob [degrees]."""
_PIXELS = 675, 540
"""Columns and rows of the picture whose field is measured: those of a video colonoscope, halved."""
_FLATTEST = math.radians(87.5)
"""Half a field beyond which no flat target shows it [rad]."""
_CM2, _PER_DEGREE = 1e4, math.pi / 180


def bench_device(device: Device) -> dict[str, Any]:
    """Figures (`rows`: quantity, value, unit, published) and `curves` of a design, as JSON values."""
    found = find_spec(f"haustra.scripts.bench.devices.{device.kind}")
    return import_module(found.name).figures(device) if found else {"rows": [], "curves": {}}


def tube(design: ScopeDesign, *, wires: bool = True) -> dict[str, Any]:
    """Figures of an insertion tube with a bending section, and of its wires where it has any."""
    profile, warm = stiffness_profile(design), stiffness_profile(at_body_temperature(design))
    shaft = profile["along_m"] < design.length - design.bending.length - design.tip.length
    ei, gj = profile["EI_N_cm2"], profile["GJ_N_cm2_deg"]
    lengths = np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.5])
    buckling = np.array([buckling_force(design, float(length)) for length in lengths])
    loop = math.tau * BEND_RADIUS
    gj_shaft = float(gj[shaft].mean()) / _CM2 / _PER_DEGREE
    rows = [
        row("largest insertion width (ISO 8600-4)", 1e3 * design.diameter, "mm"),
        row("EI of the shaft, least", float(ei[shaft].min()), "N cm^2", "260 to 400 (CF-140S, Wehrmeyer)"),
        row("EI of the shaft, largest", float(ei[shaft].max()), "N cm^2", "260 to 400"),
        row("EI of the bending section", float(ei[~shaft].mean()), "N cm^2"),
        row("GJ of the shaft, mean", float(gj[shaft].mean()), "N cm^2/deg", "68 to 88, mean 76"),
        row("GJ clockwise over anticlockwise", 1.0, "1", "0.9; handedness is not modelled"),
        row("EI at 37 over 24 degrees", float((warm["EI_N_cm2"] / ei)[shaft].mean()), "1", "0.83"),
        row("GJ at 37 over 24 degrees", float((warm["GJ_N_cm2_deg"] / gj)[shaft].mean()), "1", "0.93"),
        row(
            f"twist of a loop's length of shaft at {TIP_TORQUE:g} N m",
            math.degrees(TIP_TORQUE * loop / gj_shaft),
            "degrees",
        ),
        row("least bend radius, bending section", 1e3 * _bend_radius(design), "mm"),
        row("buckling force of 0.2 m free, pinned", float(np.interp(0.2, lengths, buckling)), "N", "8.1 (EI 0.033)"),
        *_optics(design),
    ]
    curves = {
        "stiffness": {name: value.tolist() for name, value in profile.items()},
        "buckling": {"free_length_m": lengths.tolist(), "force_N": buckling.tolist()},
    }
    if wires:
        angle, force = tip_force(design)
        knob, tip = knob_loop(design)
        half = len(knob) // 2
        up, down = tip[:half], np.interp(knob[:half], knob[half:][::-1], tip[half:][::-1])
        idle = np.abs(knob[:half])[np.maximum(np.abs(up), np.abs(down)) < _STILL_DEG]
        rows += [
            row("tip force, bent by 90 degrees", float(np.interp(90.0, angle, force)), "N"),
            row("largest tip angle", float(np.abs(tip).max()), "degrees", "2 of 20 used scopes reach the stated angle"),
            row("hysteresis of the tip, largest", float(np.abs(up - down).max()), "degrees"),
            row("slack of the knob, either way", float(idle.max(initial=0.0)), "degrees of the tip asked for"),
        ]
        curves["tip_force"] = {"angle_deg": angle.tolist(), "force_N": force.tolist()}
        curves["knob"] = {"knob_deg": knob.tolist(), "tip_deg": tip.tolist()}
    return {"rows": rows, "curves": curves}


def _chain(design: ScopeDesign) -> tuple[mujoco.MjModel, tuple[Cell, ...]]:
    """The chain that runs use, clamped at its handle, without stops."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    cells = cut_into_cells(design, shaft_cell=_CELL[0], bending_cell=_CELL[1])
    place: dict[str, Any] = {"entry": np.zeros(3), "frame": np.eye(3), "inserted": design.length}
    limits: dict[str, Any] = {"push_limit": 1e5, "torque_limit": 1e5}
    add_scope(spec, design, cells, **place, **limits, twist_hinges=_TWISTS, timestep=None, cubic=False)
    for name in ("scope/push", "scope/roll"):  # a clamp, not a hand
        spec.joint(name).stiffness = [_CLAMP, 0, 0]
    return spec.compile(), cells


def stiffness_profile(design: ScopeDesign) -> dict[str, Float[np.ndarray, " cells"]]:
    """EI and GJ along a tube, by how far a dead moment at its tip bends and twists each stretch.

    Each cell has a joint that bends, EI = M l / angle; twist is taken up by few hinges, each for its stretch of the
    tube, GJ = M L / angle.
    """
    model, cells = _chain(design)
    lengths = np.array([cell.length for cell in cells])
    bent, twisted = (_turned(model, len(cells), axis) for axis in np.eye(3)[[0, 2]])
    joints = np.array([cell.joint for cell in cells])
    owner = (joints / lengths.sum() * _TWISTS).astype(int)
    each = MOMENT * np.bincount(owner, lengths, _TWISTS) / np.bincount(owner, twisted, _TWISTS)
    return {
        "along_m": joints,
        "EI_N_cm2": MOMENT * lengths / bent * _CM2,
        "GJ_N_cm2_deg": each[owner] * _CM2 * _PER_DEGREE,
    }


def _turned(model: mujoco.MjModel, cells: int, axis: Float[np.ndarray, "3"]) -> Float[np.ndarray, " cells"]:
    """Angle of each link against the one before [rad] under the dead moment about an axis at the tip."""
    data, last = mujoco.MjData(model), model.body(f"scope/link_{cells - 1:03d}").id
    static_shape(model, data, loads=[Load(last, np.zeros(3), np.zeros(3), MOMENT * axis)], gravity=np.zeros(3))
    bodies = [model.body("scope/root").id, *(model.body(f"scope/link_{number:03d}").id for number in range(cells))]
    frames = data.xmat[bodies].reshape(-1, 3, 3)
    turns = np.einsum("sji,sjk->sik", frames[:-1], frames[1:])
    axial = np.stack(
        [turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0], turns[:, 1, 0] - turns[:, 0, 1]]
    )
    return np.arcsin(np.linalg.norm(axial, axis=0) / 2)


def buckling_force(design: ScopeDesign, free: float) -> float:
    """Least axial force that buckles a pinned stretch of the shaft of that length [N], as rigid cells (Hencky 1920).

    With n bars of length l between hinges of stiffness K = EI / l it is 4 K / l sin^2(pi / 2n), which tends to Euler's
    pi^2 EI / L^2.
    """
    count = max(2, math.ceil(free / _CELL[0]))
    bar = free / count
    return 4 * design.flexural_rigidity(design.shaft[0]) / bar**2 * math.sin(math.pi / (2 * count)) ** 2


def tip_force(design: ScopeDesign) -> tuple[Float[np.ndarray, " angles"], Float[np.ndarray, " angles"]]:
    """Force of the tip across its axis [N] that the largest pull has left at each bend [degrees].

    The moment that is left over, (F_pull - F(angle)) r, over the lever of the bent section, a circular arc.
    """
    most = math.radians(design.limits.largest)
    angles = np.linspace(0.0, most, 37)
    section, tip = design.bending.length, design.tip.length
    lever = section * np.sinc(angles / math.tau) + tip  # the arc's chord, and the rigid tip
    left = design.wires.pull_limit * (1 - design.wires.hysteresis) - design.pull_per_angle * angles
    return np.degrees(angles), np.maximum(left, 0.0) * design.wires.routing_radius / lever


def knob_loop(design: ScopeDesign) -> tuple[Float[np.ndarray, " turns"], Float[np.ndarray, " turns"]]:
    """Angle of the free tip [degrees] against that which the knob asks for, there and back, the shaft in one loop.

    A wheel takes up x of one wire and pays it out of the other; each stretches by its compliance once its slack is
    gone, loses pull by the capstan round the loop and in the section (`yielded_pulls`), and bends the section by
    r F / (EI / L).
    """
    wires, section, limit = design.wires, design.bending, math.radians(design.limits.up)
    give = wires.routing_radius**2 * section.length / design.flexural_rigidity(section)
    reach = wires.routing_radius * limit * 1.2 + wires.slack
    there = np.linspace(-reach, reach, 200)
    wheel = np.concatenate([there, there[::-1]])
    part = passed_part(np, friction=wires.friction, hysteresis=wires.hysteresis, sheath_angle=math.tau)
    law = {"part": part, "compliance": max(wires.compliance, _STIFFEST), "limit": wires.pull_limit}
    pulls, bends = [0.0, 0.0], []
    for x in np.tile(wheel, 2):  # the first turn only finds where friction holds it
        before = list(pulls)
        for _ in range(_ROUNDS):
            for one, taken in ((0, x), (1, -x)):
                free = taken - wires.slack / 2 + give * pulls[1 - one]
                pulls[one] = float(yielded_pulls(np, before[one], free, give, **law))
        bends.append(np.clip(give / wires.routing_radius * (pulls[0] - pulls[1]), -limit, limit))
    return np.degrees(wheel / wires.routing_radius), np.degrees(bends[len(wheel) :])


def _bend_radius(design: ScopeDesign) -> float:
    return design.bending.length / math.radians(design.limits.largest)


def lens_half_angle(design: ScopeDesign) -> float:
    """Largest angle from its axis that the lens shows in any pixel of its picture [rad]."""
    lens = lens_of(design.tip, *_PIXELS)
    return float(np.arccos(-lens.grid[lens.within][:, 2]).max())


def _optics(design: ScopeDesign) -> list[dict[str, Any]]:
    """Field and direction of view by ISO 8600-3: method A from the distal window, method B from the entrance pupil."""
    half = lens_half_angle(design)
    seen = (TARGET + PUPIL) * math.tan(min(half, _FLATTEST))
    return [
        row("field of view, method B (from the entrance pupil)", 2 * math.degrees(half), "degrees"),
        row("field of view, method A (from the distal window)", 2 * math.degrees(math.atan(seen / TARGET)), "degrees"),
        row("direction of view", design.tip.camera_tilt_deg, "degrees"),
    ]
