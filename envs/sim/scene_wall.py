"""One world of a device among pieces or tangent planes, seen as those of a batch that meets the lumen's table.

The wall is that of scopes, `haustra.models.wall.piece_wall` or `haustra.models.wall.planes`, which steps MuJoCo's own
data; what presses is read off MuJoCo's contacts.
"""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import DeviceScene
from haustra.models.wall.law import WallContact, honoured_contact
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.moving_planes import MovedLumen, MovingPlaneWall
from haustra.models.wall.piece_wall import PieceWall
from haustra.models.wall.planes import PlaneWall
from haustra.models.wall.signed_distance import LumenDistance
from haustra.models.wall.table_wall import TableLook


class SceneWorld:
    """A model and its data with the arrays and calls of `mujoco.batch.Batch`, stepped with its wall."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Make data of a model."""
        self.model, self.data, self._time = model, mujoco.MjData(model), np.zeros(1)
        mujoco.mj_forward(model, self.data)
        self.wall: PieceWall | PlaneWall | None = None

    def bind(self, name: str) -> np.ndarray:
        """A live array of the data, one world first."""
        return self._time if name == "time" else getattr(self.data, name)[None]

    def expand(self, name: str) -> np.ndarray:
        """A live array of the model, one world first."""
        return getattr(self.model, name)[None]

    @property
    def warning(self) -> Int[np.ndarray, "1 kinds 2"]:
        """What MuJoCo warned of last, and how often."""
        found = self.data.warning
        return np.stack([found.lastinfo, found.number], axis=-1)[None]

    def step(self, ids: Any = None) -> None:
        """Advance by one time step, the wall too, unless the world is left out."""
        if self.wall is not None and (ids is None or len(ids)):
            self.wall.update(self.data)
            self.wall.step(self.data)
            self._time[:] = self.data.time

    def reset(self, ids: Any) -> None:
        """Begin anew, unless the world is left out."""
        if len(ids):
            mujoco.mj_resetData(self.model, self.data)
            mujoco.mj_forward(self.model, self.data)
            self._time[:] = 0.0

    def get_model(self, sim: int) -> mujoco.MjModel:
        """The model."""
        return self.model

    def get_data(self, sim: int) -> mujoco.MjData:
        """The data."""
        return self.data


class SceneWall:
    """What a device asks of its wall, as `haustra.envs.sim.table_planes.TablePlanes` of those of many worlds."""

    def __init__(self, world: SceneWorld, scene: DeviceScene, tables: Tables) -> None:
        """Take a scene of wall law 'planes' or 'pieces'.

        Args:
            world: the compiled scene.
            scene: what was compiled.
            tables: of its colon, one a radius of the device's spheres; they say where along it spheres are.
        """
        assert scene.colon is not None
        self._world, self._scene, model = world, scene, world.model
        contact, count = scene.options.contact, len(scene.handles.samples)
        self._damper_time = contact.damping / contact.stiffness + model.opt.timestep
        self.spheres = np.array([model.geom(f"wall/sphere_{i:04d}").id for i in range(count)])
        self.radius = model.geom_size[self.spheres, 0]
        self.case = np.zeros(1, int)
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self.spheres], 0]
        self._sphere_of = np.full(model.ngeom, -1)
        self._sphere_of[self.spheres] = np.arange(count)
        self._rub = np.zeros((1, count))
        self._look = TableLook(model, self.spheres, tables)
        if scene.options.wall_law == "planes":
            self._wall = self._planes(scene.colon, contact)
        else:
            model.geom_condim[self.spheres] = 3
            self._wall = PieceWall(model, contact, self._look, blocks=scene.blocks)
        world.wall = self._wall

    def _planes(self, colon: Colon, contact: WallContact) -> PlaneWall:
        if self._look.displacement is None:
            return PlaneWall(self._world.model, LumenDistance(colon), arcs=self._start())
        lumen = MovedLumen(colon, self._look)
        return MovingPlaneWall(self._world.model, lumen, self._look, contact, arcs=self._start())

    def _start(self) -> Float[np.ndarray, " spheres"]:
        pose = self._scene.pose
        return pose.arc + (self._world.data.geom_xpos[self.spheres] - pose.position) @ pose.frame[:, 2]

    @property
    def arcs(self) -> Float[np.ndarray, "1 spheres"]:
        """Arc length of each sphere [m]."""
        return self._look.arcs(self._world.data)[None]

    @property
    def depth(self) -> Float[np.ndarray, "1 spheres"]:
        """How deep each sphere is in the wall [m]; negative for room."""
        return self._look.depth(self._world.data)[None]

    @property
    def displacement(self) -> Float[np.ndarray, "1 nodes 7"] | None:
        """Poses of the colon's axis; None where it is fixed."""
        moved = self._wall.displacement
        return None if moved is None else moved[None].copy()

    @property
    def friction(self) -> Float[np.ndarray, "1 spheres"]:
        """Coulomb's coefficient of the wall at each sphere, of which `set_grip` leaves a share [1]."""
        return self._rub

    def set_contact(
        self, worlds: Int[np.ndarray, " reset"], friction: Float[np.ndarray, " reset"], wall_stiffness: Any
    ) -> None:
        """Give the contacts their law: that of `haustra.models.wall.law`."""
        if not len(worlds):
            return
        own = self._scene.own
        stiffness = np.where(np.isnan(own("stiffness")), wall_stiffness, own("stiffness"))
        self._rub[:] = np.where(np.isnan(own("friction")), friction, own("friction"))
        model, spring = self._world.model, (stiffness, stiffness * self._damper_time)
        what = "A stiffness of the wall"
        soft = honoured_contact(self._inverse_inertia, *spring, timestep=model.opt.timestep, what=what)
        if not isinstance(self._wall, PlaneWall) or isinstance(self._wall, MovingPlaneWall):
            self._wall.stiffness[:] = stiffness
        if isinstance(self._wall, PlaneWall):
            pairs = self._wall.pairs
            model.pair_solref[pairs], model.pair_solreffriction[pairs] = soft.solref[:, None], soft.sliding[:, None]
            model.pair_solimp[pairs, :2] = soft.impedance[:, None, None]
        else:
            model.geom_solref[self.spheres], model.geom_solimp[self.spheres, :2] = soft.solref, soft.impedance[:, None]
        self.set_grip(np.ones_like(self._rub))

    def set_grip(self, share: Float[np.ndarray, "1 spheres"]) -> None:
        """Leave each sphere a share of its friction [1]."""
        model, left = self._world.model, (self._rub * share)[0]
        if isinstance(self._wall, PlaneWall):
            model.pair_friction[self._wall.pairs, :2] = left[:, None, None]
        else:
            model.geom_friction[self.spheres, 0] = left

    def run_treads(self, speed: Float[np.ndarray, "1 spheres 3"]) -> None:
        """Nothing is to be said: MuJoCo's contacts know how surfaces run."""

    def place(self, worlds: Int[np.ndarray, " some"]) -> None:
        """Nothing is to be done: the world steps its wall itself."""

    def begin(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Look for every sphere anew, in a colon at rest."""
        if len(worlds):
            self._look.begin(self._start())
            self._wall.begin(self._start())

    def felt(self) -> tuple[Float[np.ndarray, "1 spheres"], Float[np.ndarray, "1 spheres 3"]]:
        """Normal force on each sphere in the last step, and its friction on the wall [N]."""
        sphere, along, across = self._contacts()
        pressed, rubbed = np.zeros(len(self.spheres)), np.zeros((len(self.spheres), 3))
        np.add.at(pressed, sphere, np.linalg.norm(along, axis=1))
        np.add.at(rubbed, sphere, across)
        return pressed[None], -rubbed[None]

    def forces(self) -> Float[np.ndarray, "1 spheres 3"]:
        """Normal force of the wall on each sphere [N]."""
        sphere, along, _ = self._contacts()
        force = np.zeros((len(self.spheres), 3))
        np.add.at(force, sphere, along)
        return force[None]

    def _contacts(self) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """The sphere of each contact of the last step, and the wall's force on it, normal and across [N]."""
        data = self._world.data
        contact, rows = data.contact, data.contact.efc_address
        sphere = self._sphere_of[contact.geom]
        on = np.flatnonzero((rows >= 0) & (sphere >= 0).any(axis=1))
        # Frames point from the first geom to the second.
        sign = np.where(sphere[on, 0] >= 0, -1.0, 1.0)[:, None]
        frames = sign[..., None] * contact.frame[on].reshape(-1, 3, 3)
        force = data.efc_force[rows[on][:, None] + np.arange(3)]
        across = np.einsum("ca,cai->ci", force[:, 1:], frames[:, 1:])
        return sphere[on].max(axis=1), force[:, :1] * frames[:, 0], across
