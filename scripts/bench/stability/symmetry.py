"""One run elsewhere, mirrored, again, on more threads, and with another form of the same matrix."""

from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Centreline, Colon, Surface
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.nan_injection import small_bank

SECONDS = 4.0
"""Duration of the insertion [s]: past the first bend."""
STEPS = 4
"""Time steps between two records."""
PUSH_RATE = 0.06
PULLS = np.array([14.0, 6.0, 0.0, 0.0])
OPTIONS = SceneOptions(wall_law="planes", insertion_limit=0.35)
SAME_PLACE = 1e-3
"""Tips of the same run in a turned and moved frame [m]. A scene is text, whose six digits put the scope up to 1e-6 m
aside; contacts that come and go let that grow a thousandfold."""
MIRRORED = 1e-3
"""Tips of the same run in a mirror [m], where the scope's hinges are mirrored too. Rounding is all that differs; a snap
from fold to fold lets it grow."""
HALF_CELLS = 2
"""Joints of the shaft, times those of scenes, with which the scope's handedness is looked at again."""
SAME_FORCES = 1e-11
"""Sparse against dense, of the largest acceleration."""
_MOVE = np.array([0.31, -0.12, 0.57])


def symmetry_bars(colon: Colon) -> tuple[Criterion, ...]:
    """All of it, in one colon."""
    path = insert(colon, PULLS)
    turn = _rotation()
    elsewhere = insert(moved(colon, turn, _MOVE), PULLS)
    return (
        Criterion(
            "tips in a turned and moved frame apart",
            _apart(path @ turn.T + _MOVE, elsewhere),
            SAME_PLACE,
            "m",
            "at most",
        ),
        Criterion("tips of the same run, repeated, apart", _apart(path, insert(colon, PULLS)), 0.0, "m", "at most"),
        Criterion("tips on 1, 2 and 3 threads apart", threads_apart(colon), 0.0, "m", "at most"),
        Criterion("accelerations, sparse against dense", sparse_against_dense(colon), SAME_FORCES, "1", "at most"),
    )


def mirror_bars(colon: Colon) -> tuple[tuple[Criterion, ...], Table]:
    """A mirrored scope in a mirrored colon, and what the order of a scope's own hinges makes of the mirror."""
    criteria, rows = (), []
    for joints in (1, HALF_CELLS):
        options = replace(OPTIONS, shaft_cell=OPTIONS.shaft_cell / joints)
        same, handed = (mirrored_apart(colon, options, hinges_too=too) for too in (True, False))
        if joints == 1:
            criteria = (Criterion("tips of the mirrored run apart", float(same.max()), MIRRORED, "m", "at most"),)
        for name, apart in (("mirrored", same), ("as built", handed)):
            rows.append(
                {
                    "shaft_cell_mm": options.shaft_cell * 1e3,
                    "hinges": name,
                    "tips_apart_median_mm": float(np.median(apart)) * 1e3,
                    "tips_apart_max_mm": float(apart.max()) * 1e3,
                }
            )
    note = "Hinges as built turn the same way round in both; that is a difference of discretisation."
    return criteria, Table("Mirrored runs", tuple(rows), note=note)


def mirrored_apart(colon: Colon, options: SceneOptions, *, hinges_too: bool) -> Float[np.ndarray, " records"]:
    """How far the tip of a run is from that of the run in the mirrored colon, mirrored back [m]."""
    mirror = np.diag([1.0, 1.0, -1.0])
    path = insert(colon, PULLS, options)
    other = insert(moved(colon, mirror, np.zeros(3)), PULLS[[0, 3, 2, 1]], options, mirrored=hinges_too)
    return np.linalg.norm(path @ mirror - other, axis=1)


def insert(
    colon: Colon, pulls: Float[np.ndarray, "4"], options: SceneOptions = OPTIONS, *, mirrored: bool = False
) -> Float[np.ndarray, "records 3"]:
    """Tips of a scripted insertion [m]; `mirrored` turns the shaft's hinges the other way round from joint to joint."""
    engine = NativeEngine(build_scene(colon, None, named_design("adult"), options, show_lumen=False))
    if mirrored:
        _mirror_hinges(engine)
    return np.array([_tip(engine, pulls) for _ in range(round(SECONDS / (STEPS * options.timestep)))])


def _mirror_hinges(engine: NativeEngine) -> None:
    """Axes of the bending section lie along the frame's, which the mirrored colon mirrors; the shaft's do not."""
    for index, cell in enumerate(engine.scene.cable.cells):
        if not cell.steerable:
            joints = [engine.model.joint(f"scope/bend_{side}_{index:03d}").id for side in "xy"]
            engine.model.jnt_axis[joints] *= [-1.0, 1.0, 1.0]


def _tip(engine: NativeEngine, pulls: np.ndarray) -> np.ndarray:
    engine.step(Controls(PUSH_RATE, 0.0, pulls), STEPS)
    return engine.read().tip


def moved(colon: Colon, turn: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, " 3"]) -> Colon:
    """The colon turned, or mirrored, and shifted [m]."""
    mirrored = np.linalg.det(turn) < 0
    frames = np.einsum("ij,sjk->sik", turn, colon.centreline.frames)
    faces, radius = colon.lumen.faces, colon.radius
    if mirrored:
        faces = faces[:, ::-1].copy()
        frames = frames * np.array([1.0, -1.0, 1.0])  # right-handed again
        radius = np.roll(radius[:, ::-1], 1, axis=1)  # counted the other way round, from the same first
    line = Centreline(colon.centreline.points @ turn.T + shift, colon.centreline.arc, frames)
    return replace(colon, lumen=Surface(colon.lumen.vertices @ turn.T + shift, faces), centreline=line, radius=radius)


def threads_apart(colon: Colon) -> float:
    """How far apart tips of the same worlds are on different numbers of threads [m]."""
    bank, worlds = small_bank(colon), 3
    tips = []
    for threads in (1, 2, 3):
        batch = NativeBackend(bank.scene, bank.tables, worlds=worlds, threads=threads)
        one = np.ones(worlds)
        batch.reset(np.arange(worlds), np.zeros(worlds, int), Conditions(0.1 * one, 1500 * one, one))
        for _ in range(60):
            batch.step(Controls(np.array([0.05, 0.06, 0.04]), 0.2 * one, np.tile(PULLS, (worlds, 1))), STEPS)
        tips.append(batch.read().tip)
        batch.close()
    return max(_apart(tips[0], each) for each in tips[1:])


def sparse_against_dense(colon: Colon) -> float:
    """Largest difference of accelerations at the states of a run, over the largest acceleration.

    Both are solved to rounding: what the solver's own tolerance leaves is no matter of the matrix.
    """
    engine = NativeEngine(build_scene(colon, None, named_design("adult"), OPTIONS, show_lumen=False))
    worst = 0.0
    for _ in range(round(SECONDS / (20 * OPTIONS.timestep))):
        engine.step(Controls(PUSH_RATE, 0.0, PULLS), 20)
        found = []
        for form in (mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_SPARSE):
            model = mujoco.MjModel.__copy__(engine.model)
            model.opt.jacobian, model.opt.solver = form, mujoco.mjtSolver.mjSOL_NEWTON
            model.opt.tolerance, model.opt.iterations, model.opt.ls_iterations = 0.0, 200, 200
            data = mujoco.MjData(model)
            mujoco.mj_copyData(data, model, engine.data)
            mujoco.mj_forward(model, data)
            found.append(data.qacc.copy())
        worst = max(worst, float(np.abs(found[0] - found[1]).max() / np.abs(found[0]).max()))
    return worst


def _apart(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.linalg.norm(first - second, axis=-1).max())


def _rotation() -> Float[np.ndarray, "3 3"]:
    turn, quat = np.zeros(9), np.array([0.5, -0.3, 0.7, 0.2])
    mujoco.mju_quat2Mat(turn, quat / np.linalg.norm(quat))
    return turn.reshape(3, 3)
