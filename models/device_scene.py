"""A scene of any device in a colon: one MjSpec, its spheres with planes to be placed, or among the wall's pieces."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.base import Device, Handles, Pose
from haustra.models.scene import SceneOptions, add_blocks, add_wall, empty_spec, entry_of, require_start
from haustra.models.wall.lumen_table import Tables, lumen_table, stack
from haustra.models.wall.piece_wall import NO_BLOCKS, Blocks, add_piece_spheres
from haustra.models.wall.pieces.wall import Wall
from haustra.models.wall.planes import PLANES, add_felt, add_planes, with_friction

HONOURED = (
    "timestep",
    "wall_stiffness",
    "wall_damping_time",
    "elasticity",
    "wall_law",
    "mesentery",
    "friction",
    "start_depth",
    "gravity",
    "abdomen",
    "gas",
    "gas_flow",
    "gas_start",
)
"""Scene options that scenes of any device take; the others are refused by name where they are not the usual ones."""

_WIDEST_DEG = 160.0
"""Field of view that MuJoCo's flat pictures still show [degrees]; engineering choice."""

_LONG_CHAIN = 100
"""Degrees of freedom beyond which contacts are solved by conjugate gradients, as those of scopes; engineering choice.
Newton's method factors a dense matrix as large, often: 50 s of a vine of 154 take it 1.9 times as long, mean forces on
the wall being 0.1 % apart."""

_TOLERANCE = 1e-8
"""Tolerance of the solver [1]: MuJoCo's own."""


@dataclass(frozen=True)
class DeviceScene:
    """A device at the anus of a colon, ready to compile; by the table the colon is not in the scene."""

    spec: mujoco.MjSpec
    device: Device
    handles: Handles
    options: SceneOptions
    pose: Pose
    colon: Colon | None = None
    """Whose wall it meets, where that is no table."""
    blocks: Blocks = NO_BLOCKS
    """Where the wall's pieces stand on mocap bodies, in a colon that moves."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """What the scene does not model, and why."""

    def compile(self, *, felt: bool = False) -> mujoco.MjModel:
        """The compiled model; `felt` lets MuJoCo tell what spheres do to the wall.

        Each contact has friction: how much, worlds say.
        """
        spec = self.spec.copy()
        if felt:
            add_felt(spec, len(self.handles.samples))
        return with_friction(spec.compile())

    @cached_property
    def radii(self) -> tuple[float, ...]:
        """Radii of the device's spheres, each once: a colon needs a table for each [m]."""
        return tuple(sorted({sample.radius for sample in self.handles.samples}))

    @property
    def groups(self) -> Int[np.ndarray, " spheres"]:
        """Number of the radius of each sphere."""
        return np.array([self.radii.index(sample.radius) for sample in self.handles.samples])

    @cached_property
    def members(self) -> Float[np.ndarray, "spheres bodies"]:
        """1 where a sphere is part of a body that wall forces are summed over."""
        bodies = np.array(self.handles.bodies)
        return np.array([(bodies == sample.body).astype(float) for sample in self.handles.samples])

    def own(self, name: str) -> Float[np.ndarray, " spheres"]:
        """Stiffness [N/m] or friction [1] of spheres that have their own; NaN for the others."""
        return np.array([getattr(sample, name) for sample in self.handles.samples], float)

    def configuration(self) -> dict[str, object]:
        """Options and design as plain JSON values, for provenance."""
        options = {name: value for name, value in asdict(self.options).items() if name in HONOURED}
        return {"options": options, "design": self.device.describe(), "left_out": dict(self.left_out)}


def device_options(device: Device | None = None, **changed: object) -> SceneOptions:
    """Options of a scene of any device: the usual ones, with the lumen as a table, and those that suit this device."""
    return SceneOptions(**{"wall_law": "table", **(device.usual if device else {}), **changed})  # type: ignore[arg-type]


def pose_in(colon: Colon, device: Device, options: SceneOptions) -> Pose:
    """Where a device begins in a colon: at the anus, or where it stands.

    Raises:
        InvalidDesignError: when it does not fit there.
        InvalidOptionError: when `start_depth` is not inside the colon.
    """
    require_start(colon, options)
    return device.standing(colon, options.start_depth) or Pose(*entry_of(colon))


def build_device_scene(
    device: Device,
    options: SceneOptions | None = None,
    *,
    pose: Pose | None = None,
    colon: Colon | None = None,
    wall: Wall | None = None,
) -> DeviceScene:
    """Put a device before the anus of a colon.

    Args:
        device: the device.
        options: how to model it; those that are not of `HONOURED` must be the usual ones.
        pose: the anus and the way in; the origin and z when None, where colons can take turns
            (`haustra.models.wall.lumen_table.LumenTable.seen_from`).
        colon: the colon that it is in, in whose coordinates the pose is, for the wall laws 'planes' and 'pieces'.
        wall: its pieces, for the wall law 'pieces'.

    Raises:
        UnsupportedSceneError: naming the option that is not honoured, or the wall law that needs one colon.
        InvalidOptionError: when pieces are asked for and no wall is given.
    """
    options = options or device_options(device)
    _require_honoured(device, options)
    if pose is None and any(options.gravity):
        raise UnsupportedSceneError("Gravity needs one colon and its pose: colons that take turns lie otherwise each.")
    spec = empty_spec(f"{device.kind} {device.name}", options)
    pose = pose or Pose()
    handles = device.add_to(spec, pose, timestep=options.timestep, start=options.start_depth)
    _add_camera(spec, handles.tip, device.view_deg)
    bare = spec.compile()
    for name in handles.geoms:
        spec.geom(name).conaffinity = 0
    blocks, law, count = NO_BLOCKS, options.wall_law, PLANES if options.wall_law == "planes" else 1
    if law != "table" and colon is None:
        raise UnsupportedSceneError(f"Wall law '{law}' is that of one colon: many colons at once need the law 'table'.")
    if law != "pieces":
        add_planes(spec, bare, handles.samples, options.contact, timestep=options.timestep, planes=count)
    elif wall is None or colon is None:
        raise InvalidOptionError("Wall law 'pieces' needs a wall: build one, or choose planes or table.")
    else:
        add_piece_spheres(spec, handles.samples, options.contact, wall, timestep=options.timestep)
        if options.mesentery:
            blocks = add_blocks(spec, wall, colon, touched=True)
        else:
            add_wall(spec, wall)
    long = bare.nv > _LONG_CHAIN
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG if long else mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.tolerance = _TOLERANCE
    left_out = {**_left_out(options), **device.left_out}
    return DeviceScene(spec, device, handles, options, pose, None if law == "table" else colon, blocks, left_out)


def device_tables(scene: DeviceScene, colons: list[Colon], poses: list[Pose] | None = None) -> Tables:
    """Tables of colons, one a radius of the device's spheres, seen from poses, or where the colons are when None."""
    found = []
    for number, colon in enumerate(colons):
        for radius in scene.radii:
            table = lumen_table(
                colon, device_radius=radius, with_mesentery=scene.options.mesentery, abdomen=scene.options.abdomen
            )
            pose = poses[number] if poses else None
            found.append(table.seen_from(pose.position, pose.frame) if pose else table.tables)
    return stack(found)


def _require_honoured(device: Device, options: SceneOptions) -> None:
    usual = device_options()
    for entry in fields(SceneOptions):
        if entry.name not in HONOURED and getattr(options, entry.name) != getattr(usual, entry.name):
            raise UnsupportedSceneError(
                f"Scenes of a device of kind '{device.kind}' do not honour the option {entry.name}: leave it out. "
                f"Honoured: {', '.join(HONOURED)}."
            )


def _add_camera(spec: mujoco.MjSpec, tip: str, view_deg: float) -> None:
    """A camera at the tip that looks forwards, and a lamp beside it: a scope has its own."""
    site = spec.site(tip)
    if site.parent.cameras:
        return
    turn = np.empty(4)
    mujoco.mju_mulQuat(turn, site.quat, np.array([0.0, 1.0, 0.0, 0.0]))  # MuJoCo's cameras look along their own -z
    ahead = np.empty(3)
    mujoco.mju_rotVecQuat(ahead, np.array([0.0, 0.0, 1.0]), site.quat)
    site.parent.add_camera(name=f"{tip}/camera", pos=site.pos, quat=turn, fovy=min(view_deg, _WIDEST_DEG))
    site.parent.add_light(
        name=f"{tip}/light",
        pos=site.pos,
        dir=ahead,
        diffuse=[0.7] * 3,
        cutoff=80,
        attenuation=[1, 0, 100],
        castshadow=False,
    )


def _left_out(options: SceneOptions) -> dict[str, str]:
    left_out = {
        "self-contact": "the device does not touch itself",
    }
    if options.wall_law == "table":
        left_out["wall"] = "its table is the backend's: stock MuJoCo moves the saved device without one"
    if options.wall_law == "planes":
        left_out["wall"] = "its planes are moved by the backend: stock MuJoCo moves the saved device without them"
    if options.wall_law == "pieces":
        left_out["joints of pieces"] = "where a place touches several, the deepest counts; in stock MuJoCo all do"
    if options.mesentery:
        left_out |= options.abdomen.left_out()
        left_out["empty loops"] = (
            "they are drawn to shafts, of devices by the table alone (haustra.models.wall.threads)"
        )
    else:
        left_out["mesentery"] = "the colon gives way by its wall's stiffness only; it does not swing on its mesentery"
    if not options.friction:
        left_out["friction"] = "none was asked for: contacts have a normal force only"
    if not any(options.gravity):
        left_out["gravity"] = "the patient's posture is not known"
    return left_out
