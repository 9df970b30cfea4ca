"""The scene that a competent user would write with MuJoCo alone: its plugin cable pushed through every piece of wall.

Everything is MuJoCo's default (Euler, Newton, pyramidal cones, contact softness) but for what the scope itself asks
for: stiffness, mass, friction, the hand. A channel of four boxes guides the shaft outside the patient, which would
otherwise buckle at once.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.cable import HAND_PUSH, HANDLE_MASS
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.scene import SceneOptions, add_wall, entry_of
from haustra.models.wall.pieces.wall import Wall

_CHANNEL_GAP, _CHANNEL_SIDE = 5e-4, 0.01
"""Room of the shaft in its channel, and half thickness of the channel's boxes [m]."""


@dataclass(frozen=True)
class PlainScope:
    """A plain scene, compiled, and where its scope starts."""

    model: mujoco.MjModel
    start: float
    """Depth of the tip [m]."""
    tip: tuple[int, Float[np.ndarray, "3"]]
    """Body, and the tip's place in its frame [m]."""

    def begin(self) -> mujoco.MjData:
        """The scope straight at the anus."""
        return mujoco.MjData(self.model)

    def tip_of(self, data: mujoco.MjData) -> Float[np.ndarray, "3"]:
        """Where the tip is [m]."""
        body, place = self.tip
        return data.xpos[body] + data.xmat[body].reshape(3, 3) @ place


def plain_scope(
    colon: Colon,
    wall: Wall,
    design: ScopeDesign,
    *,
    segments: int,
    timestep: float,
    options: SceneOptions | None = None,
    damped: bool = False,
) -> PlainScope:
    """Build it.

    Args:
        colon: the colon.
        wall: all its pieces stand in the scene.
        design: the scope; uniform but for its softer bending section.
        segments: of the cable.
        timestep: [s].
        options: friction, push limit and start depth are taken from here.
        damped: give every joint the design's own damping (loss time times stiffness) instead of MuJoCo's, none.
    """
    options = options or SceneOptions()
    length = colon.centreline.length + options.start_depth
    spec = mujoco.MjSpec.from_string(_xml(colon, design, options, length, segments, timestep, damped=damped))
    _soften_bending_section(spec, design, length / segments)
    add_wall(spec, wall)
    for geom in spec.geoms:
        geom.friction[0] = options.friction  # MuJoCo takes the larger of both geoms
    model = spec.compile()
    body = model.body("rodB_last").id
    return PlainScope(model, options.start_depth, (body, np.array([length / segments, 0.0, 0.0])))


def _xml(
    colon: Colon,
    design: ScopeDesign,
    options: SceneOptions,
    length: float,
    segments: int,
    timestep: float,
    *,
    damped: bool,
) -> str:
    entry, frame = entry_of(colon)
    radius, section = design.diameter / 2, design.shaft[0]
    inertia = math.pi * radius**4 / 4
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(frame).ravel())
    place = entry - (length - options.start_depth) * frame[:, 2]
    damping = design.relaxation_time * section.flexural_rigidity * segments / length if damped else 0.0
    outside = length - options.start_depth
    off, wide = radius + _CHANNEL_GAP + _CHANNEL_SIDE, 3 * _CHANNEL_SIDE
    sides = ((_CHANNEL_SIDE, wide, off, 0.0), (_CHANNEL_SIDE, wide, -off, 0.0))
    sides += ((wide, _CHANNEL_SIDE, 0.0, off), (wide, _CHANNEL_SIDE, 0.0, -off))
    channel = "".join(
        f'<geom type="box" size="{x} {y} {outside / 2}" pos="{px} {py} {outside / 2}" contype="1" conaffinity="0"/>'
        for x, y, px, py in sides
    )
    return f"""
    <mujoco>
      <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
      <option timestep="{timestep}" gravity="0 0 0"><flag autoreset="disable"/></option>
      <size memory="400M"/>
      <worldbody>
        <body pos="{_text(place)}" quat="{_text(quat)}">
          {channel}
          <body name="hand">
            <joint name="push" type="slide" axis="0 0 1"/>
            <geom size="0.005" mass="{HANDLE_MASS}" contype="0" conaffinity="0"/>
            <composite type="cable" curve="0 0 s" count="{segments + 1} 1 1" size="{length}" initial="none"
              prefix="rod">
              <plugin plugin="mujoco.elasticity.cable">
                <config key="twist" value="{section.torsional_rigidity / (2 * inertia)}"/>
                <config key="bend" value="{section.flexural_rigidity / inertia}"/>
                <config key="vmax" value="0"/>
              </plugin>
              <joint kind="main" damping="{damping}"/>
              <geom type="capsule" size="{radius}" density="{design.mass_per_length / (math.pi * radius**2)}"
                contype="0" conaffinity="1"/>
            </composite>
          </body>
        </body>
      </worldbody>
      <actuator>
        <position joint="push" kp="{HAND_PUSH[0]}" kv="{HAND_PUSH[1]}"
          forcerange="{-options.push_limit} {options.push_limit}"/>
      </actuator>
    </mujoco>"""


def _soften_bending_section(spec: mujoco.MjSpec, design: ScopeDesign, cell: float) -> None:
    """The plugin takes a segment's stiffness from its first geom: there, a thinner one that touches nothing."""
    ratio = design.bending.flexural_rigidity / design.shaft[0].flexural_rigidity
    bodies = [body for body in spec.bodies if body.name.startswith("rodB")]
    for body in bodies[-max(1, round(design.bending.length / cell)) :]:
        outer = body.geoms[0]
        thick, ends = outer.size[0], np.array(outer.fromto)
        outer.mass, outer.conaffinity = design.mass_per_length * cell, 0
        outer.size = [thick * ratio**0.25, *outer.size[1:]]
        ends = ends if np.isfinite(ends).all() else np.array([0, 0, 0, cell, 0, 0])
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=ends,
            size=[thick, 0, 0],
            mass=0,
            contype=0,
            conaffinity=1,
        )


def _text(values: Float[np.ndarray, " n"]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
