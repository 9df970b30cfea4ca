"""A scope that is driven live, in linear time, with its instruments, gas and water, posture and a hand on the belly."""

import math
from dataclasses import asdict, replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.console.blood import Bled, Lying, WallBlood
from haustra.envs.console.channel import IN_CHANNEL, Channel
from haustra.envs.console.vehicle import Condition, Grasp, Lever, Look, Surroundings, Vehicle, digest
from haustra.envs.control.endoscopist import ASSISTANT, Memory
from haustra.envs.control.follower import LumenFollower
from haustra.envs.control.laws import driver_settings
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.measure.injury import Burden, InjuryMeter
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.runs.outcome import LEFT_OUTSIDE
from haustra.envs.runs.treatment import beyond_wall
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.sim.physics.hand import HAND_STIFFNESS
from haustra.envs.sim.state import Controls
from haustra.envs.view.picture.lens import lens_of
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.instrument import channel_mouth, instrument_number
from haustra.models.gas.numbers import gas_numbers
from haustra.models.injury.bleeding import suction_pull
from haustra.models.injury.numbers import injury_number
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall import mesentery
from haustra.models.wall.abdomen import DOWN, Abdomen
from haustra.models.wall.lumen_table import axis_tables, lumen_table, seen_from, stack

LENS_SIZE = 480
"""Rows and columns that lenses are given at; pictures have their own [pixels]."""
PUSH_RATE, ROLL_RATE = 0.06, math.radians(90.0)
"""Fastest push [m/s] and turn [rad/s] of the hand; engineering choices, those of episodes."""
LEAST_INSERTION = 0.02
"""The tip is never drawn out further than to here [m]: the anus holds it."""
_PRESSED = ("none", "sigmoid", "transverse")
_INSUFFLATOR = ("automatic", "by hand")


class _Kept(NamedTuple):
    scope: Any
    hand: Controls
    tracked: float
    follower: Any
    conditions: Float[np.ndarray, " conditions"]
    channel: Any
    bled: Bled
    pull: float
    said: str


class ScopeVehicle(Vehicle):
    """A scope on the backend 'linear'."""

    kind = "scope"
    backend = "linear"

    def __init__(self, colon: Colon, design: ScopeDesign, options: SceneOptions, *, driver: str = "follower") -> None:
        """Build the scene and compile.

        Args:
            colon: what it is driven in.
            design: of the scope.
            options: of the scene.
            driver: who helps: a name of `haustra.envs.control.laws.DRIVERS`.

        Raises:
            UnsupportedSceneError: when the backend cannot honour the options.
            InvalidOptionError: when the scope does not fit through the entry, or there is no such driver.
        """
        self.given = colon
        self._design, self._helps = design, driver
        scene = build_scene(colon, None, design, options)
        about: dict[str, Any] = {"with_mesentery": options.mesentery, "abdomen": options.abdomen}
        table = lumen_table(colon, device_radius=scene.cable.radius, **about)
        self.around = scope_surroundings(colon, design, options)
        tables = stack([table.seen_from(*entry_of(colon))])
        if tables.mesentery is not None:
            tables = tables._replace(mesentery=mesentery.may_be_pressed(tables.mesentery))
        self._wheels = design.wires.compliance > 0
        self._scope = LinearSingle(scene, tables=tables, wheels=self._wheels)
        self._moved = CurrentColon(colon, tables, *entry_of(colon)) if options.mesentery else None
        self._steps = max(1, round(CONTROL_INTERVAL / options.timestep))
        self.interval = self._steps * options.timestep
        settings = driver_settings(driver, moves=options.mesentery, steer="wheels" if self._wheels else "pulls")
        self._follower = LumenFollower(colon.centreline, design, tip_links=scene.cable.tip_links, settings=settings)
        self._lead, self._bend = settings.hand_lead_limit, math.radians(design.limits.smallest)
        self._tracker = ArcTracker(colon.centreline, start=options.start_depth)
        self.levers = _levers(options)
        self.conditions = _conditions(options)
        self._channel: Channel | None = None
        if any(lesion.kind == "polyp" for lesion in colon.lesions):  # there is something to take
            self.conditions += (Condition("instrument", "", 0, len(IN_CHANNEL) - 1, IN_CHANNEL),)
            self._channel = Channel(scene)
        abdomen = options.abdomen
        words = {"posture": abdomen.posture, "pressed": abdomen.pressed, "insufflator": "automatic"}
        words["instrument"] = IN_CHANNEL[0]
        begun = {"friction": options.friction, "wall_stiffness": options.wall_stiffness} | words
        self._now = np.array([one.number(begun[one.name]) for one in self.conditions])
        self._scene, self._injury = scene, InjuryMeter(scene)
        self._blood, self._pull, self._said = WallBlood(colon, self._moved), 0.0, ""
        self._before = self._seen = self._scope.read()
        self._burden = self._borne()

    @property
    def scene(self) -> Scene:
        """What is stepped, as it was built."""
        return self._scene

    def configuration(self) -> dict[str, Any]:
        """Design, options, and who helps."""
        about = {"design": asdict(self._design), "options": asdict(self._scene.options)}
        return {"kind": self.kind, **about, "driver": self._helps}

    def step(self, levers: Float[np.ndarray, " levers"]) -> bool:
        """Advance by one control step; a hand that has run ahead of the shaft waits for it.

        An instrument that has just been closed takes what it reaches before.
        """
        seen, interval = self._seen, self.interval
        asked = {one.name: one.limited(value) for one, value in zip(self.levers, levers, strict=True)}
        room = self._scope.scene.cable.length - LEFT_OUTSIDE - seen.insertion
        furthest = min(self._lead - seen.hand_lead, max(room, 0.0)) / interval
        nearest = max(-self._lead - seen.hand_lead, min(LEAST_INSERTION - seen.insertion, 0.0)) / interval
        push = max(min(asked["push"], furthest), nearest)
        hand = Controls(push, asked["roll"], **self._steered(asked["up"], asked["left"]))
        if self._scope.gas is not None:
            self._let_gas(asked["gas"])
            self._scope.gas.pour(asked["water"] * gas_numbers()["water.flow"])
        if self._channel is not None and self._channel.hold(self._value("instrument"), seen, self._tracker.arc):
            self._said = self._channel.said
        sound = self._scope.step(hand, self._steps)
        if self._scope.gas is not None:
            self._scope.gas.forget()
        if sound:
            self._before, self._seen = seen, self._scope.read()
            self._tracker.update(self._seen.tip, self._seen.way)
            self._burden = self._borne()
            self._bleed(asked.get("gas", 0.0))
        return sound

    def _bleed(self, gas: float) -> None:
        """Let the wall bleed that is sheared, or sucked at by a lever of gas that is held at so much [1]."""
        arc = self._tracker.arc
        if self._blood.shear(self._burden.shear[0], self._lying):
            self._said = f"shear: the wall bleeds, the tip is at {100 * arc:.0f} cm"
        self._pull = self._sucked(-min(gas, 0.0) * injury_number("suction"))
        if self._blood.suck(self._pull, arc, lambda: Lying(self._before_mouth()[None], self._displacement())):
            self._said = f"suction: the wall bleeds at {100 * arc:.0f} cm"

    def _sucked(self, suction: float) -> float:
        """Pull on the mucosa [Pa] of suction so far below the atmosphere [Pa], where the wall lies over the channel."""
        gas, arc = self._scope.gas, self._tracker.arc
        if gas is None or not suction:
            return 0.0
        place, widths, colon = self._before_mouth(), gas.widths, self.given
        if (displacement := self._displacement()) is not None and self._moved is not None:
            place = self._moved.to_reference(displacement, place, arc)
        width = np.interp(arc, np.linspace(0.0, colon.centreline.length, len(widths)), widths)
        pressure = gas.pressure[gas.segments_at(np.array([arc]))[0]]
        sealed = np.bool_(beyond_wall(colon, place, arc, width=float(width)) > 0)
        return float(suction_pull(np, suction, pressure, sealed))

    def _before_mouth(self) -> Float[np.ndarray, "3"]:
        """The farthest place before the channel's mouth from which it draws in mucosa [m]."""
        tip, frame = self._seen.tip, self._seen.tip_frame
        return channel_mouth(tip, frame) + instrument_number("channel_width") * frame[:, 2]

    def _steered(self, up: float, left: float) -> dict[str, Any]:
        """Wheels where wires stretch, else pulls, of knobs that are turned by shares of the largest bend."""
        bend = self._bend * np.array([up, left])
        if self._wheels:
            return {"wheels": self._design.wires.routing_radius * bend}
        pulls = self._design.pull_per_angle * np.concatenate([bend, -bend])
        return {"pulls": np.clip(pulls, 0.0, self._design.wires.pull_limit)}

    def _let_gas(self, lever: float) -> None:
        gas = self._scope.gas
        assert gas is not None
        by_hand = self._value("insufflator") == "by hand"
        gas.ask(lever * self._scene.options.gas_flow if lever or by_hand else None)

    def _borne(self) -> Burden:
        """What the colon bears now."""
        seen, gas = self._seen, self._scope.gas
        felt = {name: getattr(seen, name)[None] for name in ("link_forces", "link_arcs", "bend")}
        moved = None if seen.displacement is None else seen.displacement[None]
        pressure = None if gas is None else gas.pressure[gas.segments_at(self._injury.stations)][None]
        return self._injury.measure(seen._replace(**felt, displacement=moved), pressure)

    def _lying(self) -> Lying:
        """Where scope and colon are now."""
        past = self._scene.cable.node_distances < self._seen.insertion
        return Lying(self._scope.shape()[past], self._displacement())

    def _displacement(self) -> Float[np.ndarray, "nodes 7"] | None:
        """Poses of the colon's axis in the coordinates of its tables; None where it is fixed."""
        moved = self._seen.displacement
        return None if self._moved is None or moved is None else self._moved.from_scene(moved)

    def look(self) -> Look:
        """Readings, what the colon bears, and the shape."""
        seen, gas, burden, bled = self._seen, self._scope.gas, self._burden, self._blood.bled
        tissue = () if self._channel is None else (self._channel.tissue,)
        row = {
            "time": seen.time,
            "tip": seen.tip,
            "tip_frame": seen.tip_frame,
            "tip_arc": self._tracker.arc,
            "insertion": seen.insertion,
            "roll": seen.roll,
            "push_force": seen.push_force,
            "torque": seen.torque,
            "bend": seen.bend,
            "wall_force": float(seen.link_forces.max()),
            "wall_force_sum": seen.wall_force_sum,
            "load": float(burden.load[0]),
            "load_arc": float(burden.load_arc[0]),
            "pain": float(burden.pain.max()),
            "coils": seen.coils,
            "bleeding_places": int(bled.sheared.sum()),
            "bleeding_pulled": int(bled.pulled.sum()),
            "bleeding_mm2": self._blood.pulled_mm2 + (0.0 if self._channel is None else self._channel.bleeding_mm2),
            "suction_pull": self._pull,
            "digest": digest(*self._scope.many.row(), *bled, *tissue),
        }
        if gas is not None:
            row |= {"gas_pressure": gas.pressure.copy(), "gas_volume": gas.volume}
            row["water_volume"] = float(gas.water.sum())
        frame = {"shape": self._scope.shape(), "pressed": burden.pressed[0], "pain": burden.pain[0]}
        frame["blood"] = bled.places
        if (displacement := self._displacement()) is not None:
            frame["displacement"] = displacement
        if gas is not None:
            frame["widths"] = gas.widths
        if self._channel is not None:
            row["polyps_taken"] = self._channel.taken
            frame["tissue"] = self._channel.tissue.copy()
        return Look(row, frame)

    @property
    def said(self) -> str:
        """What came of closing an instrument, or where the wall has begun to bleed, whichever was last."""
        return self._said

    def grasp(self) -> Grasp:
        """The handle between two control steps; the hand aims where it turns the shaft to."""
        seen, before, options = self._seen, self._before, self._scene.options
        place, was = (np.array([one.insertion, one.roll]) for one in (seen, before))
        speed = (place - was) / self.interval if seen.time > before.time else np.zeros(2)
        aim = place + np.array([seen.hand_lead, seen.torque / HAND_STIFFNESS[1]])
        return Grasp(seen.time, aim, place, speed, np.array([options.push_limit, options.torque_limit]))

    def assist(self) -> Float[np.ndarray, " levers"]:
        """What the driver does; what it asks of an assistant is done at once."""
        before = self._asked_of_assistant()
        inputs = self._follower.act(self._seen, self._tracker.arc, self.interval)
        if (asked := self._asked_of_assistant()) != before:
            self._assist_as(ASSISTANT[asked])
        up, left = self._follower.asked / self._bend
        values = {"push": inputs.push_rate, "roll": inputs.roll_rate, "up": up, "left": left, "gas": -self._sucks()}
        return np.array([one.limited(float(values.get(one.name, 0.0))) for one in self.levers])

    def _asked_of_assistant(self) -> int:
        """Place in `ASSISTANT` of what the driver asks for; the first where it asks for nothing."""
        memory = self._follower.memory
        return int(memory.assist[0]) if isinstance(memory, Memory) else 0

    def _sucks(self) -> float:
        """Whether the driver sucks gas out [1]."""
        memory = self._follower.memory
        return float(memory.sucks[0]) if isinstance(memory, Memory) else 0.0

    def _assist_as(self, abdomen: Abdomen) -> None:
        """Turn the patient and press on the belly."""
        for name in {"posture", "pressed"} & {one.name for one in self.conditions}:
            self.change(name, self.condition(name).number(getattr(abdomen, name)))

    def change(self, name: str, number: float) -> None:
        """Set a condition: from the next step on."""
        self._now[[one.name for one in self.conditions].index(name)] = number
        if name == "instrument":
            return
        scope, options = self._scope, self._scene.options
        friction, stiffness = float(self._value("friction")), float(self._value("wall_stiffness"))
        options = replace(options, friction=friction, wall_stiffness=stiffness)
        if options.mesentery:
            around = {part: self._value(part) for part in ("posture", "pressed")}
            options = replace(options, abdomen=replace(options.abdomen, **around))
        scope.many.give("friction", friction)
        if scope.gas is None:
            scope.many.give("stiffness", stiffness)
        else:
            scope.gas.soften(stiffness)
            scope.many.give("stiffness", scope.gas.stiffness)
        if name in ("posture", "pressed"):
            own = axis_tables(self.given, options.abdomen).mesentery
            assert own is not None
            hung = mesentery.seen_from(own, *entry_of(self.given))
            scope.many.rehang(mesentery.stack([hung]))
        self._injury = InjuryMeter(replace(self._scene, options=options))

    def now(self) -> Float[np.ndarray, " conditions"]:
        """Conditions as they are."""
        return self._now.copy()

    def _value(self, name: str) -> Any:
        number = dict(zip((one.name for one in self.conditions), self._now, strict=True))
        return self.condition(name).value(number[name])

    def keep(self) -> _Kept:
        """All numbers of scope, gas, follower and conditions."""
        scope = self._scope
        channel = None if self._channel is None else self._channel.keep()
        of_driver = self._tracker.arc, self._follower.memory
        return _Kept(
            scope.keep(), scope.hand, *of_driver, self.now(), channel, self._blood.bled, self._pull, self._said
        )

    def put_back(self, kept: _Kept) -> None:
        """Go back to where the scope was, under the conditions of then."""
        for condition, before, number in zip(self.conditions, self._now.copy(), kept.conditions, strict=True):
            if before != number:
                self.change(condition.name, number)
        self._scope.put_back(kept.scope, kept.hand)
        self._tracker.arc, self._follower.memory = kept.tracked, kept.follower
        if self._channel is not None:
            self._channel.put_back(kept.channel)
        self._blood.bled, self._pull, self._said = kept.bled, kept.pull, kept.said
        self._before = self._seen = self._scope.read()
        self._burden = self._borne()

    def close(self) -> None:
        """End the backend."""
        self._scope.many.close()


def scope_surroundings(colon: Colon, design: ScopeDesign, options: SceneOptions) -> Surroundings:
    """The colon of a scope in a scene of these options."""
    origin, axes = entry_of(colon)
    tables = None
    if options.mesentery:
        axis = axis_tables(colon, options.abdomen)
        tables = stack([seen_from(axis, origin, axes)])
    return Surroundings(colon, tables, origin, axes, design.diameter / 2, lens_of(design.tip, LENS_SIZE, LENS_SIZE))


def _levers(options: SceneOptions) -> tuple[Lever, ...]:
    levers = (
        Lever("push", "m/s", -PUSH_RATE, PUSH_RATE, about="push in, pull back"),
        Lever("roll", "rad/s", -ROLL_RATE, ROLL_RATE, about="turn the shaft, clockwise seen from the handle"),
        Lever("up", "1", -1.0, 1.0, knob=True, about="large knob: up, down"),
        Lever("left", "1", -1.0, 1.0, knob=True, about="small knob: left, right"),
    )
    if options.gas is None:
        return levers
    gas = Lever("gas", "1", -1.0, 1.0, about="insufflate, suck, water first")
    return (*levers, gas, Lever("water", "1", 0.0, 1.0, about="pour in water"))


def _conditions(options: SceneOptions) -> tuple[Condition, ...]:
    conditions = [Condition("friction", "1", 0.0, 2.0), Condition("wall_stiffness", "N/m", 50.0, 1e5)]
    if options.mesentery:
        conditions += [
            Condition("posture", "", 0, len(DOWN) - 1, tuple(DOWN)),
            Condition("pressed", "", 0, len(_PRESSED) - 1, _PRESSED),
        ]
    if options.gas is not None:
        conditions.append(Condition("insufflator", "", 0, 1, _INSUFFLATOR))
    return tuple(conditions)
