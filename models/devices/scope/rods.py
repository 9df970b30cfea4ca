"""Uniform clamped rods behind one interface: the scope's cable, MuJoCo's plugin cable, its 1D flex, a plain chain.

The scope's cable is what every scene uses. The others are bases that it is compared with.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.devices.scope.cable import add_scope
from haustra.models.devices.scope.cells import cut_into_cells
from haustra.models.devices.scope.design import BendingLimits, ScopeDesign, ScopeSection, ScopeTip
from haustra.models.devices.scope.wires import WireSet

_GHOST = 1e-3
"""Length of the stretch that clamps a flex rod, over that of its others: a bend's stiffness is that of the mean length
on either side, so that one of no length leaves the clamped end a half cell."""
_NO_TIP = 1e-9
"""Length of the rigid tip that a scope must have, for rods that have none [m]."""


@dataclass(frozen=True)
class UniformRod:
    """A rod of uniform round section, clamped at one end, straight at rest along z."""

    length: float
    """[m]."""
    radius: float
    """[m]."""
    flexural_rigidity: float
    """EI [N m^2]."""
    torsional_rigidity: float
    """GJ [N m^2]."""
    mass_per_length: float
    """[kg/m]."""
    relaxation_time: float = 0.0
    """Viscous torque per rate over elastic torque per angle [s]."""


@dataclass(frozen=True)
class RodModel:
    """A rod ready to compile, and where its middle and its tip are."""

    spec: mujoco.MjSpec
    kind: str
    backends: frozenset[str]
    """Backends that honour all of it."""
    mid: tuple[tuple[str, tuple[float, float, float], float], ...]
    """Bodies that share a load at mid-length: name, place in its frame [m], share [1]."""
    tip: tuple[str, tuple[float, float, float]]
    """Body and place of the tip."""
    integrator: mujoco.mjtIntegrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    """With which it is stepped."""

    def require(self, backend: str) -> None:
        """Refuse a backend that would drop part of the rod.

        Raises:
            UnsupportedSceneError: by name, when the backend cannot honour this kind of rod.
        """
        if backend not in self.backends:
            raise UnsupportedSceneError(
                f"Backend '{backend}' cannot honour the rod '{self.kind}': "
                f"it runs on {', '.join(sorted(self.backends))}."
            )


def hinge_rod(
    rod: UniformRod,
    joints: int,
    *,
    twist_hinges: int | None = None,
    timestep: float | None = None,
    cubic: bool = True,
) -> RodModel:
    """The scope's cable: two bending hinges a joint, `twist_hinges` twist hinges (one a joint when None).

    MJX on JAX drops the cubic part of springs without a word, so it runs the cable with `cubic` off only.
    """
    _require_joints(joints)
    spec = _empty_spec()
    design = scope_of(rod, joints)
    cell = rod.length / joints
    cells = cut_into_cells(design, shaft_cell=cell, bending_cell=cell)
    add_scope(
        spec,
        design,
        cells,
        entry=np.zeros(3),
        frame=np.eye(3),
        inserted=design.length,
        twist_hinges=joints if twist_hinges is None else twist_hinges,
        push_limit=1.0,
        torque_limit=1.0,
        timestep=timestep,
        cubic=cubic,
    )
    clamp_handle(spec)
    for element in (*spec.actuators, *spec.tendons):
        spec.delete(element)
    ends = [0.0, *(each.joint for each in cells)]
    names = ["scope/root", *(f"scope/link_{index:03d}" for index in range(joints))]
    before = int(np.searchsorted(ends, rod.length / 2 - 1e-9)) - 1
    mid = [(names[before], (0.0, 0.0, rod.length / 2 - ends[before]), 1.0)]
    if joints % 2:  # the middle is a joint: links on both sides share the load
        mid = [(*mid[0][:2], 0.5), (names[before + 1], (0.0, 0.0, 0.0), 0.5)]
    tip = (names[-1], (0.0, 0.0, rod.length - ends[-1]))
    kind, backends = ("hinges", {"native", "warp"}) if cubic else ("linear hinges", {"native", "mjx", "warp"})
    return RodModel(spec, kind, frozenset(backends), tuple(mid), tip)


def linear_hinge_rod(rod: UniformRod, joints: int) -> RodModel:
    """The scope's cable with linear springs, which every backend honours."""
    return hinge_rod(rod, joints, cubic=False)


def plugin_rod(rod: UniformRod, joints: int) -> RodModel:
    """MuJoCo's `<composite type="cable">` with its elasticity plugin: ball joints between segments, first one clamped.

    The plugin takes Young's and the shear modulus of a round section and adds its own forces; MJX drops them without a
    word, so only the native backend may run it. Its `joints` joints stand at the ends of `joints + 1` segments.
    """
    _require_joints(joints)
    inertia = math.pi * rod.radius**4 / 4
    segments = joints + 1
    xml = f"""
    <mujoco>
      <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
      <worldbody>
        <composite type="cable" curve="0 0 s" count="{segments + 1} 1 1" size="{rod.length}" offset="0 0 0"
          initial="none" prefix="rod">
          <plugin plugin="mujoco.elasticity.cable">
            <config key="twist" value="{rod.torsional_rigidity / (2 * inertia)}"/>
            <config key="bend" value="{rod.flexural_rigidity / inertia}"/>
            <config key="vmax" value="0"/>
          </plugin>
          <joint kind="main" damping="{rod.flexural_rigidity * segments / rod.length * rod.relaxation_time}"
          armature="0"/> <geom type="capsule" size="{rod.radius}" contype="0" conaffinity="0"/>
        </composite>
      </worldbody>
    </mujoco>"""
    spec = mujoco.MjSpec.from_string(xml)
    spec.option.gravity = [0, 0, 0]
    bodies = [body for body in spec.bodies if body.name.startswith("rodB")]
    for body in bodies:
        body.explicitinertial = True
        share = rod.length / segments
        body.mass, body.ipos = rod.mass_per_length * share, [share / 2, 0, 0]
        across = body.mass * (share**2 / 12 + rod.radius**2 / 4)
        body.inertia, body.iquat = [body.mass * rod.radius**2 / 2, across, across], [1, 0, 0, 0]
    half = segments // 2
    place = (0.0, 0.0, 0.0) if segments % 2 == 0 else (rod.length / segments / 2, 0.0, 0.0)
    last = (bodies[-1].name, (rod.length / segments, 0.0, 0.0))
    return RodModel(spec, "cable plugin", frozenset({"native"}), ((bodies[half].name, place, 1.0),), last)


def flex_rod(rod: UniformRod, joints: int) -> RodModel:
    """MuJoCo's 1D flex, a discrete elastic rod: points that slide freely, `joints` equal stretches held by equalities.

    It bends and does not twist. Only the integrator 'discrete' takes its bending and damping implicitly; with others it
    diverges at the steps of scenes.
    """
    _require_joints(joints)
    stretch = rod.length / joints
    heights = [-_GHOST * stretch, *(stretch * index for index in range(joints + 1))]
    points = " ".join(f"0 0 {height!r}" for height in heights)
    elements = " ".join(f"{index} {index + 1}" for index in range(joints + 1))
    clamped = rod.mass_per_length * stretch / 2
    xml = f"""
    <mujoco>
      <worldbody>
        <body name="clamp">
          <inertial pos="0 0 0" mass="{clamped}" diaginertia="1e-9 1e-9 1e-9"/>
          <flexcomp name="rod" type="direct" dim="1" radius="{rod.radius}" point="{points}" element="{elements}">
            <elasticity young="{4 * rod.flexural_rigidity / (math.pi * rod.radius**4)}"
            damping="{rod.relaxation_time}"/> <edge equality="true" solref="0.001 1" solimp="0.9999 0.9999 0.001"/>
            <contact selfcollide="none" contype="0" conaffinity="0"/>
            <pin id="0 1"/>
          </flexcomp>
        </body>
      </worldbody>
    </mujoco>"""
    spec = mujoco.MjSpec.from_string(xml)
    spec.option.gravity = [0, 0, 0]
    for index in range(1, joints + 1):
        spec.body(f"rod_{index + 1}").mass = (2 if index < joints else 1) * clamped
    half = joints // 2
    here = (0.0, 0.0, 0.0)
    mid = [(f"rod_{half + 1}", here, 1.0)]
    if joints % 2:  # the middle is between two points
        mid = [(f"rod_{half + 1}", (0.0, 0.0, stretch / 2), 0.5), (f"rod_{half + 2}", (0.0, 0.0, -stretch / 2), 0.5)]
    return RodModel(
        spec,
        "1D flex",
        frozenset({"native"}),
        tuple(mid),
        (f"rod_{joints + 1}", here),
        mujoco.mjtIntegrator.mjINT_DISCRETE,
    )


def chain_rod(rod: UniformRod, joints: int) -> RodModel:
    """A plain chain: equal links, the joints at their ends, two hinges in fixed order, no half cells."""
    _require_joints(joints)
    spec = _empty_spec()
    link = rod.length / joints
    body = spec.worldbody
    for index in range(joints):
        body = body.add_body(name=f"link_{index:03d}", pos=[0, 0, link if index else 0.0])
        stiffness = rod.flexural_rigidity / link
        for name, axis in (("x", [1, 0, 0]), ("y", [0, 1, 0])):
            body.add_joint(
                name=f"{name}_{index:03d}",
                axis=axis,
                stiffness=[stiffness, 0, 0],
                damping=[stiffness * rod.relaxation_time, 0, 0],
            )
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0, 0, 0, 0, 0, link],
            size=[rod.radius, 0, 0],
            mass=rod.mass_per_length * link,
            contype=0,
            conaffinity=0,
        )
    half = f"link_{joints // 2:03d}"
    mid = ((half, (0.0, 0.0, 0.0 if joints % 2 == 0 else link / 2), 1.0),)
    return RodModel(spec, "plain chain", frozenset({"native", "mjx", "warp"}), mid, (body.name, (0.0, 0.0, link)))


RODS: dict[str, Callable[[UniformRod, int], RodModel]] = {
    "hinges": hinge_rod,
    "linear hinges": linear_hinge_rod,
    "cable plugin": plugin_rod,
    "1D flex": flex_rod,
    "plain chain": chain_rod,
}
"""Every kind of rod, by name."""


def clamp_handle(spec: mujoco.MjSpec) -> None:
    """Hold the handle end of a scope rigidly: no slide, no roll, no hand."""
    for name in ("scope/push", "scope/roll"):
        spec.delete(spec.actuator(name))
        spec.delete(spec.joint(name))


def scope_of(rod: UniformRod, joints: int) -> ScopeDesign:
    """The rod as a scope whose last cell is its bending section, alike in everything."""
    shaft, bending = (
        ScopeSection(
            length=length,
            flexural_rigidity=rod.flexural_rigidity,
            torsional_rigidity=rod.torsional_rigidity,
        )
        for length in (rod.length * (1 - 1 / joints), rod.length / joints)
    )
    widest = min(0.9 * math.degrees(bending.length / rod.radius), 1080.0)  # as far as a scope may bend
    return ScopeDesign(
        name="uniform rod",
        diameter=2 * rod.radius,
        mass_per_length=rod.mass_per_length,
        relaxation_time=max(rod.relaxation_time, 1e-12),
        shaft=(shaft,),
        bending=bending,
        limits=BendingLimits(up=widest, left=widest, down=widest, right=widest),
        wires=WireSet(routing_radius=0.4 * rod.radius, pull_limit=1.0),
        tip=ScopeTip(length=_NO_TIP, field_of_view_deg=90.0),
    )


def _empty_spec() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.gravity = [0, 0, 0]
    return spec


def _require_joints(joints: int) -> None:
    if not 2 <= joints <= 1000:
        raise InvalidOptionError(f"A rod of {joints} joints cannot be built: give 2 to 1000.")
