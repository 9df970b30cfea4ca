"""From a scene to its scope as a chain with numbers, for backends that step it themselves; the rest is refused."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from haustra.envs.sim.at_origin import compile_at_origin
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.coils import coil_samples
from haustra.envs.sim.scope_values import Scope
from haustra.envs.sim.serial_chain import Chain, Links
from haustra.envs.sim.wheels import wire_arms
from haustra.errors import UnsupportedSceneError
from haustra.models.scene import Scene


@dataclass(frozen=True)
class ScopeChain:
    """How one kind of scope hangs together."""

    chain: Chain
    lock_dofs: np.ndarray
    """(joints, 2)."""
    scale: np.ndarray
    """(dofs,) which of the parameters scales it: 0 none, 1 bending, 2 tip_bending, 3 torsion."""
    sample_body: np.ndarray
    """(points,) body of each sphere."""
    coils: np.ndarray
    """(coils,) spheres on which an imager's coils sit."""
    bend_dofs: tuple[np.ndarray, np.ndarray]
    shaft_dofs: tuple[np.ndarray, np.ndarray]
    """Hinges of the shaft about x and about y, joint by joint: what its wires are bent through."""

    def same_structure(self, other: "ScopeChain") -> bool:
        """Whether both kinds of scope can share a batch: the same joints in the same order, and as many spheres."""
        pairs = (
            (self.chain.axis, other.chain.axis),
            (self.chain.turn, other.chain.turn),
            (self.scale, other.scale),
            (self.sample_body, other.sample_body),
        )
        return all(np.array_equal(one, another) for one, another in pairs)


def read_chain(scene: Scene, *, backend: str = "linear") -> ScopeChain:
    """Read how a scene's scope hangs together.

    Raises:
        UnsupportedSceneError: when the scene has what that backend cannot honour.
    """
    refuse_unsupported(scene, backend)
    model = compile_at_origin(scene)
    names = [model.joint(index).name for index in range(model.njnt)]
    cells = scene.cable.cells
    steerable = {index for index, cell in enumerate(cells) if cell.steerable}
    shaft = [index for index in range(len(cells)) if index not in steerable]

    def bend(side: str, of: Iterable[int]) -> np.ndarray:
        return np.array([names.index(f"scope/bend_{side}_{index:03d}") for index in of], int)

    return ScopeChain(
        chain=Chain.of(model),
        lock_dofs=np.array([[names.index(f"scope/bend_{a}_{i:03d}") for a in "xy"] for i in range(len(cells))]),
        scale=np.array([_scale_of(name, steerable) for name in names]),
        sample_body=np.array([model.body(sample.body).id - 1 for sample in scene.samples]),
        coils=coil_samples(model, scene.samples),
        bend_dofs=(bend("y", sorted(steerable)), bend("x", sorted(steerable))),
        shaft_dofs=(bend("x", shaft), bend("y", shaft)),
    )


def _scale_of(name: str, steerable: set[int]) -> int:
    if "bend_" in name:
        return 2 if int(name[-3:]) in steerable else 1
    return 3 if "twist_" in name else 0


def read_scope(scene: Scene, *, backend: str = "linear") -> Scope:
    """Numbers of a scene's scope, in double precision.

    Raises:
        UnsupportedSceneError: when the scene has what that backend cannot honour.
    """
    refuse_unsupported(scene, backend)
    model = compile_at_origin(scene)
    cable, design = scene.cable, scene.design
    limited = model.jnt_limited.astype(bool)
    locks = [model.actuator(name).id for pair in cable.locks for name in pair]
    parts = {
        "stiffness": np.asarray(model.jnt_stiffness).reshape(model.nv, -1)[:, 0].copy(),
        "damping": np.asarray(model.dof_damping).reshape(model.nv, -1)[:, 0].copy(),
        "armature": model.dof_armature.copy(),
        "rest": model.qpos_spring.copy(),
        "low": np.where(limited, model.jnt_range[:, 0], -np.inf),
        "high": np.where(limited, model.jnt_range[:, 1], np.inf),
        "arms": wire_arms(model),
        "behind": cable.length - cable.joint_positions,
        "lock_stiffness": -model.actuator_gainprm[locks, 1],
        "lock_damping": -model.actuator_gainprm[locks, 2],
        "sample_place": np.array([sample.position for sample in scene.samples]),
        "radius": np.float64(cable.radius),
        "tip_place": model.site("scope/tip").pos.copy()[None],
        "pull_per_angle": np.float64(design.pull_per_angle),
        "length": np.float64(cable.length),
        "start": np.float64(scene.options.start_depth),
        "pull_limit": np.float64(design.wires.pull_limit),
        "bend_limit": np.radians(design.limits.smallest),
        "wire_friction": np.float64(design.wires.friction),
        "cubic": np.asarray(model.jnt_stiffnesspoly)[model.dof_jntid, 1].copy(),
        "ring": np.array([cell.left_to_stiffen for cell in cable.cells]),
        "wire_hysteresis": np.float64(design.wires.hysteresis),
        "wire_radius": np.float64(design.wires.routing_radius),
        "wire_slack": np.float64(design.wires.slack),
        "wire_compliance": np.float64(design.wires.compliance),
    }
    return Scope(links=Links.of(model), **{name: np.asarray(part)[None] for name, part in parts.items()})


def stack_scopes(scopes: Sequence[Scope]) -> Scope:
    """One design a world."""
    links = Links(*map(np.concatenate, zip(*(scope.links for scope in scopes), strict=True)))
    return Scope(links, *map(np.concatenate, zip(*(scope[1:] for scope in scopes), strict=True)))


def refuse_unsupported(scene: Scene, backend: str) -> None:
    """Say by name what of a scene that backend cannot honour.

    Raises:
        UnsupportedSceneError: naming the first such thing.
    """
    require_supported(scene, backend)
    model = scene.compile()
    if model.nplugin or model.neq:
        raise UnsupportedSceneError(
            f"The backend '{backend}' has no plugins or equality constraints: use the native backend."
        )
