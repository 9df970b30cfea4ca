"""From a scene to the numbers of its scope, for backends of many worlds in JAX; what they cannot honour is refused."""

from collections.abc import Sequence

import jax
import numpy as np

from haustra.envs.sim.at_origin import compile_at_origin
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.chain import Links
from haustra.envs.sim.scope_values import Scope
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene


def read_scope(scene: Scene) -> Scope:
    """Numbers of a scene's scope, in double precision.

    Raises:
        UnsupportedSceneError: when the scene has what this backend cannot honour.
    """
    refuse_unsupported(scene)
    model = compile_at_origin(scene)
    cable, design = scene.cable, scene.design
    arms = np.zeros((len(WIRE_NAMES), model.nv))
    for wire, name in enumerate(WIRE_NAMES):
        tendon = model.tendon(f"scope/wire_{name}").id
        wraps = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
        arms[wire, model.jnt_dofadr[model.wrap_objid[wraps]]] = model.wrap_prm[wraps]
    limited = model.jnt_limited.astype(bool)
    locks = [model.actuator(name).id for pair in cable.locks for name in pair]
    parts = {
        "stiffness": np.asarray(model.jnt_stiffness).reshape(model.nv, -1)[:, 0].copy(),
        "damping": np.asarray(model.dof_damping).reshape(model.nv, -1)[:, 0].copy(),
        "armature": model.dof_armature.copy(),
        "rest": model.qpos_spring.copy(),
        "low": np.where(limited, model.jnt_range[:, 0], -np.inf),
        "high": np.where(limited, model.jnt_range[:, 1], np.inf),
        "arms": arms,
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
        "wire_hysteresis": np.float64(design.wires.hysteresis),
    }
    return Scope(links=Links.of(model), **{name: np.asarray(part)[None] for name, part in parts.items()})


def stack_scopes(scopes: Sequence[Scope]) -> Scope:
    """One design a world."""
    return jax.tree.map(lambda *parts: np.concatenate(parts), *scopes)


def refuse_unsupported(scene: Scene) -> None:
    """Say by name what of a scene this backend cannot honour.

    Raises:
        UnsupportedSceneError: naming the first such thing.
    """
    require_supported(scene, "jax")
    model = scene.compile()
    cubic = np.asarray(model.jnt_stiffnesspoly) if hasattr(model, "jnt_stiffnesspoly") else np.zeros(1)
    if np.abs(cubic).max(initial=0) > 0:
        raise UnsupportedSceneError("The backend 'jax' has linear springs only: build the scene with softening=False.")
    if model.nplugin or model.neq:
        raise UnsupportedSceneError("The backend 'jax' has no plugins or equality constraints: use the native backend.")
