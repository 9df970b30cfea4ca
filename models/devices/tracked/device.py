"""The tracked robot as bodies of an MjSpec: core, struts on bellows, pads whose surface runs like the treads."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.law import PadLaw, load_law
from haustra.models.devices.tracked.looks import HIDDEN, draw_core, draw_strut
from haustra.models.devices.tracked.loop import CORE_FRICTION, LoopPart, add_loop, soften
from haustra.models.wall.law import require_impedance_ratio

TIPS = ("rear", "front")
"""The two tips of a strut set."""

_CONTACT_STIFFNESS = 1e4
"""Stiffness of a pad's contact at 4:1 [N/m], in series with the pad's joint, which is stiffened for it.

A contact much stiffer than this chatters while the tread slides: MuJoCo's convex friction adds mu b v to the normal
force, so a pad that barely touches jumps. Here the pad stands 0.1 mm deep, and contact damping may be next to none."""
_CONTACT_IMPEDANCE = 0.25
"""Constant. With a slide along the normal this halves the pad's own damping, no more (docs/theory/tracked.md)."""
_CONTACT_DAMPING = 2.5
"""Rate of the contact's direct solref [1/s]: raises the normal force by 0.1 % at 65 mm/s; the joint damps instead."""
_IMPRATIO = 1e5
"""Friction stiffer than the normal direction, so that it saturates at the slowest tread speed, also where a track is
pressed by its full stroke; 1e3 left 17 to 83 % of mu N out there."""
_FREE_IMPRATIO = 1e4
"""Impratio of a whole device, whose bellows set the press: a tenth fewer iterations, the same forces (tests)."""
_LOOP_IMPRATIO = 1e3
"""Impratio of a device with loops, whose implicit contacts need less."""
_PAD_MASS = 0.02
"""Mass of a pad at 4:1 [kg]: mass scaling. Its own frequency, 70 Hz, is far above every tooth-passing frequency."""
_PAD_DAMPING = 10.0
"""Damping of a pad's joint at 4:1 [N s/m]."""
_STRUT_MASS = 0.05
_STRUT_DAMPING = 20.0
"""Mass [kg] and damping [N s/m] of a strut at 4:1; the paper gives neither."""
_STOP_SOLREF, _STOP_SOLIMP = [0.004, 1.0], [0.99, 0.99, 1e-3, 0.5, 2]
"""Softness of a strut's stops: four steps of 1 ms; at 1:1 one newton presses it 13 um beyond (MuJoCo's own: 3 mm)."""


@dataclass(frozen=True)
class Pad:
    """Names of one pad's parts in the model."""

    track: int
    tip: str
    geom: str
    joint: str
    actuator: str
    """Scales the pad's spring with the tooth phase: `Tracked.phase_controls` gives its control."""
    contact: str
    """Sensor: forces of two contacts, each in its own frame, normal first [N]."""
    offset: float
    """Tooth phase over this pad when the treads are at their start [pitches]."""


@dataclass(frozen=True)
class Tracked:
    """A tracked robot in a scene."""

    design: TrackedDesign
    law: PadLaw
    pads: tuple[Pad, ...]
    core: str
    """Core body."""
    tow: str
    """Site at the core's rear: a string or a scope's shaft hangs here."""
    roll_motor: str
    """Actuator: worm torque on the core about the axis [N m]; empty on a fixed core."""
    loops: tuple[LoopPart, ...] = ()
    """The treads beyond the tips; none in the test rigs."""

    def phase_controls(self, travel: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n pads"]:
        """Controls of the pads' actuators when all treads have moved by `travel` [m]."""
        return self.phase_controls_each(np.repeat(np.asarray(travel)[..., None], TRACKS, axis=-1))

    def phase_controls_each(self, travel: Float[Any, "*n tracks"], *, xp: ModuleType = np) -> Float[Any, "*n pads"]:
        """Controls of the pads' actuators when the tread of each track has moved by its own `travel` [m]."""
        moved = travel[..., np.array([pad.track for pad in self.pads])]
        phases = moved / self.design.tread.pitch + np.array([pad.offset for pad in self.pads])
        operating, mean, contact, (k1, k2, k3) = self._series
        force = self.law.phase_factor(phases, xp=xp) * mean
        left = operating - force / contact
        return (force - left * (k1 + left * (k2 + left * k3))) / (mean / operating * left)

    @cached_property
    def _series(self) -> tuple[float, float, float, tuple[float, float, float]]:
        """Operating indentation [m] and force [N], the contact's stiffness [N/m] and the spring behind it."""
        operating, contact = _operating(self.law, self.design), pad_stiffness(self.design)
        return operating, float(self.law.mean_force(operating)), contact, self.law.behind(contact)

    def set_speed(self, model: mujoco.MjModel, speed: float) -> None:
        """Let the treads run backwards at `speed` relative to the core [m/s]: the robot is pushed forwards."""
        self.set_speeds(model, [speed] * TRACKS)

    def set_speeds(self, model: mujoco.MjModel, speeds: Sequence[float] | Float[np.ndarray, " tracks"]) -> None:
        """Let each track's tread run backwards at its own speed [m/s]: those of the paper's one worm do not differ."""
        for pad in self.pads:
            model.geom_surfacevel[model.geom(pad.geom).id, 0] = -speeds[pad.track]
        for part in self.loops:
            model.geom_surfacevel[model.geom(part.geom).id, 2] = speeds[part.track]
        model.flg_surfacevel = True

    def set_friction(self, model: mujoco.MjModel, friction: float) -> None:
        """Coulomb's coefficient of the treads, which overrides the wall's."""
        for part in (*self.pads, *self.loops):
            model.geom_friction[model.geom(part.geom).id, 0] = friction


def add_tracked(
    spec: mujoco.MjSpec,
    design: TrackedDesign,
    *,
    friction: float,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    frame: Float[np.ndarray, "3 3"] | None = None,
    tracks: Sequence[int] = tuple(range(TRACKS)),
    extension: float | Sequence[float] = 0.0,
    free: bool = True,
    loops: bool = False,
    prefix: str = "tracked/",
) -> Tracked:
    """Put a tracked robot into a scene.

    A pad's joint carries the tread's compliance on the tissue (`PadLaw`), so the wall may be rigid. Struts stand on
    bellows when the core is free; on a fixed core they are held at `extension`, as in the paper.

    Args:
        spec: The scene; gets elliptic cones, which the pads' friction needs.
        design: The robot.
        friction: Coulomb's coefficient between treads and wall.
        position: Centre of the core [m].
        frame: Columns are forwards, left and up; the world's axes when None. Track 0 is up.
        tracks: Which of the four tracks to build.
        extension: How far the tracks, or each of the four, stand out of the nominal radius at first [m].
        free: Six degrees of freedom for the core and a bellows for each strut; otherwise none.
        loops: Close the treads around the struts (`add_loop`), for a wall with folds and bends: on a smooth one only
            the tips touch, as the paper says of the device.
        prefix: Before every name.

    Raises:
        InvalidDesignError: when no force table fits the tread, or the bellows' pressure lifts the tracks off.
        InvalidOptionError: when the friction is not between 0 and 2 or the extension is beyond the stroke.
    """
    if not 0 <= friction <= 2:
        raise InvalidOptionError(f"Tread friction is {friction}: give a coefficient from 0 to 2.")
    low, high = design.stroke
    each = np.broadcast_to(np.asarray(extension, float), TRACKS)
    if not ((each >= low) & (each <= high + _reach(design))).all():
        raise InvalidOptionError(
            f"A strut cannot stand {each.min() * 1e3:.2f} to {each.max() * 1e3:.2f} mm out of its nominal radius: its "
            f"stroke is {low * 1e3:.1f} to {high * 1e3:.1f} mm."
        )
    law = load_law(design.tread)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    require_impedance_ratio(spec, _LOOP_IMPRATIO if loops else _FREE_IMPRATIO if free else _IMPRATIO)
    core = _add_core(spec, design, position, frame, free=free, prefix=prefix)
    pads: list[Pad] = []
    parts: list[LoopPart] = []
    for track in tracks:
        strut = _add_strut(core, design, track, float(each[track]), free=free, prefix=prefix)
        pads += [_add_pad(spec, strut, design, law, track, tip, friction, prefix=prefix) for tip in TIPS]
        if loops:
            recess = 2 * _operating(law, design)
            own = add_loop(spec, core, strut, design, track, float(each[track]), recess, prefix=prefix)
            runs = [
                ((part.rear[0], part.rear[2]), (part.front[0], part.front[2]))
                for part in sorted(own, key=lambda part: part.rear)
                if part.body == strut.name
            ]
            draw_strut(spec, strut, design, track=track, runs=runs, prefix=prefix)
            parts += own
    stiffness = pad_stiffness(design)
    if loops:
        draw_core(spec, core, design, prefix=prefix)
        for name in (f"{prefix}core", *(pad.geom for pad in pads), *(part.geom for part in parts)):
            spec.geom(name).group = HIDDEN
        soften(spec, [pad.geom for pad in pads], parts, f"{prefix}core", pad_stiffness=stiffness, friction=friction)
    else:
        _calibrate_contacts(spec, pads, stiffness)
    motor = f"{prefix}roll" if free else ""
    if free:
        actuator = spec.add_actuator(name=motor, trntype=mujoco.mjtTrn.mjTRN_SITE, target=f"{prefix}centre")
        actuator.set_to_motor()
        actuator.gear = [0, 0, 0, 1, 0, 0]
    return Tracked(design, law, tuple(pads), f"{prefix}core", f"{prefix}tow", motor, tuple(parts))


def _calibrate_contacts(spec: mujoco.MjSpec, pads: Sequence[Pad], stiffness: float) -> None:
    """Give every pad's contact the asked stiffness: MuJoCo scales it by the body's inverse weight in the rest pose."""
    weights = spec.compile().body_invweight0
    for pad in pads:
        geom = spec.geom(pad.geom)
        weight = weights[geom.parent.id, 0]
        geom.solref = [-stiffness * (1 - _CONTACT_IMPEDANCE) * weight, -_CONTACT_DAMPING]


def pad_stiffness(design: TrackedDesign) -> float:
    """Stiffness of a pad's contact [N/m]."""
    return _CONTACT_STIFFNESS * _ratio(design)


def _reach(design: TrackedDesign) -> float:
    """Largest indentation that a fixed strut may be given beyond its stroke [m]: the tissue's thickness."""
    return design.tread.tissue_thickness


def _ratio(design: TrackedDesign) -> float:
    """Size over the 4:1 prototype, for the numbers of the quasi-static model itself."""
    return design.scale / 4.0


def _operating(law: PadLaw, design: TrackedDesign) -> float:
    """Indentation at which each tip carries half of the bellows' preload [m]."""
    return law.indentation(design.bellows.preload / 2)


def _secant(law: PadLaw, design: TrackedDesign) -> float:
    """Force over indentation there [N/m]."""
    operating = _operating(law, design)
    return float(law.mean_force(operating)) / operating


def _add_core(spec, design: TrackedDesign, position, frame, *, free: bool, prefix: str):
    core = spec.worldbody.add_body(name=f"{prefix}core", pos=list(position))
    if frame is not None:
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(frame, float).ravel())
        core.quat = quaternion
    half = design.core_length / 2
    if free:
        core.add_freejoint(name=f"{prefix}free")
    core.add_geom(
        name=f"{prefix}core",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[-half, 0, 0, half, 0, 0],
        size=[design.core_diameter / 2, 0, 0],
        mass=design.mass,
        contype=0,
        conaffinity=1,
        friction=[CORE_FRICTION, 0.005, 0.0001],
        rgba=[0.35, 0.4, 0.5, 1],
    )
    core.add_site(name=f"{prefix}centre")
    core.add_site(name=f"{prefix}tow", pos=[-half - design.core_diameter / 2, 0, 0])
    return core


def _add_strut(core, design: TrackedDesign, track: int, extension: float, *, free: bool, prefix: str):
    angle = 2 * np.pi * track / TRACKS
    ratio = _ratio(design)
    radius = design.nominal_diameter / 2 + extension
    strut = core.add_body(
        name=f"{prefix}strut{track}",
        pos=[0, -radius * np.sin(angle), radius * np.cos(angle)],
        quat=[np.cos(angle / 2), np.sin(angle / 2), 0, 0],
    )
    if free:
        bellows = design.bellows
        low, high = design.stroke
        strut.add_joint(
            name=f"{prefix}strut{track}",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[0, 0, 1],
            stiffness=[bellows.stiffness, 0, 0],
            springref=bellows.force(0.0) / bellows.stiffness - extension,
            damping=[_STRUT_DAMPING * ratio, 0, 0],
            limited=True,
            range=[low - extension, high - extension],
            solref_limit=_STOP_SOLREF,
            solimp_limit=_STOP_SOLIMP,
        )
    tread = design.tread
    strut.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[-tread.tip_spacing / 2, 0, -3 * tread.tip_radius, tread.tip_spacing / 2, 0, -3 * tread.tip_radius],
        size=[tread.tip_radius / 2, 0, 0],
        contype=0,
        conaffinity=0,
        mass=_STRUT_MASS * ratio,
        rgba=[0.2, 0.2, 0.2, 1],
    )
    return strut


def _add_pad(spec, strut, design: TrackedDesign, law: PadLaw, track: int, tip: str, friction: float, *, prefix: str):
    name = f"{prefix}pad{track}{tip}"
    tread, ratio = design.tread, _ratio(design)
    side = -0.5 if tip == "rear" else 0.5
    operating = _operating(law, design)
    ball = tread.width / 2
    # At the operating indentation the pad's face is level with the strut's nominal radius.
    body = strut.add_body(name=name, pos=[side * tread.tip_spacing, 0, operating - ball])
    body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=[0, 0, -1],
        stiffness=list(law.behind(pad_stiffness(design))),
        damping=[_PAD_DAMPING * ratio, 0, 0],
    )
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[ball, 0, 0],
        mass=_PAD_MASS * ratio,
        contype=0,
        conaffinity=1,
        condim=3,
        priority=1,
        friction=[friction, 0.005, 0.0001],
        solimp=[_CONTACT_IMPEDANCE, _CONTACT_IMPEDANCE, 1e-3, 0.5, 2],
        surfacevel=[0.0] * 6,
        rgba=[0.8, 0.75, 0.6, 1],
    )
    spec.add_actuator(
        name=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=name,
        gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
        gainprm=[0, -_secant(law, design)] + [0] * 8,
    )
    spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=name,
        intprm=[1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 0, 2],  # two, since a ball may stand on a seam
    )
    phase = design.phase_offsets()[track] + side * tread.spacing_in_pitches
    return Pad(track, tip, name, name, name, name, float(phase % 1.0))
