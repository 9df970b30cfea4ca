"""Test rigs: one track pressed on a flat strip, and the whole device in a round tube held by a string."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidDesignError, InvalidOptionError
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.device import Tracked, add_tracked

TIMESTEP = 1e-3
"""Default step [s]; tests hold results at twice this."""
TUBE_TIMESTEP = 5e-4
"""Default step of the whole device in a tube [s]: a pad over a seam stands on two staves, twice as stiff."""

STRING_STIFFNESS = 1e4
"""Stiffness of the "inextensible" string [N/m]: 0.3 mm at 3 N."""
STRING_LENGTH = 0.2
"""[m]."""
_TOLERANCE = 1e-6
"""Tolerance of the solver: forces differ by 1e-4 from those at 1e-8, and a step takes a tenth less."""
_TUBE_STAVES = 63
"""Flat boxes that make a round tube: the radius varies by 0.12 %. One less than a multiple of four, so that the four
tracks stand at different places of their staves and cannot all drop into a groove at once, which would hold the device
from rolling as a cogwheel's teeth do. With many more each ball stands on several at once, and they hold it too."""
_STAVE_THICKNESS = 0.005


@dataclass(frozen=True)
class Rig:
    """A spec with a tracked robot in it and how its propulsion is read."""

    spec: mujoco.MjSpec
    tracked: Tracked
    string: str
    """Tendon behind the device, and the sensor of its length; empty where the core is fixed."""

    def tension(self, length: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Tension of the string from its length [N]: the propulsion force, once steady."""
        return STRING_STIFFNESS * np.maximum(length - STRING_LENGTH, 0.0)


def flat_rig(
    design: TrackedDesign,
    *,
    friction: float,
    indentation: float,
    tracks: Sequence[int] = (0,),
    timestep: float = TIMESTEP,
) -> Rig:
    """One track on a fixed core, its tips pressed into a flat strip by a displacement, as in the paper.

    Args:
        design: The robot.
        friction: Coulomb's coefficient between tread and strip.
        indentation: Of both tips [m].
        tracks: One track; its number sets its tooth phase.
        timestep: [s].

    Raises:
        InvalidDesignError: when no force table fits the tread.
        InvalidOptionError: when friction, indentation or step cannot be honoured.
    """
    if not indentation > 0:
        raise InvalidOptionError(f"Indentation is {indentation} m: press by more than 0.")
    spec = empty_spec(timestep)
    extension = min(indentation, design.stroke[1])
    tracked = add_tracked(spec, design, friction=friction, extension=extension, free=False, tracks=tracks)
    operating = tracked.law.indentation(design.bellows.preload / 2)
    height = design.nominal_diameter / 2 + extension + operating - indentation
    spec.worldbody.add_geom(
        name="strip",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.5, design.tread.width / 2, 0.01],
        pos=[0, 0, height],
        quat=[0, 1, 0, 0],
        rgba=[0.9, 0.6, 0.6, 0.5],
    )
    return Rig(spec, tracked, "")


def tube_rig(
    design: TrackedDesign,
    *,
    friction: float,
    diameter: float | None = None,
    timestep: float = TUBE_TIMESTEP,
) -> Rig:
    """The whole device in a round tube, free in six degrees of freedom but for a string behind it.

    Raises:
        InvalidDesignError: when the tube is smaller than the folded device, wider than its reach, or the bellows do
            not press in it.
        InvalidOptionError: when friction or step cannot be honoured.
    """
    diameter = design.nominal_diameter if diameter is None else diameter
    extension = design.extension_in(diameter)
    if design.bellows.force(extension) <= 0:
        raise InvalidDesignError(
            f"Bellows at {design.bellows.pressure:.4g} Pa lifts the tracks off a tube of {diameter * 1e3:.1f} mm: "
            "lower the pressure."
        )
    spec = empty_spec(timestep)
    tracked = add_tracked(spec, design, friction=friction, extension=extension)
    spec.geom(tracked.core).conaffinity = 0  # the treads hold it in the middle
    _add_tube(spec, diameter, length=design.core_length * 4)
    back = design.core_length / 2 + design.core_diameter / 2
    spec.worldbody.add_site(name="post", pos=[-back - STRING_LENGTH, 0, 0])
    string = spec.add_tendon(
        name="string", stiffness=[STRING_STIFFNESS, 0, 0], springlength=[0, STRING_LENGTH], damping=[100, 0, 0]
    )
    string.wrap_site("post")
    string.wrap_site(tracked.tow)
    spec.add_sensor(
        name="string", type=mujoco.mjtSensor.mjSENS_TENDONPOS, objtype=mujoco.mjtObj.mjOBJ_TENDON, objname="string"
    )
    return Rig(spec, tracked, "string")


def empty_spec(timestep: float) -> mujoco.MjSpec:
    """A scene without gravity, and with the solver that suits the tracked robot.

    Raises:
        InvalidOptionError: when the time step [s] cannot be honoured.
    """
    if not 1e-5 <= timestep <= 0.02:
        raise InvalidOptionError(f"Time step is {timestep} s: give one from 0.00001 to 0.02 s.")
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = [0, 0, 0]
    # Conjugate gradients: forces as Newton's to 1e-4, in half the time, since few contacts share the core.
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG
    spec.option.tolerance = _TOLERANCE
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    skipped = mujoco.mjtDisableBit
    # One robot is one island: looking for others costs a few percent.
    spec.option.disableflags |= skipped.mjDSBL_AUTORESET | skipped.mjDSBL_MULTICCD | skipped.mjDSBL_ISLAND
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return spec


def _add_tube(spec: mujoco.MjSpec, diameter: float, *, length: float) -> None:
    """Staves around a polygon of the tube's area, so that bellows are as long in it, on average, as in the tube."""
    sector = np.pi / _TUBE_STAVES
    radius, thickness = diameter / 2 * np.sqrt(sector / np.tan(sector)), _STAVE_THICKNESS
    half_width = (radius + 2 * thickness) * np.tan(sector)
    for stave, angle in enumerate(2 * np.pi * np.arange(_TUBE_STAVES) / _TUBE_STAVES):
        centre = radius + thickness
        spec.worldbody.add_geom(
            name=f"tube/{stave:03d}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[length / 2, half_width, thickness],
            pos=[0, -centre * np.sin(angle), centre * np.cos(angle)],
            quat=[np.cos(angle / 2), np.sin(angle / 2), 0, 0],
            contype=1,
            conaffinity=0,
            rgba=[0.7, 0.8, 0.9, 0.15],
        )
