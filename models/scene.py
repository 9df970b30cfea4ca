"""What stands in the scene, and what is left out: colon, wall and scope become one MjSpec."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.errors import InvalidOptionError, OutputError
from haustra.fields import Number, named, number, one_of, require_declared, vector, whole
from haustra.files import write_atomically
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lumen_meshes import add_lumen
from haustra.models.devices.base import Device, load_device
from haustra.models.devices.scope.cable import Cable, add_scope
from haustra.models.devices.scope.cells import Cell, CellSize, cut_into_cells
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.interface import Scope
from haustra.models.devices.scope.outside import Outside, leave_out
from haustra.models.devices.scope.spacing import adaptive_spacing
from haustra.models.devices.scope.stops import apply_stops
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.elasticity import ELASTICITIES, LINEAR
from haustra.models.wall.law import WallContact
from haustra.models.wall.piece_wall import BLOCK, NO_BLOCKS, Blocks, add_piece_spheres
from haustra.models.wall.pieces.reach import within_reach
from haustra.models.wall.pieces.slabs import SLAB, cut_into_slabs
from haustra.models.wall.pieces.wall import Wall
from haustra.models.wall.planes import Sample, add_planes, capsule_samples
from haustra.quantity import load_quantities

_CONTACT = load_quantities(asset("numbers/contact.toml"))

ENTRY_STRETCH = 0.03
"""The scope enters along the mean direction of this much centreline [m]; engineering choice."""

_SAMPLE_SPACING = 0.75
"""Spheres that meet tangent planes, over the scope's diameter: between two, its outline dips by a sixth of that."""

_MOST_SAMPLES = 1000
"""Spheres of a scope, five times the usual number: MuJoCo's memory for collisions does not hold 1,700."""

_TOLERANCE = 1e-6
"""Tolerance of the solver: 30 s of insertion into grown seed 0 go as at MuJoCo's default of 1e-8, with peak forces 1e-4
apart, in a tenth less time (docs/decisions/integrator.md)."""

_WALL_GROUP, _LUMEN_GROUP = 3, 1
"""Geom groups: MuJoCo's viewer hides group 3 (collision pieces) and shows group 1."""


@dataclass(frozen=True)
class SceneOptions:
    """How a scene is modelled. Defaults are sourced numbers or engineering choices."""

    timestep: float = number("s", 1e-5, 0.02, default=0.005)
    """Integration step [s]."""
    shaft_cell: float = number("m", 0.002, 1.0, default=0.05)
    """Largest distance between joints of the shaft [m]."""
    largest_bend_deg: float | None = number("degrees", 0.5, 180.0, default=None)
    """Largest bend of a shaft joint, from which spacing is adapted to the colon, `shaft_cell` being its mean
    [degrees]; uniform spacing when None."""
    bending_cell: float = number("m", 0.001, 0.5, default=0.017)
    """Largest distance between joints of the bending section [m]."""
    twist_hinges: int = whole(0, 200, default=4)
    """Hinges that carry the torsional compliance of the whole scope; 0 for stiff in torsion."""
    wall_stiffness: float = number("N/m", 1.0, 1e6, default=_CONTACT["contact.wall_stiffness"].value)
    """Normal stiffness of a contact with the wall, where it is hardly pressed [N/m]."""
    elasticity: str = one_of(ELASTICITIES, default=LINEAR)
    """How the wall's force grows with depth, by the name of a law (`haustra.models.wall.elasticity`); those that are
    not linear against law 'table' only."""
    segment_stiffness: tuple[tuple[str, float], ...] = named("N/m", 1.0, 1e6, default=())
    """Names of segments and their stiffness [N/m], where it is not `wall_stiffness`; tangent planes only."""
    wall_damping_time: float = number("s", 0.0, 1.0, default=0.005)
    """Damping over stiffness of the wall [s]; engineering choice; sliding adds mu c v to the normal force."""
    wall_law: Literal["pieces", "planes", "table"] = "pieces"
    """What the scope meets: the wall's convex pieces, tangent planes of the lumen (docs/decisions/wall.md), or tangent
    planes by a table of the lumen (`haustra.models.wall.lumen_table`); a saved scene of the last has no wall."""
    mesentery: bool = False
    """Let the colon swing, stretch and pleat on its mesentery (`haustra.models.wall.mesentery`); otherwise it is fixed
    in space and gives way by its wall's stiffness only."""
    abdomen: Abdomen = field(default_factory=Abdomen)
    """What a colon that moves lies in: the patient's posture, mobile segments, adhesions, a hand on the belly."""
    sample_spacing: float | None = number("m", 0.001, 0.1, default=None)
    """Distance between the spheres that meet tangent planes or the table [m]; three quarters of the scope's diameter
    when None."""
    friction: float = number("1", 0.0, 10.0, default=_CONTACT["contact.friction"].value)
    """Coulomb coefficient between scope and wall [1]."""
    friction_rise: float = number("s/m", 0.0, 100.0, default=_CONTACT["contact.friction_rise"].value)
    """Rise of that coefficient with sliding speed, as under a film of mucus [s/m]; law 'table' only."""
    push_limit: float = number("N", 0.01, 1e3, default=_CONTACT["contact.push_force_peak"].value)
    """Largest force that the hand applies [N]."""
    torque_limit: float = number("N m", 1e-4, 100.0, default=_CONTACT["contact.torque_peak"].value)
    """Largest torque that the hand applies [N m]."""
    start_depth: float = number("m", 0.001, 5.0, default=0.03)
    """Distance of the tip past the anus at the start [m]."""
    softening: bool = True
    """Let hinges of the shaft soften as they bend (`haustra.models.devices.scope.cable.SOFTENING`), so that a bend in
    any direction is as stiff; backends of many worlds have linear springs only."""
    gas: float | None = number("Pa", 500.0, 8000.0, default=None)
    """Set point of insufflation [Pa]: the scope lets gas in while the pressure at its tip is less, and gas sets how
    wide the lumen is (`haustra.models.gas`). No gas when None: the lumen is as wide as it was given. Law
    'table' only."""
    gas_flow: float = number("m^3/s", 0.0, 1e-4, default=4.17e-6)
    """Flow of the gas that insufflation lets in [m^3/s]; 0.25 L/min by default, as in colonoscopy."""
    gas_start: float = number("Pa", 300.0, 8000.0, default=2000.0)
    """Gas pressure that the colon is filled to at the start [Pa]."""
    water: float = number("m^3", 0.0, 2e-3, default=0.0)
    """Water in rectum and sigmoid at the start [m^3], in the place of gas there; with gas only. It stays in its
    segment, and weighs on a colon that moves, as the patient lies (`haustra.models.gas.water`)."""
    insertion_limit: float | None = number("m", 0.01, 10.0, default=None)
    """Length of scope that the scene models [m]; the whole scope, or as much as the colon can take, when None."""
    gravity: tuple[float, float, float] = vector(*[Number("m/s^2", -100.0, 100.0)] * 3, default=(0.0, 0.0, 0.0))
    """Gravity in the colon's frame [m/s^2]; none by default, since a mesh does not say how the patient lies."""

    def __post_init__(self) -> None:
        require_declared(self)
        if self.mesentery and self.segment_stiffness:
            raise InvalidOptionError("Stiffness by segment needs a colon that is fixed in space: leave out either.")
        if self.abdomen != Abdomen() and not self.mesentery:
            raise InvalidOptionError(
                "Posture, mobile segments, adhesions and all else of an abdomen need a colon that moves."
            )
        if self.gas is not None and self.wall_law != "table":
            raise InvalidOptionError(f"Gas moves the wall of law 'table' only, not that of '{self.wall_law}'.")
        if self.water and self.gas is None:
            raise InvalidOptionError("Water takes the place of gas: give a set point of gas too, or leave water out.")
        for name, usual in (("elasticity", LINEAR), ("friction_rise", 0.0)):
            if (asked := getattr(self, name)) != usual and self.wall_law != "table":
                raise InvalidOptionError(
                    f"The option {name} is {asked}, which law 'table' has and '{self.wall_law}' has not: change one."
                )
        if self.segment_stiffness and self.wall_law != "planes":
            raise InvalidOptionError(
                "Stiffness by segment needs wall law 'planes': pieces and field have one stiffness."
            )

    @property
    def contact(self) -> WallContact:
        """The contact law these options ask for."""
        damping = self.wall_stiffness * self.wall_damping_time
        friction = {"friction": self.friction, "friction_rise": self.friction_rise}
        return WallContact(stiffness=self.wall_stiffness, damping=damping, elasticity=self.elasticity, **friction)


def usual_segment_stiffness() -> tuple[tuple[str, float], ...]:
    """Normal stiffness of a contact in each segment, as in assets/numbers/contact.toml: assumed, not measured [N/m]."""
    prefix = "contact.segment_stiffness."
    return tuple((name.removeprefix(prefix), q.value) for name, q in _CONTACT.items() if name.startswith(prefix))


@dataclass(frozen=True)
class Scene:
    """A colon, its wall and a scope, ready to compile."""

    spec: mujoco.MjSpec
    cable: Cable
    colon: Colon
    design: ScopeDesign
    options: SceneOptions
    entry: Float[np.ndarray, "3"]
    """Where the scope enters [m]."""
    entry_direction: Float[np.ndarray, "3"]
    """Unit vector into the patient."""
    pieces: int
    """Convex pieces of the wall."""
    samples: tuple[Sample, ...] = ()
    """Spheres of the scope that meet the wall."""
    blocks: Blocks = NO_BLOCKS
    """Where the wall's pieces stand on mocap bodies, in a colon that moves."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """What the scene does not model, and why that is sound."""

    @classmethod
    def of(cls, colon: Colon, scope: Device | str = "adult", *, wall: Wall | None = None, **changed: Any) -> "Scene":
        """A scope in a colon that moves on its mesentery, as `haustra run` builds it.

        Args:
            colon: the colon.
            scope: a scope, from `haustra.models.devices.base.load_device`, or what that takes.
            wall: the colon's wall of convex pieces, for MuJoCo to step; a table of the lumen when None, in linear time.
            changed: fields of `SceneOptions` that differ from the usual.

        Raises:
            InvalidOptionError: when the device is no scope, does not fit through the entry, or an option cannot be
                honoured.
        """
        device = load_device(scope) if isinstance(scope, str) else scope
        if not isinstance(device, Scope):
            raise InvalidOptionError(f"Device '{device.name}' is no scope: let `haustra.run_device` drive it.")
        from haustra.models.presets import find_preset

        law = changed.pop("wall_law", "table" if wall is None else "pieces")
        options: Any = find_preset("balanced").apply(law=law)
        return build_scene(
            colon,
            wall,
            device.design,
            replace(options, **{"mesentery": not changed.get("segment_stiffness"), **changed}),
        )

    def compile(self) -> mujoco.MjModel:
        """The compiled model."""
        return self.spec.compile()

    def save(self, path: Path) -> Path:
        """Write the scene as one file that MuJoCo's own viewer opens: .mjz (meshes inside) or .xml (meshes inline).

        Raises:
            OutputError: for another suffix, or when the file cannot be written.
        """
        if path.suffix == ".mjz":
            return write_atomically(path, self._write_zip)
        if path.suffix == ".xml":
            return write_atomically(path, lambda temporary: temporary.write_text(self.spec.to_xml(), encoding="utf-8"))
        raise OutputError(f"Cannot save a scene as '{path.name}': use .mjz or .xml.")

    def _write_zip(self, path: Path) -> None:
        with path.open("wb") as file:
            self.spec.to_zip(file)

    def configuration(self) -> dict[str, object]:
        """Options and design as plain JSON values, for provenance."""
        return {"options": asdict(self.options), "design": asdict(self.design), "left_out": dict(self.left_out)}


def build_scene(
    colon: Colon,
    wall: Wall | None,
    design: ScopeDesign,
    options: SceneOptions | None = None,
    *,
    show_lumen: bool = True,
    deepest: float | None = None,
    to_save: bool = True,
) -> Scene:
    """Put a colon's wall and a scope into one scene.

    Args:
        colon: the colon.
        wall: its wall of pieces; where the law is a table of a colon that moves it is a picture, without contact.
        design: the scope.
        options: how to model it.
        show_lumen: add the lumen surface as a picture, without contact.
        deepest: the most scope that can be past the anus during the run [m]. Shaft that stays outside is left out, and
            wall that the scope cannot reach; None when nothing bounds it.
        to_save: make what runs and what is saved the same to the bit, which costs as much as building it.

    Raises:
        InvalidOptionError: when the scope does not fit through the entry, or an option cannot be honoured.
    """
    options = options or SceneOptions()
    require_start(colon, options)
    entry, frame = entry_of(colon)
    cells, modelled = _modelled_cells(colon, design, options)
    outside = None
    # Under gravity the shaft outside would lean on what is not there: the scene keeps it.
    if deepest is not None and not any(options.gravity):
        cells, outside = leave_out(cells, design, deepest=deepest, twist_hinges=options.twist_hinges)

    spec = empty_spec(f"{colon.name} with {design.name}", options)
    cable = _add_scope(spec, design, cells, entry, frame, options, outside)
    bare = spec.compile()
    apply_stops(spec, bare, timestep=options.timestep)
    for name in cable.geoms:
        spec.geom(name).conaffinity = 0
    samples = capsule_samples(bare, cable.geoms, spacing=options.sample_spacing or _SAMPLE_SPACING * design.diameter)
    if len(samples) > _MOST_SAMPLES:
        raise InvalidOptionError(
            f"sample_spacing is {options.sample_spacing} m, which makes {len(samples)} spheres, more than "
            f"{_MOST_SAMPLES}: raise it."
        )
    if options.wall_law == "planes":
        add_planes(spec, bare, samples, options.contact, timestep=options.timestep)
    blocks, pieces, unreached = NO_BLOCKS, 0, 0
    touched = options.wall_law == "pieces"
    if touched and wall is None:
        raise InvalidOptionError("Wall law 'pieces' needs a wall: build one, or choose planes or table.")
    if wall is not None and touched:
        add_piece_spheres(spec, samples, options.contact, wall, timestep=options.timestep)
    if wall is not None and (touched or options.mesentery):
        if options.mesentery:  # all of it: a colon that moves comes to meet the scope
            blocks = add_blocks(spec, wall, colon, touched=touched)
            pieces = len(wall.pieces)
        else:
            reached = within_reach(wall, entry, deepest=deepest) if deepest is not None else wall
            add_wall(spec, reached)
            pieces = len(reached.pieces)
        unreached = len(wall.pieces) - pieces
    if show_lumen:
        add_lumen(spec, colon, group=_LUMEN_GROUP)
    return Scene(
        # Text rounds numbers: through text and back, what runs is what is saved.
        spec=mujoco.MjSpec.from_string(spec.to_xml()) if to_save else spec,
        cable=cable,
        colon=colon,
        design=design,
        options=options,
        entry=entry,
        entry_direction=frame[:, 2],
        pieces=pieces,
        samples=samples,
        blocks=blocks,
        left_out=_left_out(design, options, modelled, outside, unreached),
    )


def _left_out(
    design: ScopeDesign, options: SceneOptions, modelled: float, outside: Outside | None, unreached: int
) -> dict[str, str]:
    left_out = {
        "self-contact": "the scope does not touch itself: loops are held apart by the wall",
    }
    if options.mesentery:
        left_out["inertia of the colon"] = "it follows its forces within tens of milliseconds"
        left_out |= options.abdomen.left_out()
    else:
        left_out["mesentery"] = (
            "the colon gives way by its wall's stiffness only; sigmoid and transverse colon do not swing"
        )
    if options.gas is None:
        left_out["gas"] = "the lumen is as wide as the colon that was given; nothing fills, empties or collapses it"
    else:
        left_out["tone that comes and goes"] = "gas meets a typical person's wall, and a scope holds no segment open"
    if options.water:
        left_out["flow of water"] = "it stays in the segment that it was put in, and its depth presses on no wall"
    if modelled < design.length - 1e-9:
        left_out["shaft outside"] = f"the last {design.length - modelled:.3f} m of shaft never enter this colon"
    if options.wall_law == "table":
        left_out["wall"] = "its table is the backend's: in stock MuJoCo nothing touches the saved scope"
    if options.wall_law == "pieces":
        left_out["joints of pieces"] = "where a place touches several, the deepest counts; in stock MuJoCo all do"
    if outside and outside.length:
        left_out["shaft held outside"] = f"{outside.length:.3f} m stay outside in this run: their mass and twist count"
    if unreached:
        left_out["wall out of reach"] = f"{unreached} pieces are further from the anus than the scope can get"
    if not options.friction:
        left_out["friction"] = "none was asked for: contacts have a normal force only"
    if not any(options.gravity):
        left_out["gravity"] = "the patient's posture is not known; the scope's weight is about 3 N per metre"
    return left_out


def require_start(colon: Colon, options: SceneOptions) -> None:
    """Refuse a start that is not inside the colon.

    Raises:
        InvalidOptionError: naming both lengths.
    """
    if options.start_depth >= colon.centreline.length:
        raise InvalidOptionError(
            f"start_depth is {options.start_depth} m; give less than the length of colon '{colon.name}', "
            f"{colon.centreline.length:.3f} m."
        )


def entry_of(colon: Colon) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Where a scope enters [m], and axes there: two normals and the direction into the patient."""
    line = colon.centreline
    ahead = int(np.searchsorted(line.arc, ENTRY_STRETCH))
    direction = line.points[ahead] - line.points[0]
    direction = direction / np.linalg.norm(direction)
    first = line.frames[0][:, 0] - direction * (line.frames[0][:, 0] @ direction)
    first = first / np.linalg.norm(first)
    return line.points[0], np.column_stack([first, np.cross(direction, first), direction])


def _modelled_cells(colon: Colon, design: ScopeDesign, options: SceneOptions) -> tuple[tuple[Cell, ...], float]:
    # In a colon that moves a scope makes loops, and more of it gets in than the colon is long.
    most = design.length if options.mesentery else colon.centreline.length
    limit = options.insertion_limit if options.insertion_limit is not None else most
    modelled = min(design.length, limit + options.start_depth)
    shortest = design.bending.length + design.tip.length
    if modelled < shortest:
        raise InvalidOptionError(
            f"insertion_limit {limit} m is shorter than bending section and tip ({shortest:.3f} m): raise it."
        )
    spacing = _shaft_spacing(colon, design, options)
    cells = cut_into_cells(design, shaft_cell=spacing, bending_cell=options.bending_cell, length=modelled)
    return cells, modelled


def _shaft_spacing(colon: Colon, design: ScopeDesign, options: SceneOptions) -> CellSize:
    if options.largest_bend_deg is None:
        return options.shaft_cell
    return adaptive_spacing(
        colon.centreline.points,
        colon.centreline.arc,
        2 * colon.radius.mean(axis=1),
        mean_length=options.shaft_cell,
        largest_bend=math.radians(options.largest_bend_deg),
        shortest=design.diameter,
    )


def empty_spec(name: str, options: SceneOptions) -> mujoco.MjSpec:
    """A scene with nothing in it, and the solver options of all scenes."""
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.degree = False
    spec.option.timestep = options.timestep
    spec.option.gravity = options.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # One scope is one island, and the chain's matrix is dense: both detours cost more than they save.
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG
    spec.option.tolerance = _TOLERANCE
    skipped = mujoco.mjtDisableBit
    spec.option.disableflags |= skipped.mjDSBL_MULTICCD | skipped.mjDSBL_AUTORESET | skipped.mjDSBL_ISLAND
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.map.znear = 0.001
    return spec


def _add_scope(spec, design: ScopeDesign, cells, entry, frame, options: SceneOptions, outside: Outside | None) -> Cable:
    return add_scope(
        spec,
        design,
        cells,
        entry=entry,
        frame=frame,
        inserted=options.start_depth,
        twist_hinges=options.twist_hinges,
        push_limit=options.push_limit,
        torque_limit=options.torque_limit,
        timestep=options.timestep,
        cubic=options.softening,
        outside=outside,
    )


def add_wall(spec: mujoco.MjSpec, wall: Wall) -> None:
    """Put the wall's pieces into a scene, fixed to the world."""
    for index, piece in enumerate(wall.pieces):
        _add_piece(spec, spec.worldbody, f"wall/{index:05d}", piece.vertices)


def add_blocks(spec: mujoco.MjSpec, wall: Wall, colon: Colon, *, touched: bool) -> Blocks:
    """Put the wall's pieces into a scene, in blocks on mocap bodies that can follow their stretch of the axis."""
    slabs = tuple(cut_into_slabs(wall, colon.centreline, longest=SLAB if touched else math.inf))
    count = 0
    for index, slab in enumerate(slabs):
        body = spec.worldbody.add_body(name=f"{BLOCK}{index:03d}", pos=slab.place, mocap=True)
        for vertices in slab.pieces:
            _add_piece(spec, body, f"wall/{count:05d}", vertices - slab.place, touched=touched)
            count += 1
    return Blocks(np.array([slab.place for slab in slabs]), np.array([slab.arc for slab in slabs]))


def _add_piece(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    vertices: Float[np.ndarray, "vertices 3"],
    *,
    touched: bool = True,
) -> None:
    mesh = spec.add_mesh(name=name, uservert=np.ascontiguousarray(vertices, dtype=float).ravel())
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        contype=int(touched),
        conaffinity=0,
        group=_WALL_GROUP,
        rgba=[0.85, 0.55, 0.5, 0.3],
    )
