"""The robot that drives in colons, held by a string in a straight tube: as the rigs hold it, to compare with them."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment
from haustra.models.anatomy.tube import tube
from haustra.models.device_scene import DeviceScene, build_device_scene, device_options, pose_in
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.provenance import Provenance

STRING = "tracked/string"
STIFFNESS = 250.0
"""Stiffness of the string at 1:1 [N/m], with the scale: a millimetre at what the robot pulls."""
_DAMPING = 5.0
"""Damping of the string at 1:1 [N s/m], with the scale; engineering choice."""
_LENGTH = 0.05
"""Length of the string at 1:1, with the scale [m]."""
_STATIONS, _ANGLES = 200, 48


def straight_tube(design_scale: float, diameter: float) -> Colon:
    """A round tube as a colon, long enough for the robot."""
    length = 0.24 * design_scale
    arc = np.linspace(0.0, length, _STATIONS)
    points = np.column_stack([np.zeros((_STATIONS, 2)), arc])
    frames = np.broadcast_to(np.eye(3), (_STATIONS, 3, 3)).copy()
    radius = np.full((_STATIONS, _ANGLES), diameter / 2)
    return Colon(
        name="straight tube",
        lumen=tube(points, frames, radius),
        centreline=Centreline(points, arc, frames),
        radius=radius,
        segments=(ColonSegment("rectum", 0.0, length),),
        provenance=Provenance(inputs={}, configuration={}),
    )


def held_scene(device: TrackedRobot, *, diameter: float, friction: float, timestep: float) -> tuple[DeviceScene, Colon]:
    """The robot in a straight tube [m], a string from its rear to a post; nothing trails it.

    Raises:
        InvalidDesignError: when it does not fit into the tube.
    """
    design = device.design
    free = replace(device, design=replace(design, tether=replace(design.tether, mass_per_length=0.0, held=0.0)))
    scale, colon = design.scale, straight_tube(design.scale, diameter)
    options = device_options(free, friction=friction, timestep=timestep, start_depth=0.12 * scale)
    scene = build_device_scene(free, options, pose=pose_in(colon, free, options))
    rear = design.core_length / 2 + design.core_diameter / 2
    post = scene.pose.position - scene.pose.frame[:, 2] * (rear + _LENGTH * scale)
    scene.spec.worldbody.add_site(name="tracked/post", pos=post)
    string = scene.spec.add_tendon(
        name=STRING,
        stiffness=[STIFFNESS * scale, 0, 0],
        springlength=[0, _LENGTH * scale],
        damping=[_DAMPING * scale, 0, 0],
    )
    string.wrap_site("tracked/post")
    string.wrap_site("tracked/tow")
    return scene, colon


def tension(scene: DeviceScene, length: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Tension of the string from its length [N]."""
    scale = scene.device.design.scale if isinstance(scene.device, TrackedRobot) else 1.0
    return STIFFNESS * scale * np.maximum(length - _LENGTH * scale, 0.0)
