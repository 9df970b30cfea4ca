"""A scope of which only as much shaft is modelled as can get in soon: more is added when it is nearly all inside."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.gas import RunGas
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls, Readings
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import Scene, build_scene
from haustra.models.wall.lumen_table import LumenTable
from haustra.models.wall.piece_wall import Blocks
from haustra.models.wall.pieces.wall import Wall

STRIDE = 0.4
"""Shaft that is added at a time [m]. To build a scene takes about a second, and a joint too many costs as long as it is
there: 60 s in grown seed 0 took 20.6, 20.1 and 21.6 s with 0.25, 0.4 and 0.6 m, 21.7 s with all of it."""

_MARGIN = 0.01
"""Shaft is added when less than this is left outside [m]; in a control interval less than 2 mm get in."""

_FIRST_TWIST = "scope/twist_000"


class GrowingEngine:
    """A scene on MuJoCo's CPU engine, stepped as scenes of rising length of shaft; seen from outside, as one.

    Shaft outside the patient is held straight, so a scene without it does the same to 0.1 %
    (`haustra.models.devices.scope.outside`). When shaft is added, positions, speeds and hands go on as they were. The
    whole scene, given the recorded controls, repeats such a run as closely as that; until shaft is added, to rounding.
    """

    name = NativeEngine.name

    def __init__(
        self,
        scene: Scene,
        *,
        build: Callable[[float], Scene],
        stride: float = STRIDE,
        table: LumenTable | None = None,
    ) -> None:
        """Build the first part.

        Args:
            scene: what is modelled in all.
            build: the same scene for a scope of which at most so much gets in [m].
            stride: shaft that is added at a time [m].
            table: as for `NativeEngine`.
        """
        self.scene = scene
        self.added: list[float] = []
        """When shaft was added [s]."""
        self._build, self._stride = build, stride
        self._actuators = {each.name: row for row, each in enumerate(scene.spec.actuators)}
        self._deepest = scene.options.start_depth + stride
        self._take(NativeEngine(build(self._deepest), table=table))

    def step(self, inputs: Controls, count: int) -> bool:
        """Advance by `count` time steps; False when the simulation has diverged."""
        if self._missing and self._engine.insertion > self._deepest - _MARGIN:
            self._deepest += self._stride
            longer = NativeEngine(self._build(self._deepest), table=self._engine.table)
            carry(self._engine, longer)
            self.added.append(float(longer.data.time))
            self._take(longer)
        return self._engine.step(inputs, count)

    def read(self) -> Readings:
        """What can be read off at the end of the last step."""
        seen = self._engine.read()
        outside = seen.insertion - self.scene.cable.node_distances[: self._missing]
        return seen._replace(
            link_forces=np.concatenate([np.zeros(self._missing), seen.link_forces]),
            link_arcs=np.concatenate([outside, seen.link_arcs]),
        )

    @property
    def gas(self) -> RunGas | None:
        """What fills the colon, where the scene has gas."""
        return self._engine.gas

    @property
    def qpos(self) -> Float[np.ndarray, " positions"]:
        """Generalised positions of the whole scene; joints that are not modelled yet are straight [m, rad]."""
        return self._whole @ self._engine.data.qpos

    @property
    def ctrl(self) -> Float[np.ndarray, " actuators"]:
        """Controls of the last step, of the whole scene; joints that are not modelled yet are locked."""
        whole = np.ones(len(self._actuators))
        whole[self._rows] = self._engine.data.ctrl
        return whole

    def mocap(self, blocks: Blocks) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where these blocks of the wall are [m], and how they are turned, as quaternions; none in a fixed colon."""
        return self._engine.mocap(blocks)

    def colon(self) -> Colon:
        """The colon as it lies now."""
        return self._engine.colon()

    def shape(self) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis, from the handle end of the modelled part to the tip [m]."""
        part, scene = self._engine.shape(), self.scene
        out = self._engine.insertion - scene.cable.node_distances[: self._missing + 1]
        straight = scene.entry + out[:, None] * scene.entry_direction
        return np.vstack([straight, part[1:]])

    def _take(self, engine: NativeEngine) -> None:
        """Step this part from now on."""
        self._engine = engine
        self._missing = len(self.scene.cable.cells) - len(engine.scene.cable.cells)
        self._whole = lifting(engine.scene, self.scene, self._missing)
        self._rows = [self._actuators[_later(each.name, self._missing)] for each in engine.scene.spec.actuators]


def growing(
    wall: Wall | None, *, deepest: float, table: LumenTable | None = None
) -> Callable[[Scene], GrowingEngine | NativeEngine]:
    """A backend for scenes with that wall whose scopes get in by at most `deepest` [m].

    Under gravity, where shaft outside is not straight, all of it is there from the start.
    """

    def engine(scene: Scene) -> GrowingEngine | NativeEngine:
        if any(scene.options.gravity):
            return NativeEngine(scene, table=table)
        return GrowingEngine(
            scene,
            table=table,
            build=lambda inside: build_scene(
                scene.colon,
                wall if scene.options.wall_law == "pieces" else None,
                scene.design,
                scene.options,
                show_lumen=False,
                deepest=min(inside, deepest),
                to_save=False,
            ),
        )

    return engine


def carry(short: NativeEngine, long: NativeEngine) -> None:
    """Let a scene with more shaft go on where one with less stands.

    Joints keep their values, counted from the tip. What the first joint of the shorter scene twists in place of all
    that it leaves out is spread over their twist hinges by compliance.
    """
    shift = len(long.scene.cable.cells) - len(short.scene.cable.cells)
    before, after = short.data, long.data
    same = lifting(short.scene, long.scene, shift)
    for name in ("qpos", "qvel", "qacc_warmstart"):
        getattr(after, name)[:] = same @ getattr(before, name)
    after.time, after.act[:2] = before.time, before.act[:2]
    long.resume(short)


def lifting(short: Scene, long: Scene, shift: int) -> Float[np.ndarray, "long short"]:
    """Values of the longer scene's joints, as a linear function of those of the shorter one's."""
    joints = {joint.name: (row, joint) for row, joint in enumerate(long.spec.joints)}
    matrix = np.zeros((len(joints), len(short.spec.joints)))
    for column, joint in enumerate(short.spec.joints):
        if joint.name != _FIRST_TWIST:
            matrix[joints[_later(joint.name, shift)][0], column] = 1.0
            continue
        names = [name for name in joints if _FIRST_TWIST <= name <= _later(_FIRST_TWIST, shift)]
        compliance = np.array([1 / joints[name][1].stiffness[0] for name in names])
        matrix[[joints[name][0] for name in names], column] = compliance / compliance.sum()
    return matrix


def _later(name: str, shift: int) -> str:
    """Name of the same joint or actuator of a cell where `shift` more cells come before; others keep theirs."""
    stem, _, number = name.rpartition("_")
    return f"{stem}_{int(number) + shift:03d}" if number.isdecimal() else name
