"""Many scopes in linear time: one program steps all worlds, in the lanes of a CPU or the threads of a GPU."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple, final

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.gas import GasWorlds
from haustra.envs.sim.linear.compile import Driver, lanes_of
from haustra.envs.sim.linear.dual import with_slopes
from haustra.envs.sim.linear.layout import NODE, SEEN, WORLD, seen_slot
from haustra.envs.sim.linear.pack import pack_axis, pack_design, pack_tables, structure_of
from haustra.envs.sim.linear.place import CpuPlace, GpuPlace, Place, team_of
from haustra.envs.sim.linear.world_axes import WorldAxes
from haustra.envs.sim.link_places import link_arcs, middle_spheres
from haustra.envs.sim.native_batch import posed
from haustra.envs.sim.scope_reading import read_chain, read_scope
from haustra.envs.sim.scope_values import Scope, State
from haustra.envs.sim.state import Controls, Readings, refuse_others
from haustra.envs.sim.wheels import require_stretch
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.wires import travel_of_wheels
from haustra.models.injury.perforation import MEDIAN
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.lumen_table import Tables, pick
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.moving_colon import POSE, AxisDisplacement

_OF_COLON = ("spacing", "pleating", "pressure_lost")
"""Numbers of a colon that moves which are a world's: by their names in `layout.WORLD` and of its mesentery."""


class Row(NamedTuple):
    """Numbers of a world, or of one world at several times."""

    state: Float[np.ndarray, "*rows _"]
    """Slots of `haustra.envs.sim.linear.layout.Layout`."""
    worlds: Float[np.ndarray, "*rows _"]
    """Slots of `haustra.envs.sim.linear.layout.WORLD`: what differs between worlds."""
    seen: Float[np.ndarray, "*rows _"]
    """Slots of `haustra.envs.sim.linear.layout.SEEN`, then places of coils and forces of links."""
    driver: Float[np.ndarray, "*rows _"]
    """State of the program's driver."""


class Record:
    """Numbers of a world at several times, written where they are to stay."""

    _AT_ONCE = 3000
    """Rows that room is made for at a time: a minute of a run."""

    def __init__(self, sources: list[np.ndarray]) -> None:
        """For what lies in these arrays (blocks, slots, lanes)."""
        self._sources, self._parts, self._count = sources, [], 0

    def note(self) -> Row:
        """Keep what the numbers are now."""
        at = self._count % self._AT_ONCE
        if not at:
            self._parts.append(Row(*(np.empty((self._AT_ONCE, source.shape[1])) for source in self._sources)))
        now = Row(*(part[at] for part in self._parts[-1]))
        for own, source in zip(now, self._sources, strict=True):
            own[:] = source[0, :, 0]
        self._count += 1
        return now

    def rows(self, count: int) -> Row:
        """The first so many."""
        if len(self._parts) == 1:
            return Row(*(part[:count] for part in self._parts[0]))
        return Row(*(np.concatenate(parts)[:count] for parts in zip(*self._parts, strict=True)))


@final
class LinearBackend(AbstractBackend):
    """Scopes as articulated bodies, by the laws of all backends, in single precision or double."""

    name = "linear"
    traces_pictures = False

    def __init__(
        self,
        scene: Scene,
        tables: Tables,
        *,
        worlds: int,
        threads: int = 1,
        real: type = np.float32,
        device: Literal["cpu", "cuda"] = "cpu",
        scopes: Scope | None = None,
        driver: Driver | None = None,
        wheels: bool = False,
        width: Float[np.ndarray, " rows"] | None = None,
        lookup: Float[np.ndarray, " numbers"] | None = None,
        directions: int = 0,
        colons: Sequence[Colon] = (),
    ) -> None:
        """Compile, or read what was compiled before.

        Args:
            scene: scope and options, built with wall_law "table" for any of the colons.
            tables: the colons, seen from their entries (`LumenTable.seen_from`) and stacked.
            worlds: how many.
            threads: of a CPU; each steps its own part of the worlds.
            real: precision.
            device: threads of the CPU, or the first NVIDIA GPU.
            scopes: one design a world (`haustra.envs.sim.scope_reading.stack_scopes`), of as many joints and spheres as
                the scene's; that of the scene when None.
            driver: who drives within the program (`drive`); hands outside it when None (`step`).
            wheels: whether the driver steers by wheels; hands outside may turn them at any time.
            width: of the lumen at each row of the tables [m], for drivers that ask for it.
            lookup: what else drivers look up.
            directions: along how many the derivatives of all numbers are carried (`gradients.Gradients`).
            colons: those of the tables, which gas asks for their segments; that of the scene when left out.

        Raises:
            InvalidOptionError: when there is not one design a world, of the scene's joints and spheres; when
                derivatives are wanted on a GPU; when gas is, and colons are missing or their segments strange.
            InvalidDesignError: when wheels steer wires that do not stretch.
            MissingDependencyError: when there is no such device.
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        self.scene, self.tables, self.worlds, self.on_device = scene, tables, worlds, device == "cuda"
        self._chain, own = read_chain(scene, backend=self.name), read_scope(scene, backend=self.name)
        self._scope, self._one_each = (own, False) if scopes is None else (scopes, True)
        alike = all(a.shape[1:] == b.shape[1:] for a, b in zip(_arrays(self._scope), _arrays(own), strict=True))
        if not alike or (self._one_each and len(self._scope.start) != worlds):
            raise InvalidOptionError(f"Give one design a world, {worlds}, of the scene's joints and spheres.")
        structure = structure_of(self._chain)
        self._middle = middle_spheres(self._chain.sample_body, structure.layout.bodies)
        moving = tables.mesentery
        nodes = 0 if moving is None else moving.nodes.shape[1]
        alone = worlds == 1 and not directions
        abreast = team_of(worlds, real) if device == "cuda" else lanes_of(real) if alone else 1
        around = {name: moving is not None and getattr(moving, name) for name in ("surrounded", "rooted", "touching")}
        by_turns = abreast == 1 and (device == "cuda" or alone)
        self._layout = replace(
            structure.layout, nodes=nodes, abreast=abreast, moving=moving is not None, by_turns=by_turns, **around
        )
        self._coils = structure.coils
        self._places = int(structure.coils.max()) + 1
        self._first_link = seen_slot("coils") + 3 * self._places
        gas = scene.options.gas is not None
        if gas and (directions or device != "cpu"):
            raise UnsupportedSceneError(
                "The backend 'linear' honours scene.gas on a CPU, without derivatives: leave gas out, or the device."
            )
        if directions and around["touching"]:
            raise UnsupportedSceneError("Derivatives leave out scene.abdomen.loops_touch: leave it out of the scene.")
        if directions and device != "cpu":
            raise InvalidOptionError("Derivatives are carried on a CPU only: leave the device out.")
        self.directions = directions
        self._driver_room = driver.room if driver else 0
        program: dict[str, Any] = {"real": real, "timestep": scene.options.timestep, "worlds": worlds}
        program |= {"threads": min(threads, worlds)} if device == "cpu" else {}
        program |= {"angles": tables.wall.shape[1], "one_design": not self._one_each, "moving": moving is not None}
        program |= {**around, **({"abreast": abreast} if abreast > 1 else {}), **({"gas": True} if gas else {})}
        program |= {name: getattr(scene.options, name) for name in ("elasticity", "friction_rise")}
        program |= {"driver": driver, **({"directions": directions} if directions else {})}
        self._program = program
        self._made: dict[bool, Place] = {}
        """Programs that pulls or wheels steer, as far as they were asked for."""
        self._lookers: dict[Driver, Place] = {}
        self._steer(wheels=wheels)
        lanes = self._place.lanes
        blocks = -(-worlds // lanes)
        stations, wall = pack_tables(tables, 0.0 if width is None else width)
        values = {
            "state": np.zeros((blocks, self._layout.state, lanes)),
            "worlds": np.ones((blocks, len(WORLD), lanes)),
            "driver": np.zeros((blocks, driver.slots if driver else 1, lanes)),
            "asked": np.zeros((max(driver.asks if driver else 0, 1), blocks * lanes)),
            "told": np.zeros((max(driver.tells if driver else 0, 1), blocks * lanes)),
            "seen": np.zeros((blocks, self._first_link + self._layout.bodies, lanes)),
            "lookup": np.zeros(1) if lookup is None else lookup,
            "widths": np.ones((int(np.max(tables.count)), blocks * lanes) if gas else (1, 1)),
            "design": self._designs(blocks),
            "structure": structure.numbers,
            "stations": stations,
            "wall": wall,
            "axis": np.zeros((1, 1)) if moving is None else pack_axis(moving, self._layout.columns),
        }
        colons = colons or [scene.colon]
        self._world_axes: WorldAxes | None = None
        """What water weighs on, where there may be some: from the beginning, or poured by the hand of one world."""
        self._wet = False
        if gas and moving is not None and (worlds == 1 or scene.options.water):
            self._world_axes = WorldAxes(moving, self._layout.columns, colons, worlds)
            values["axis"] = self._world_axes.rows
        values |= {name: with_slopes(each, directions) for name, each in values.items() if self._has_slopes(name)}
        self._held = {name: self._place.hold(each) for name, each in values.items()}
        self._case = np.zeros(worlds, int)
        self.gas: GasWorlds | None = self._filled(colons, width) if gas else None
        """What fills the worlds' colons, where the scene has gas."""
        one, options = np.ones(blocks * lanes), scene.options
        plain = Conditions(options.friction * one, options.wall_stiffness * one, one)
        self._reset(np.arange(blocks * lanes), np.zeros(blocks * lanes, int), plain)
        self.read().checked()  # the shapes stay

    def reset(self, worlds: Int[np.ndarray, " reset"], case: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Lay the scopes of some worlds straight, tips at the start depth, in the colons of those numbers."""
        self._case[worlds] = case
        if self.gas is not None:
            self.gas.begin(worlds, case, conditions.wall_stiffness)
        self._reset(worlds, case, conditions)

    def _reset(self, worlds: np.ndarray, case: np.ndarray, conditions: Conditions) -> None:
        options = self.scene.options
        values = self._begun(worlds, case, conditions) | {"damping_time": options.wall_damping_time}
        values |= {"push_limit": options.push_limit, "torque_limit": options.torque_limit}
        values |= {f"wall_{name}": number for name, number in MEDIAN._asdict().items()}
        for name, value in values.items():
            self._put("worlds", worlds, WORLD.index(name), value)
        self._yield_to_gas(worlds[worlds < self.worlds])
        self._run(0)

    def deal(
        self, worlds: Int[np.ndarray, " begun"], case: Int[np.ndarray, " begun"], conditions: Conditions
    ) -> dict[str, Any]:
        """Numbers that the driver is to give worlds which begin anew, by their names in `layout.WORLD` (`BEGUN`)."""
        self._case[worlds] = case
        values = self._begun(worlds, case, conditions)
        if self.gas is None:
            return values
        self.gas.begin(worlds, case, conditions.wall_stiffness)
        self._yield_to_gas(worlds)
        return values | {name: getattr(self.gas, name)(worlds) for name in ("stiffness", "pressure_lost")}

    def _begun(self, worlds: np.ndarray, case: np.ndarray, conditions: Conditions) -> dict[str, Any]:
        tables, moving = self.tables, self.tables.mesentery
        gravity = np.einsum("wij,i->wj", tables.axes[case], np.asarray(self.scene.options.gravity))
        values: dict[str, Any] = {name: getattr(tables, name)[case] for name in ("step", "first", "count")}
        values |= {"device_radius": tables.device_radius[case], "bending": conditions.shaft_stiffness, "alive": 1.0}
        values |= {f"gravity_{axis}": gravity[:, i] for i, axis in enumerate("xyz")}
        values |= {"first_node": self._first_node(worlds, case, 0)}
        values |= {name: 1.0 if moving is None else getattr(moving, name)[case] for name in _OF_COLON}
        values |= {"stiffness": conditions.wall_stiffness, "friction": conditions.friction, "begins": 1.0, "ring": 0.0}
        return values | {"start_roll": 0.0 if conditions.roll is None else conditions.roll}

    def hang(self, way: Int[np.ndarray, " worlds"]) -> None:
        """Let each world's colon hang that way, of those that its tables' mesenteries come in one after the other."""
        self.give("first_node", self._first_node(np.arange(self.worlds), self._case, way).astype(float))

    def _first_node(self, worlds: np.ndarray, case: np.ndarray, way: Any) -> np.ndarray:
        if self._world_axes is not None:
            return self._world_axes.first(worlds, way)
        return (way * len(self.tables.count) + case) * self._layout.nodes

    def redesign(self, scopes: Scope) -> None:
        """Give each world another design of the same joints and spheres, before a reset.

        Raises:
            InvalidOptionError: when the worlds had one design all together.
        """
        if not self._one_each:
            raise InvalidOptionError("These worlds share one design: give each its own from the beginning.")
        self._scope, held = scopes, self._held["design"].change()
        held[:, : self.numbers("design").shape[1]] = self._designs(len(held))

    def _designs(self, blocks: int) -> np.ndarray:
        """The one design, or those of blocks of worlds."""
        packed, lanes = pack_design(self._scope, self._chain, self._layout), self._place.lanes
        if not self._one_each:
            return packed[0]
        rows = packed[np.minimum(np.arange(blocks * lanes), self.worlds - 1)]
        return np.swapaxes(rows.reshape(blocks, lanes, -1), 1, 2)

    def _has_slopes(self, name: str) -> bool:
        return name in ("state", "worlds", "driver", "seen") or (name == "design" and self._one_each)

    def numbers(self, name: str) -> Float[np.ndarray, "blocks slots lanes"]:
        """An array of the program's, by its name in `ARGUMENTS`, without what derivatives there are behind."""
        held = self._held[name].read()
        return held[:, : held.shape[1] // (1 + self.directions)]

    def slopes(self, name: str) -> Float[np.ndarray, "blocks slots directions lanes"]:
        """Derivatives of an array of the program's, by its name in `ARGUMENTS`, to be written to."""
        held = self._held[name].change()
        slots = held.shape[1] // (1 + self.directions)
        return held[:, slots:].reshape(len(held), slots, self.directions, -1)

    def _put(self, name: str, worlds: np.ndarray, slot: int | list[int], values: Any) -> None:
        block, lane = np.divmod(worlds, self._place.lanes)
        self._held[name].change()[block, slot, lane] = values

    def _of_worlds(self, name: str, start: int, stop: int) -> np.ndarray:
        """Slots of all worlds (worlds, slots), in double precision."""
        return (
            np.swapaxes(self._held[name].read()[:, start:stop], 1, 2)
            .reshape(-1, stop - start)[: self.worlds]
            .astype(float)
        )

    def _slopes_of_worlds(self, name: str, start: int, stop: int) -> np.ndarray:
        """Derivatives of slots of all worlds (worlds, directions, slots)."""
        own = np.moveaxis(self.slopes(name)[:, start:stop], 3, 1)
        return np.swapaxes(own.reshape(-1, *own.shape[2:])[: self.worlds], 1, 2)

    def step(self, inputs: Controls, count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance all worlds by `count` time steps; False for those that have diverged, which stand still from then.

        A world that diverges is left as it was before the step in which it does.
        """
        refuse_others(inputs, self.worlds, wheels=True)
        self._steer(wheels=inputs.wheels is not None)
        wires = inputs.pulls if inputs.wheels is None else travel_of_wheels(np.asarray(inputs.wheels))
        asked = np.column_stack([inputs.push_rate, inputs.roll_rate, wires])
        block, lane = np.divmod(np.arange(self.worlds), self._place.lanes)
        first = WORLD.index("push_rate")  # roll_rate and the pulls follow
        self._held["worlds"].change()[block, first : first + asked.shape[1], lane] = asked
        self._run(count)
        return self.alive

    def _steer(self, *, wheels: bool) -> None:
        """Run the program that steers so, which is compiled when it is first asked for."""
        if wheels:
            require_stretch(self._scope.wire_compliance)
        if wheels not in self._made:
            layout = replace(self._layout, wheels=wheels)
            room = layout.padded(layout.room + self._driver_room)
            own: dict[str, Any] = self._program | {"wheels": wheels, "room": room * (1 + self.directions)}
            self._made[wheels] = GpuPlace(**own) if self.on_device else CpuPlace(**own)
        self._place = self._made[wheels]

    def keep(self) -> tuple[dict[str, np.ndarray], Any]:
        """All that changes of all worlds, to go back to."""
        changes = ("state", "worlds", "driver", "seen", "axis", *(("widths",) if self.gas else ()))
        held = {name: self._held[name].read().copy() for name in changes}
        return held, self.gas and self.gas.keep()

    def put_back(self, kept: tuple[dict[str, np.ndarray], Any]) -> None:
        """Go back to what was kept; going on from there is the same to the bit."""
        held, gas = kept
        for name, values in held.items():
            self._held[name].change()[:] = values
        if self.gas is not None:
            self.gas.put_back(gas)

    @property
    def alive(self) -> Bool[np.ndarray, " worlds"]:
        """Which worlds have not diverged."""
        slot = WORLD.index("alive")
        return self._of_worlds("worlds", slot, slot + 1)[:, 0] > 0

    def drive(self, count: int) -> None:
        """Let the program's own driver decide `count` times; gas moves behind the last."""
        self._run(count)

    def hold(self, values: np.ndarray) -> Any:
        """Numbers where the program runs, for `look_by`."""
        return self._place.hold(values)

    def look_by(self, program: Driver, told: Any) -> None:
        """Let another program look at all worlds and change none, and tell into an array that was held for it."""
        if program not in self._lookers:
            kept = {name: value for name, value in self._program.items() if name not in ("worlds", "threads", "real")}
            self._lookers[program] = self._place.beside(**(kept | {"wheels": False, "driver": program}))
        self._lookers[program].run(self._held | {"told": told}, self._counts(1), self.worlds)

    def give(self, name: str, values: Float[np.ndarray, " worlds"] | float) -> None:
        """Set a number of all worlds, by its name in `haustra.envs.sim.linear.layout.WORLD`."""
        self._put("worlds", np.arange(self.worlds), WORLD.index(name), values)

    def load(self, gravity: Float[np.ndarray, "worlds 3"]) -> None:
        """Set gravity, in each colon's own frame [m/s^2]."""
        seen = np.einsum("wij,wi->wj", self.tables.axes[self._case], gravity)
        for component, axis in enumerate("xyz"):
            self.give(f"gravity_{axis}", seen[:, component])

    def rehang(self, mesentery: Mesentery) -> None:
        """Give colons that move other mesenteries, of as many nodes; axes stay where they are."""
        if self._world_axes is None:
            self._held["axis"].change()[:] = pack_axis(mesentery, self._layout.columns)
        else:
            self._world_axes.rehang(mesentery)
            self._let_water_weigh(np.arange(self.worlds))
        for name in _OF_COLON:
            self.give(name, getattr(mesentery, name)[self._case])

    def tell_driver(self, slot: int, values: Float[np.ndarray, "worlds numbers"]) -> None:
        """Set numbers of the driver, from a slot on."""
        worlds = np.arange(self.worlds)
        for more in range(values.shape[1]):
            self._put("driver", worlds, slot + more, values[:, more])

    def driver_numbers(self) -> Float[np.ndarray, "worlds slots"]:
        """What the driver keeps of each world."""
        return self._of_worlds("driver", 0, self.numbers("driver").shape[1])

    def ask_driver(self, first: int = 0, last: int | None = None) -> Float[np.ndarray, "rows row"]:
        """What the driver is asked, a row a number; rows from the first to before the last are to be written to."""
        return self._held["asked"].change(first, last)

    def told(self, rows: int) -> Float[np.ndarray, "rows row"]:
        """The first rows of what the driver told last, each with a number of each world."""
        return self._held["told"].head(rows)

    def columns(self, name: Literal["asked", "told"], rows: slice) -> Any:
        """Rows of what the driver is asked or tells, as columns (worlds, rows), where they lie."""
        return self._held[name].columns(rows, self.worlds)

    def _counts(self, count: int) -> tuple[int, ...]:
        layout, lanes = self._layout, self._place.lanes
        row = -(-self.worlds // lanes) * lanes
        return layout.dofs, layout.bodies, layout.spheres, layout.nodes, self._places, count, row

    def _run(self, count: int) -> None:
        layout, counts = self._layout, self._counts(count)
        if self.gas is None or not count:
            self._place.run(self._held, counts, self.worlds)
            return
        begun = self._slot(layout.time)
        self._place.run(self._held, counts, self.worlds)
        passed = np.maximum(self._slot(layout.time) - begun, 0.0)  # worlds that begin anew are at nought again
        moved = self.gas.advance(self._slot(layout.arcs + layout.spheres), passed)
        self._yield_to_gas(moved, weigh=self._wet)

    def _filled(self, colons: Sequence[Colon], width: Float[np.ndarray, " rows"] | None) -> GasWorlds:
        """Gas in all worlds' colons."""
        tables = self.tables
        stations, radii = np.atleast_1d(tables.count).astype(int), np.atleast_1d(tables.device_radius)
        if len(colons) != len(stations):
            raise InvalidOptionError(
                f"Gas asks {len(stations)} tabulated colons for their segments, but {len(colons)} were given: give all."
            )
        widths = None if width is None else np.split(width, np.cumsum(stations)[:-1])
        about: dict[str, Any] = {"stations": stations.tolist(), "device_radius": radii, "widths": widths}
        return GasWorlds(colons, self.scene.options, worlds=self.worlds, **about)

    def _yield_to_gas(self, worlds: np.ndarray, *, weigh: bool = True) -> None:
        """Put the walls of some worlds where gas and water hold them, as stiff and as heavy as they make them."""
        if self.gas is None or not len(worlds):
            return
        self._held["widths"].change()[:, worlds] = self.gas.widths(worlds).T
        told = self.gas.burden(worlds)._asdict()
        told |= {"stiffness": self.gas.stiffness(worlds), "pressure_lost": self.gas.pressure_lost(worlds)}
        slots = [WORLD.index(name) for name in told]
        self._put("worlds", worlds[:, None], slots, np.stack(list(told.values()), axis=1))
        wet = bool(self.gas.water.any())
        if wet or weigh:
            self._let_water_weigh(worlds)
        self._wet = wet

    def _let_water_weigh(self, worlds: np.ndarray) -> None:
        """Put the weight of water on the axes of some worlds."""
        if self._world_axes is not None and self.gas is not None:
            rows = self._held["axis"].change()
            self._world_axes.put(rows, worlds, self._case[worlds], self.gas.water[worlds])

    def _slot(self, slot: int) -> Float[np.ndarray, " worlds"]:
        """A number of all worlds' states."""
        return self._of_worlds("state", slot, slot + 1)[:, 0]

    def read(self) -> Readings:
        """What can be read off at the end of the last step."""
        layout = self._layout
        seen = self._of_worlds("seen", 0, self._first_link + layout.bodies)
        read = self.readings(self._of_worlds("state", 0, layout.axis), seen)
        return read._replace(displacement=self.displacement)

    def read_slopes(self) -> Readings:
        """Derivatives of what is read off, along each direction: all arrays have axes of worlds and directions."""
        layout = self._layout
        state, seen = (self._slopes_of_worlds(name, 0, self.numbers(name).shape[1]) for name in ("state", "seen"))
        read = self.readings(state[..., : layout.axis], seen, start=0.0)
        if not layout.nodes:
            return read
        return read._replace(displacement=self.axes(state)[..., :POSE])

    def row(self) -> "Row":
        """All numbers of the first world, as they lie in memory."""
        return Row(*(self._held[name].read()[0, :, 0].copy() for name in Row._fields))

    def record(self) -> "Record":
        """What keeps all numbers of the first world at several times."""
        return Record([self._held[name].read() for name in Row._fields])

    def readings(
        self, state: Float[np.ndarray, "*rows _"], seen: Float[np.ndarray, "*rows slots"], *, start: Any = None
    ) -> Readings:
        """What rows of states and of what was read off say; displacements are left out.

        Args:
            state: of the program.
            seen: of the program.
            start: length of scope past the anus before any was pushed in [m]; that of the designs when None.
        """
        layout, chain = self._layout, self._chain
        parts = {name: seen[..., seen_slot(name) :][..., :count] for name, count in SEEN}
        up, left = (state[..., dofs].sum(axis=-1) for dofs in chain.bend_dofs)
        leading = state.shape[:-1]
        return Readings(
            time=state[..., layout.time],
            insertion=(self._scope.start if start is None else start) + state[..., 0],
            roll=state[..., 1],
            hand_lead=state[..., layout.hand] - state[..., 0],
            tip=parts["tip"],
            tip_frame=parts["tip_frame"].reshape(*leading, 3, 3),
            tip_arc=state[..., layout.arcs + layout.spheres],
            bend=np.stack([up, -left], axis=-1),
            push_force=parts["push_force"][..., 0],
            torque=parts["torque"][..., 0],
            tip_force=parts["tip_force"],
            link_forces=seen[..., self._first_link :],
            link_arcs=link_arcs(state[..., layout.arcs : layout.normals], self._middle),
            deepest=parts["deepest"][..., 0],
            coils=seen[..., seen_slot("coils") : self._first_link].reshape(*leading, -1, 3)[..., self._coils, :],
            wall_force_sum=state[..., layout.normals : layout.hand].sum(axis=-1),
        )

    def state(self) -> State:
        """The whole state, in double precision."""
        layout = self._layout
        ends = (0, layout.speeds, layout.arcs, layout.normals, layout.hand, layout.pulls, layout.time, layout.axis)
        parts = [self._of_worlds("state", *pair) for pair in pairwise(ends)]
        qpos, qvel, arcs, normal, hand, pulls, time = parts
        axis = AxisDisplacement(*self._axes()) if layout.nodes else None
        return State(qpos, qvel, hand, arcs, normal, self.alive, time[:, 0], pulls, displacement=axis)

    def _axes(self) -> tuple[Float[np.ndarray, "worlds nodes 7"], Float[np.ndarray, "worlds nodes 4"]]:
        """Poses and speeds of the colons' axes (`haustra.models.wall.moving_colon.AxisDisplacement`)."""
        both = self.axes(self._of_worlds("state", 0, self._layout.state))
        return both[..., :POSE], both[..., POSE:]

    def axes(self, state: Float[np.ndarray, "*rows slots"]) -> Float[np.ndarray, "*rows nodes 11"]:
        """Poses and speeds of the colons' axes, in rows of states."""
        return self._layout.axes(state)

    def normals(self, state: Float[np.ndarray, "rows slots"]) -> Float[np.ndarray, "rows spheres"]:
        """Normal force of each sphere at the end of the last step [N], in rows of states."""
        return state[:, self._layout.normals : self._layout.hand]

    def arrived(self, state: Float[np.ndarray, "rows slots"]) -> Float[np.ndarray, "rows 4"]:
        """What of the pulls arrived at the bending section [N], in rows of states."""
        return state[:, self._layout.pulls : self._layout.time]

    def joints(self, state: Float[np.ndarray, "rows slots"]) -> Float[np.ndarray, "rows joints"]:
        """Joint positions, in rows of states."""
        return state[:, : self._layout.dofs]

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacement of the colons' axes from rest [m]; None where the colons are fixed in space."""
        return self._axes()[0] if self._layout.nodes else None

    def way_ahead(self, distances: Float[np.ndarray, " places"]) -> Float[np.ndarray, "worlds places 3"]:
        """As `AbstractBackend.way_ahead`."""
        arcs = self._slot(self._layout.arcs + self._layout.spheres)[:, None] + distances
        return moving_colon.axis_at(np, pick(self.tables, self._case), self.displacement, arcs)

    def positions(self) -> Float[np.ndarray, "worlds joints"]:
        """Joint positions of all scopes, as MuJoCo counts them."""
        return self._of_worlds("state", 0, self._layout.dofs)

    def snapshot(self, world: int) -> Snapshot:
        """Where one world is now, its colon too; `state` is a row of the program's own, its axis node by node."""
        layout, row = self._layout, self._of_worlds("state", 0, self._layout.state)[world]
        row[layout.time], tip = 0.0, layout.arcs + layout.spheres
        state = np.concatenate([row[: layout.axis], self.axes(row).ravel()])
        return Snapshot(state, row[layout.arcs : tip], row[layout.pulls : layout.time])

    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Put one world, which was reset to the same colon, where another was."""
        layout, (block, lane) = self._layout, divmod(world, self._place.lanes)
        row = np.zeros(layout.state)
        row[: layout.axis] = snapshot.state[: layout.axis]
        self.axes(row)[:] = snapshot.state[layout.axis :].reshape(layout.nodes, NODE)
        self._held["state"].change()[block, : layout.state, lane] = row
        self._run(0)

    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world as MuJoCo's own values, to draw or to check."""
        return posed(self.scene, self.positions()[world])

    def close(self) -> None:
        """End the threads."""
        for place in self._made.values():
            place.close()


def _arrays(scope: Scope) -> list[np.ndarray]:
    return [*scope.links, *scope[1:]]
