"""The tread as a loop: out of the core's end, up to the strut's tips, along them, and back into the other end."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import mujoco

from haustra.assets import asset
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.wall.law import WallContact, apply_contact
from haustra.quantity import load_quantities

_CONTACT = load_quantities(asset("numbers/contact.toml"))

_DAMPING_TIME = 0.005
"""Damping over stiffness of the wall [s], as in a scope's scene; engineering choice."""
_PAD_DAMPING_TIME = 1e-4
"""Damping over stiffness of a pad's contact [s]: next to none, the pad's joint damps."""
CORE_FRICTION = 0.1
"""Coulomb's coefficient of the core's bare ends, as the scope's; engineering choice."""


_Place: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class LoopPart:
    """A straight run of one tread's loop: a capsule whose surface runs along it."""

    track: int
    rear: tuple[float, float, float]
    """Its end to the robot's rear, in the frame of its body: forwards, left and up, which a strut's is outwards [m]."""
    front: tuple[float, float, float]
    """Its other end [m]."""
    geom: str
    """Also the name of its contact sensor: forces of two contacts, each in its own frame, normal first [N]."""
    body: str
    """The strut, or the core."""


def add_loop(
    spec: mujoco.MjSpec,
    core: mujoco.MjsBody,
    strut: mujoco.MjsBody,
    design: TrackedDesign,
    track: int,
    extension: float,
    recess: float,
    *,
    prefix: str,
) -> list[LoopPart]:
    """Close one track's tread around its strut: a ramp at each end and the run between the tips.

    The core's worm meshes with the treads inside the core, so each leaves it at one end and returns at the other. The
    pads of the tips carry the device on a smooth wall; folds and bends meet the ramps, which climb them as a tank does.
    The ramps move with the strut: their inner ends leave the core's surface by as much as the strut moves later. Where
    it folds they sink into the core, whose end would be bare though a tread leaves it at every width: the inner half of
    each ramp as it runs when folded, below which it never is, is part of the core too.

    Args:
        spec: The scene.
        core: The core.
        strut: The track's strut, whose origin lies in the tread's outer face.
        design: The robot.
        track: Its number.
        extension: Of the strut out of the nominal radius where it is built [m].
        recess: How far the run between the tips stands back from the pads' faces at rest [m].
        prefix: Before every name.
    """
    ball, angle = design.tread.width / 2, math.tau * track / TRACKS
    runs, lip = _runs(design, extension, recess), _lip(design, extension, recess)
    parts = [
        LoopPart(track, (rear[0], 0.0, rear[1]), (front[0], 0.0, front[1]), f"{prefix}loop{track}{name}", strut.name)
        for name, (rear, front) in runs.items()
    ]
    for name, ends in (("front", lip), ("rear", [(-forwards, outwards) for forwards, outwards in reversed(lip)])):
        rear, front = ((along, -out * math.sin(angle), out * math.cos(angle)) for along, out in ends)
        parts.append(LoopPart(track, rear, front, f"{prefix}lip{track}{name}", core.name))
    for part in parts:
        (strut if part.body == strut.name else core).add_geom(
            name=part.geom,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            # MuJoCo points a capsule's z axis from the second end to the first: backwards here, as the tread runs.
            fromto=[*part.rear, *part.front],
            size=[ball, 0, 0],
            mass=0,
            contype=0,
            conaffinity=1,
            surfacevel=[0.0] * 6,
            rgba=[0.8, 0.75, 0.6, 1],
        )
        add_contact_sensor(spec, part.geom)
    return parts


def _runs(design: TrackedDesign, extension: float, recess: float) -> dict[str, tuple[_Place, _Place]]:
    """Parts of a tread that move with its strut, rear to front: forwards and outwards of the strut [m]."""
    half, ball, core = design.tread.tip_spacing / 2, design.tread.width / 2, design.core_diameter / 2
    end, radius = design.core_length / 2 + core / 2, design.nominal_diameter / 2 + extension
    outer = -ball - recess
    inner = min(core - radius, outer)
    fold = design.smallest_diameter / 2 - radius
    # Folded, a ramp must not come out of the core's other side: so much of it is left to the core's own part.
    left = min(max(0.0, (ball - core - radius - inner - fold) / max(outer - inner, ball)), 1.0)
    begins = end + left * (half - end), inner + left * (outer - inner)
    return {
        "front": ((half, outer), begins),
        "middle": ((-half, outer), (half, outer)),
        "rear": ((-begins[0], begins[1]), (-half, outer)),
    }


def _lip(design: TrackedDesign, extension: float, recess: float) -> list[_Place]:
    """Inner half of the front ramp as it runs when folded, rear to front: forwards and out of the core's axis [m]."""
    half, ball, core = design.tread.tip_spacing / 2, design.tread.width / 2, design.core_diameter / 2
    end, folded = design.core_length / 2 + core / 2, design.smallest_diameter / 2 - ball - recess
    leaves = min(core, design.nominal_diameter / 2 + extension - ball - recess)
    return [((end + half) / 2, (leaves + folded) / 2), (end, leaves)]


def add_contact_sensor(spec: mujoco.MjSpec, geom: str) -> None:
    """Forces of a geom's two strongest contacts, under the geom's name."""
    spec.add_sensor(
        name=geom,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=geom,
        intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 2, 2],  # the two with the largest force
    )


def soften(
    spec: mujoco.MjSpec, pads: list[str], parts: list[LoopPart], core: str, *, pad_stiffness: float, friction: float
) -> None:
    """Contact for a wall made of pieces: loops and core press into it as a scope does, by its stiffness in N/m.

    Pads keep their own stiffness in series with their joint. They get the implicit contact law too: a ball in the seam
    of two pieces touches both, and with the next to undamped contact of the test rigs its friction would rather hold
    the seams apart than drive (at 2 ms 0.05 to 0.3 of mu N was left). It may raise the normal force while sliding; here
    the bellows set that force, so it cannot.

    Args:
        spec: The scene with the whole robot.
        pads: Geoms of the tips.
        parts: The treads beyond the tips.
        core: Geom of the core.
        pad_stiffness: Of a pad's contact [N/m].
        friction: Coulomb's coefficient of the treads.

    Raises:
        InvalidOptionError: when MuJoCo cannot honour a stiffness at the scene's time step.
    """
    step, wall = spec.option.timestep, _CONTACT["contact.wall_stiffness"].value
    bare = spec.compile()
    for geoms, stiffness, relaxation_time, coefficient in (
        (pads, pad_stiffness, _PAD_DAMPING_TIME, friction),
        ([part.geom for part in parts], wall, _DAMPING_TIME, friction),
        ([core], wall, _DAMPING_TIME, CORE_FRICTION),
    ):
        contact = WallContact(stiffness=stiffness, damping=stiffness * relaxation_time, friction=coefficient)
        apply_contact(spec, bare, geoms, contact, timestep=step)
