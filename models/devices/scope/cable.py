"""The scope as a composite cable: rigid links, bending hinges with native stiffness, few twist hinges, four tendons.

Native joint stiffness is used because every backend honours it; MuJoCo's cable plugin is not (MJX drops its elasticity
without a word).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.devices.scope.cells import Cell
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.outside import Outside
from haustra.models.devices.scope.twist import twist_stiffness
from haustra.models.devices.scope.wires import WIRE_NAMES

LOCK_STRETCH = 0.06
"""A joint outside is freed over this stretch before the anus, its lock falling as distance to the fourth power [m]."""

LOCK_STIFFNESS = 1.6e6
"""Stiffness of a joint held straight further outside [N m/rad]; engineering choice. Across a metre of shaft with joints
every 11 mm the scope gives way at the anus by 0.02 mm/N; were all held by 2e4, by 1.5 mm/N."""

LOCK_GROWTH = 2.0e4
"""Bound of a lock's stiffness, times the cube of its distance from the tip [N m/rad/m^3]: that is how the inertia grows
which it holds. The contact solver sees a lock's torque, but not that the step is implicit in it; locks as firm near the
tip as far from it threw the links inside about, from time steps of 5 ms."""

LOCK_REACH = 0.15
"""Distance from the tip beyond which locks grow by its sixth power more, at time steps up to `LOCK_STEP` [m]: so firm
that shaft outside might as well be left out, to 0.1 % of what is asked (`tests/models/test_left_out.py`)."""

LOCK_STEP = 0.005
"""Longest time step of such locks [s]. With them three of five scopes diverged at 6 to 9 ms, without them none."""

LEAST_LOCK = 20.0
"""Stiffness of a lock near the tip [N m/rad]: a full pull of a wire, 0.3 N m, bends it by a degree."""

LOCK_RELAXATION_TIME = 0.01
"""Damping over stiffness of a lock [s], or two time steps if that is more; engineering choice, so that it is linearly
implicit."""

PULL_OUT_LIMIT = 1.0
"""Fastest that a bent shaft may be pulled out of the patient [m/s], three times as fast as hands do. Joints outside are
held over `LOCK_STRETCH`. At 1.5 m/s a bent one passes it within eight time steps of 5 ms: its lock stiffens faster than
it straightens, and throws the shaft about (`haustra bench stability --only shocks`)."""

ARMATURE_FACTOR = 1.0
"""Armature of a sprung hinge over (damping x time step). Measured: without, contacts chatter at 4 ms; 0.25 stills them
at rest, but a scope jammed in a real colon still diverged within 20 to 50 s; with 1 it did not."""

TURNS = tuple(math.radians(angle) for angle in (0, 135, 45, 90))
"""Hinge axes of four shaft joints in turn, by angle [rad]. Two hinges in series resist a bend askew to both more than
one in the plane of either; axes turned by 45 degrees average that out. The order of hinges leaves a twist, which axes
turned by 90 degrees cancel. This sequence closes a roll-up best of those tried (`tests/physics/test_elastica.py`)."""

SOFTENING = 1 / 9
"""Cubic part of a shaft hinge's spring, torque K (q - q^3 / 9). With axes turned so, a bend phi of a joint costs
K phi^2 / 2 + K phi^4 / 48, averaged over two joints, in every direction; this takes the second term off. Pre-curved
joints go without: their springs act on the bend from rest, the second term on the whole bend."""

SOFTEST = 1.4
"""Stop of a hinge that softens and has no tighter one [rad]. Its torque K (q - q^3 / 9) would fall beyond 1.73 and push
outwards beyond 3: pressed so far, it flew round. A scope bent so within a cell has kinked."""

STOP_SHARE = 1 / (math.sqrt(2) * math.cos(math.pi / 8))
"""Stop of one hinge of a shaft joint over the joint's largest bend. Hinges give a square of angles; the squares of
neighbouring joints stand at 45 degrees, and at this size both together reach 92 to 100 % of it in every direction."""

HAND_PUSH = (4000.0, 80.0)
"""Stiffness [N/m] and damping [N s/m] of the hand along the shaft; engineering choice: 20 N move it by 5 mm."""

HAND_ROLL = (20.0, 0.4)
"""Stiffness [N m/rad] and damping [N m s/rad] of the hand about the shaft; engineering choice."""

HANDLE_MASS = 0.5
"""Mass of handle and hand that move with a push [kg]; engineering choice."""

HANDLE_INERTIA = 1e-3
"""Inertia of handle and hand about the shaft [kg m^2]; engineering choice: 0.5 kg at 45 mm."""


@dataclass(frozen=True)
class Cable:
    """Names of what a scope added to a scene, and where its joints are."""

    cells: tuple[Cell, ...]
    joint_positions: Float[np.ndarray, " joints"]
    """Distance of each joint from the handle end of the modelled part [m]."""
    length: float
    """Modelled length, rigid tip included [m]."""
    radius: float
    """Outer radius [m]."""
    links: tuple[str, ...]
    """Body of each link, from the handle: the root, then one behind each joint."""
    geoms: tuple[str, ...]
    """Capsule of each link, same order."""
    locks: tuple[tuple[str, str], ...]
    """Two actuators a joint, which hold it straight while it is outside the patient."""

    @property
    def tip_links(self) -> int:
        """Links of the bending section, the last ones."""
        return sum(cell.steerable for cell in self.cells)

    @cached_property
    def node_distances(self) -> Float[np.ndarray, " nodes"]:
        """Distance from the tip of the handle end, of each joint, and of the tip itself [m]."""
        return self.length - np.concatenate([[0.0], self.joint_positions, [self.length]])


def add_scope(
    spec: mujoco.MjSpec,
    design: ScopeDesign,
    cells: Sequence[Cell],
    *,
    entry: Float[np.ndarray, "3"],
    frame: Float[np.ndarray, "3 3"],
    inserted: float,
    twist_hinges: int,
    push_limit: float,
    torque_limit: float,
    timestep: float | None,
    cubic: bool = True,
    outside: Outside | None = None,
) -> Cable:
    """Add a straight scope to a scene, its tip `inserted` metres past the entry.

    Joints: slide `scope/push` and hinge `scope/roll` at the handle end, then hinges `scope/bend_x_i` and
    `scope/bend_y_i` in the middle of each cell, and `twist_hinges` hinges `scope/twist_i` spread over the length.
    A bend about x and then y leaves a twist of half their product, which would add up along the scope (order 1 in cell
    length). It cancels (order 2) since hinges of the shaft are turned from joint to joint (`TURNS`), and those of the
    bending section, which stay in line with its wires, come in alternating order.
    Actuators: `scope/push` [m/s], `scope/roll` [rad/s], `scope/pull_up|left|down|right` [N], two locks a joint [0..1].

    Args:
        spec: the scene to add to.
        design: the scope.
        cells: where its joints go (`cut_into_cells`).
        entry: where the scope enters the patient [m].
        frame: columns are two normals and the entry direction.
        inserted: distance from the entry to the tip at the start [m].
        twist_hinges: number of hinges that carry the torsional compliance; 0 makes the scope stiff in torsion.
        push_limit: largest force at the handle [N].
        torque_limit: largest torque at the handle [N m].
        timestep: time step that damping and armature of the joints are made for, so that springs are stable and
            contact forces right [s]; None for the damping of the design and no armature.
        cubic: let hinges of the shaft soften (`SOFTENING`); not every backend has such springs, and without it bends of
            9 degrees a joint are 0.2 % too stiff.
        outside: shaft between the handle and the first cell that is left out; it says where the rest twists.

    Returns:
        What was added, by name.
    """
    radius = design.diameter / 2
    length = cells[-1].start + cells[-1].length + design.tip.length
    ends = [*(cell.joint for cell in cells), length]
    twists = outside.twists if outside else twist_stiffness(cells, twist_hinges)

    body = _add_root(spec, outside or Outside(), entry=entry, frame=frame, behind=length - inserted)
    links, geoms = [body.name], [_add_link(body, design, ends[0], "root")]
    _add_handle_actuators(spec, push_limit=push_limit, torque_limit=torque_limit)
    locks = []
    for index, cell in enumerate(cells):
        previous = cells[index - 1].joint if index else 0.0
        body = body.add_body(name=f"scope/link_{index:03d}", pos=[0, 0, cell.joint - previous])
        twist = twists.get(index)
        _add_joints(body, design, cell, index=index, twist=twist, cubic=cubic, timestep=timestep)
        lock = lock_spring(length - cell.joint, timestep)
        locks.append(tuple(_add_lock(spec, f"scope/bend_{side}_{index:03d}", lock) for side in "xy"))
        last = index + 1 == len(cells)
        geoms.append(_add_link(body, design, ends[index + 1] - cell.joint, f"{index:03d}", last=last))
        links.append(body.name)
    _add_tip(body, design, ends[-1] - ends[-2])
    _add_wires(spec, design, cells)
    return Cable(
        cells=tuple(cells),
        joint_positions=np.array([cell.joint for cell in cells]),
        length=length,
        radius=radius,
        links=tuple(links),
        geoms=tuple(geoms),
        locks=tuple(locks),
    )


def _add_root(spec: mujoco.MjSpec, outside: Outside, *, entry, frame, behind: float):
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(frame, dtype=float).ravel())
    root = spec.worldbody.add_body(name="scope/root", pos=entry - behind * frame[:, 2], quat=quat)
    along = {"axis": [0, 0, 1], "armature": HANDLE_MASS + outside.mass}
    about = {"axis": [0, 0, 1], "armature": HANDLE_INERTIA + outside.inertia}
    root.add_joint(name="scope/push", type=mujoco.mjtJoint.mjJNT_SLIDE, **along)
    root.add_joint(name="scope/roll", type=mujoco.mjtJoint.mjJNT_HINGE, **about)
    return root


def _add_link(body, design: ScopeDesign, length: float, label: str, *, last: bool = False) -> str:
    """A capsule from one joint to the next; neighbours share a round joint. The last one's cap ends at the tip."""
    geom = body.add_geom(
        name=f"scope/geom_{label}",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0, 0, 0, 0, 0, max(length - design.diameter / 2, length / 2) if last else length],
        size=[design.diameter / 2, 0, 0],
        mass=design.mass_per_length * length,
        rgba=[0.12, 0.13, 0.15, 1],
        contype=0,
        conaffinity=1,
    )
    return geom.name


def _add_joints(
    body, design: ScopeDesign, cell: Cell, *, index: int, twist: float | None, cubic: bool, timestep: float | None
) -> None:
    turn = 0.0 if cell.steerable else TURNS[index % len(TURNS)]
    hinges = []
    for name, angle in (("bend_x", turn), ("bend_y", turn + math.pi / 2)):
        axis = np.array([math.cos(angle), math.sin(angle), 0.0])
        joint = _hinge(f"scope/{name}_{index:03d}", axis, cell.joint_stiffness, design.relaxation_time, timestep)
        joint["springref"] = float(axis[:2] @ [-cell.bias_left, cell.bias_up])
        if cubic and not (cell.steerable or cell.bias_up or cell.bias_left):
            joint["stiffness"] = [cell.joint_stiffness, 0, -SOFTENING * cell.joint_stiffness]
            joint |= {"limited": True, "range": [-SOFTEST, SOFTEST]}
        hinges.append({**joint, **_stop(cell, name)})
    if cell.steerable and index % 2:
        hinges.reverse()
    if twist is not None:
        joint = _hinge(f"scope/twist_{index:03d}", np.array([0, 0, 1]), twist, design.relaxation_time, timestep)
        hinges.insert(2 * (index % 2), joint)
    for joint in hinges:
        body.add_joint(**joint)


def _stop(cell: Cell, name: str) -> dict[str, object]:
    """Range of a hinge: in the bending section that of its own side, in the shaft the same all round."""
    if cell.largest is None:
        return {}
    up, left, down, right = cell.largest
    if not cell.steerable:
        up = left = down = right = min(STOP_SHARE * up, SOFTEST)
    return {"limited": True, "range": [-left, right] if name == "bend_x" else [-down, up]}


def _hinge(
    name: str, axis: np.ndarray, stiffness: float, relaxation_time: float, timestep: float | None
) -> dict[str, Any]:
    """A sprung hinge that stays stable, and leaves contact forces right, at time steps far above its own period.

    Damping of K h makes the spring linearly implicit. The constraint solver, however, sees the bare inertia and the
    explicit spring torque; where K h^2 exceeds the inertia, contact forces chatter. Armature of that order removes it;
    it slows only motion faster than the time step resolves.
    """
    step = timestep or 0.0
    damping = stiffness * (relaxation_time + step)
    return {
        "name": name,
        "axis": axis,
        "stiffness": [stiffness, 0, 0],
        "damping": [damping, 0, 0],
        "armature": ARMATURE_FACTOR * damping * step,
    }


def lock_spring(from_tip: float, timestep: float | None) -> tuple[float, float]:
    """Stiffness [N m/rad] and damping [N m s/rad] of the lock of a joint that far from the tip [m]."""
    step = timestep or 0.0
    firmer = 1 + (from_tip / LOCK_REACH) ** 6 if step <= LOCK_STEP else 1.0
    stiffness = min(LOCK_STIFFNESS, max(LOCK_GROWTH * from_tip**3 * firmer, LEAST_LOCK))
    return stiffness, stiffness * max(LOCK_RELAXATION_TIME, 2 * step)


def _add_lock(spec, joint: str, lock: tuple[float, float]) -> str:
    """An actuator with force = ctrl * (-K q - B dq): a spring that its control switches on.

    Being a control and not an edit of the model, it keeps the run a function of plain MJCF and its inputs.
    """
    name = joint.replace("bend", "lock")
    spec.add_actuator(
        name=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=joint,
        gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
        gainprm=[0, -lock[0], -lock[1], *[0] * 7],
        ctrllimited=True,
        ctrlrange=[0, 1],
        group=3,
    )
    return name


def _add_handle_actuators(spec, *, push_limit: float, torque_limit: float) -> None:
    """Hand: its control is a speed; the position it aims at is integrated from it, so that force stays smooth."""
    for name, (stiffness, damping), limit in (
        ("scope/push", HAND_PUSH, push_limit),
        ("scope/roll", HAND_ROLL, torque_limit),
    ):
        spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=name,
            dyntype=mujoco.mjtDyn.mjDYN_INTEGRATOR,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            gainprm=[stiffness, *[0] * 9],
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[0, -stiffness, -damping, *[0] * 7],
            forcelimited=True,
            forcerange=[-limit, limit],
        )


def _add_tip(body, design: ScopeDesign, length: float) -> None:
    tip = design.tip
    place = [tip.camera_offset_up, tip.camera_offset_left, length]
    tilt = math.radians(tip.camera_tilt_deg)
    body.add_site(name="scope/tip", pos=[0, 0, length])
    # MuJoCo's cameras look along their own -z, so the camera is turned about x by half a turn, then tilted about y.
    body.add_camera(
        name="scope/camera",
        pos=place,
        quat=[0, math.cos(tilt / 2), 0, -math.sin(tilt / 2)],
        fovy=min(tip.field_of_view_deg, 160.0),
    )
    body.add_light(
        name="scope/light",
        pos=place,
        dir=[math.sin(tilt), 0, math.cos(tilt)],
        diffuse=[0.7 * tip.light] * 3,
        cutoff=80,
        attenuation=[1, 0, 100],
        castshadow=False,  # the camera is beside the lamp and sees none, and drawing them takes longer than the picture
    )


def _add_wires(spec: mujoco.MjSpec, design: ScopeDesign, cells: Sequence[Cell]) -> None:
    """Four wires along the bending section, as linear functions of its joint angles.

    A wire at distance r from the axis of a continuous, bent section is shorter by r times the angle towards its side,
    whatever the shape. Eyelets on rigid links come close to that (moment arm r cos(phi/2) -+ a sin(phi/2) with eyelets
    at distance a from a joint bent by phi); a fixed tendon is that, and costs less.
    """
    radius = design.wires.routing_radius
    for number, name in enumerate(WIRE_NAMES):
        angle = number * math.pi / 2
        tendon = spec.add_tendon(name=f"scope/wire_{name}")
        for index, cell in enumerate(cells):
            if cell.steerable:
                tendon.wrap_joint(f"scope/bend_x_{index:03d}", radius * math.sin(angle))
                tendon.wrap_joint(f"scope/bend_y_{index:03d}", -radius * math.cos(angle))
        spec.add_actuator(
            name=f"scope/pull_{name}",
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            target=tendon.name,
            gainprm=[-1, *[0] * 9],
            ctrllimited=True,
            ctrlrange=[0, design.wires.pull_limit],
        )
