"""The tread as a loop: out of the core's end, up to the strut's tips, along them, and back into the other end."""

from dataclasses import dataclass

import mujoco

from haustra.assets import asset
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.wall.law import WallContact, apply_contact
from haustra.quantity import load_quantities

_CONTACT = load_quantities(asset("numbers/contact.toml"))

_DAMPING_TIME = 0.005
"""Damping over stiffness of the wall [s], as in a scope's scene; engineering choice."""
_PAD_DAMPING_TIME = 1e-4
"""Damping over stiffness of a pad's contact [s]: next to none, the pad's joint damps."""
CORE_FRICTION = 0.1
"""Coulomb's coefficient of the core's bare ends, as the scope's; engineering choice."""


@dataclass(frozen=True)
class LoopPart:
    """A straight run of one tread's loop: a capsule whose surface runs along it."""

    track: int
    rear: tuple[float, float]
    """Its end to the robot's rear: forwards and outwards of the strut [m]."""
    front: tuple[float, float]
    """Its other end [m]."""
    geom: str
    """Also the name of its contact sensor: forces of two contacts, each in its own frame, normal first [N]."""


def add_loop(
    spec: mujoco.MjSpec, strut, design: TrackedDesign, track: int, extension: float, recess: float, *, prefix: str
) -> list[LoopPart]:
    """Close one track's tread around its strut: a ramp at each end and the run between the tips.

    The core's worm meshes with the treads inside the core, so each leaves it at one end and returns at the other. The
    pads of the tips carry the device on a smooth wall; folds and bends meet the ramps, which climb them as a tank does.
    The ramps move with the strut: their inner ends leave the core's surface by as much as the strut moves later.

    Args:
        spec: The scene.
        strut: The track's strut, whose origin lies in the tread's outer face.
        design: The robot.
        track: Its number.
        extension: Of the strut out of the nominal radius where it is built [m].
        recess: How far the run between the tips stands back from the pads' faces at rest [m].
        prefix: Before every name.
    """
    half, ball = design.tread.tip_spacing / 2, design.tread.width / 2
    end = design.core_length / 2 + design.core_diameter / 4
    outer = -ball - recess
    inner = min(design.core_diameter / 2 - (design.nominal_diameter / 2 + extension), outer)
    runs = {
        "front": ((half, outer), (end, inner)),
        "middle": ((-half, outer), (half, outer)),
        "rear": ((-end, inner), (-half, outer)),
    }
    parts = []
    for name, (rear, front) in runs.items():
        part = LoopPart(track, rear, front, f"{prefix}loop{track}{name}")
        strut.add_geom(
            name=part.geom,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            # MuJoCo points a capsule's z axis from the second end to the first: backwards here, as the tread runs.
            fromto=[rear[0], 0, rear[1], front[0], 0, front[1]],
            size=[ball, 0, 0],
            mass=0,
            contype=0,
            conaffinity=1,
            surfacevel=[0.0] * 6,
            rgba=[0.8, 0.75, 0.6, 1],
        )
        add_contact_sensor(spec, part.geom)
        parts.append(part)
    return parts


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
