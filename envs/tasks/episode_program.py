"""A control step of episodes within a program of linear time: actions, scopes' steps, observations, rewards, endings.

Every rule is the function that numpy calls for other backends: `haustra.envs.tasks.actions`, `moment`, `rewards`,
`episode` and `observation`. What an episode is dealt comes from outside, and a world that begins anew does so in the
launch in which the others act.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, final

from haustra.envs.sim.linear.layout import BEGUN, seen_slot
from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.program import ScopeProgram
from haustra.envs.sim.linear.sensing import (
    hand_lead,
    inserted_length,
    largest_force,
    largest_load,
    largest_pain,
    tip_arc,
)
from haustra.envs.sim.linear.trace import Changing, Value
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import ACTIONS, Wires, actions_of, asked, within
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.coverage import half_angle_cosine
from haustra.envs.tasks.coverage_program import forget, look_around
from haustra.envs.tasks.episode import EpisodeRules, concluded
from haustra.envs.tasks.moment import Dealt, Kept, Sensed, begun
from haustra.envs.tasks.ray_program import begin_from, look, placed_of
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.wall.vectors import Vector, minus, times

REST, ACT, BEGIN = 0.0, 1.0, 2.0
"""What a world is to do in a launch: stay as it is, act, or begin anew."""
DEALT = ("gain", "slack", "valve", "bears", "case", *BEGUN)
"""What the episode was dealt, and numbers of its world."""
IN_PROGRAM = ("state", "lumen", "imager", "recent", "unseen", "privileged", "gas")
"""Parts of an observation that lie among what the program tells; gas is put there behind it."""
_OVER = "over"
UNREAD = (
    "design",
    "difficulty",
    "seeds",
    "gas_flow",
    "gas_start",
    "water",
    "bleeding",
    "picture_size",
    "stool",
    "mucus",
    "randomisation",
)
"""Fields of a task that its program does not read."""
_GAS = 2000.0
"""Pressure to which any is set, an engineering choice: programs read whether there is a gas action, and no pressure
[Pa]."""


def as_read(rules: EpisodeRules) -> EpisodeRules:
    """The rules, their task without what its program does not read: tasks that differ in the rest share one program."""
    usual = {name: getattr(TaskConfig(), name) for name in UNREAD}
    gas = None if rules.config.gas is None else _GAS
    return replace(rules, config=replace(rules.config, **usual, gas=gas))


@final
@dataclass(frozen=True, kw_only=True)
class EpisodeProgram:
    """Episodes in a program. Each world has what is kept of its episode, and running means of what it measured."""

    rules: EpisodeRules
    """Rules of the episodes; what a program does not read of them is left out (`as_read`)."""
    steps: int
    """Time steps of a control step."""
    coils: tuple[int, ...]
    """Which of the places that are read off each of the imager's coils has."""
    rows_of_cells: int = 0
    """Rows of cells that mucosa is looked for in (`haustra.envs.tasks.coverage`)."""
    field_of_view_deg: float = 140.0
    """Full viewing angle of the camera [degrees]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rules", as_read(self.rules))

    @property
    def turn(self) -> int:
        """Row of what drivers are asked that says what a world is to do; actions come before it, `DEALT` behind."""
        return len(actions_of(self.rules.config))

    @property
    def asks(self) -> int:
        """An action, what to do, and what was dealt."""
        return self.turn + 1 + len(DEALT)

    @property
    def room(self) -> int:
        """It needs none."""
        return 0

    @property
    def slots(self) -> int:
        """What is kept, the means, and which cells were seen."""
        return self._first_cells + self.rows_of_cells

    @property
    def _first_cells(self) -> int:
        config = self.rules.config
        return len(Kept._fields) + len(config.memory) * seen_by.measured_size(config)

    @property
    def tells(self) -> int:
        """Rows of all that is told."""
        return list(self.rows.values())[-1].stop

    @cached_property
    def rows(self) -> dict[str, slice]:
        """Rows of what is told, by name: whether an episode is over comes first."""
        sizes = {name: shape[0] for name, shape in seen_by.sizes(self.rules.config).items() if name in IN_PROGRAM}
        counts = dict.fromkeys((_OVER, *self.rules.told), 1) | {"tip": 3, "push_force": 1} | sizes
        found, start = {}, 0
        for name, count in counts.items():
            found[name] = slice(start, start + count)
            start += count
        return found

    def write(self, scopes: ScopeProgram, numbers: Lanes, room: Lanes, count: Value) -> None:
        """One control step of worlds that act; those that begin are laid straight; the others stay as they are."""
        program = scopes.program
        turn = scopes.asked.load(self.turn)
        begins, acts = turn == BEGIN, turn == ACT
        with program.when(begins):
            self._begin(scopes, numbers, begins)
        before = scopes.state.load(0), scopes.seen.vector(seen_slot("tip"))
        sound, action = within(program.xp, tuple(scopes.asked.load(row) for row in range(self.turn)))
        with program.when(acts):
            self._act(scopes, numbers, acts, sound, action)
        with program.when(begins | acts):
            scopes.observe()
            self._tell(_Worlds(scopes, numbers, begins, acts), before, action)

    def _row(self, name: str) -> int:
        """Row of what drivers are asked, by its name in `DEALT`."""
        return self.turn + 1 + DEALT.index(name)

    def _begin(self, scopes: ScopeProgram, numbers: Lanes, begins: Value) -> None:
        for name in BEGUN:
            dealt = scopes.asked.load(self._row(name))
            scopes.ask(name, scopes.program.xp.where(begins, dealt, scopes.world(name)))
        scopes.lay()
        if self.rules.config.task == "withdrawal":
            begin_from(scopes, begins, scopes.asked.load(self._row("case")))
        if self.rules.covers:
            forget(scopes, numbers.from_slot(self._first_cells), self.rows_of_cells, begins)

    def _act(self, scopes: ScopeProgram, numbers: Lanes, acts: Value, sound: Value, action: tuple[Value, ...]) -> None:
        xp, rules = scopes.program.xp, self.rules
        slots = [Kept._fields.index(name) for name in ("wheel_up", "wheel_left")]
        wheels = numbers.load(slots[0]), numbers.load(slots[1])
        wires = Wires(
            *(scopes.asked.load(self._row(name)) for name in ("gain", "slack")), limit=scopes.scope("pull_limit")
        )
        hand = {"lead": hand_lead(scopes), "outside": scopes.scope("length") - inserted_length(scopes)}
        inputs = asked(xp, rules.config.drive, rules.interval, action, sound, wheels, wires, **hand)
        rates = {"push_rate": inputs.push_rate, "roll_rate": inputs.roll_rate}
        for name, value in (rates | dict(zip(WIRE_NAMES, inputs.pulls, strict=True))).items():
            scopes.ask(name, value)
        for slot, old, new in zip(slots, wheels, inputs.wheels, strict=True):
            numbers.store(slot, xp.where(acts, new, old))
        scopes.advance(self.steps, acts)

    def _tell(self, own: "_Worlds", before: tuple[Value, Vector], action: tuple[Value, ...]) -> None:
        scopes, xp, rules = own.scopes, own.scopes.program.xp, self.rules
        arc = tip_arc(scopes)
        kept = begun(xp, own.begins, Kept(*(own.numbers.load(slot) for slot in range(len(Kept._fields)))), arc)
        kept = kept._replace(age=kept.age + xp.where(own.acts, 1.0, 0.0))
        gain, slack, valve, bears = (scopes.asked.load(self._row(name)) for name in DEALT[:4])
        dealt = Dealt(gain, slack, scopes.world("friction"), scopes.length(), valve, bears)
        placed = placed_of(scopes, self.coils if rules.config.imager else ())
        share, near_by = self._look(own, placed, kept)
        sensed = self._sense(scopes, placed)._replace(coverage=share)
        kept, told = concluded(xp, rules, dealt, kept, sensed, scopes.world("alive") > 0)
        told |= {name: xp.where(own.acts & told[name], 1.0, 0.0) for name in ("terminated", "truncated")}
        told |= {name: xp.where(own.acts, told[name], 0.0) for name in ("reward", *rules.terms)}
        told[_OVER] = told["terminated"] + told["truncated"]
        told |= {"tip": placed.tip, "push_force": scopes.reading("push_force")}
        told |= self._observation(own, placed, before, action, kept.wheel_up, kept.wheel_left)
        if "unseen" in self.rows:
            told["unseen"] = [seen_by.clipped(xp, entry) for entry in (share, *near_by)]
        if "privileged" in self.rows:
            ahead = [placed.in_frame(minus(scopes.station(arc + way)[0], placed.tip)) for way in seen_by.AHEAD]
            known = seen_by.privileged(told["progress"], told["wall_force"], dealt.friction, ahead)
            told["privileged"] = [seen_by.clipped(xp, entry) for entry in known]
        if "lumen" in self.rows:
            first = self.rows["lumen"].start
            look(scopes, placed, lambda entry, value: own.tell(first + entry, seen_by.clipped(xp, value)))
        assert {*told, "lumen", "gas"} >= set(self.rows)
        for slot, value in enumerate(kept):
            own.keep(slot, value)
        for name, rows in ((name, rows) for name, rows in self.rows.items() if name in told):
            values = told[name] if isinstance(told[name], (tuple, list)) else (told[name],)
            for row, value in zip(range(rows.start, rows.stop), values, strict=True):
                own.tell(row, value)

    def _look(self, own: "_Worlds", placed: seen_by.Placed, kept: Kept) -> tuple[Value, tuple[Value, ...]]:
        """Share of the surface seen so far, and what is told of mucosa near by; both as before where nobody looks."""
        scopes, program, rules = own.scopes, own.scopes.program, self.rules
        if not rules.covers:
            return kept.coverage, ()
        rows = self.rows.get("unseen", slice(0, 0))
        before = [scopes.told.load(row) for row in range(rows.start + 1, rows.stop)]
        found = Changing(program, [kept.coverage, *before])
        rounds = kept.age / rules.look_every
        looks = own.begins | (own.acts & (program.xp.floor(rounds) == rounds))
        with program.when(looks):
            cells = own.numbers.from_slot(self._first_cells)
            cosine = half_angle_cosine(self.field_of_view_deg)
            new, near_by = look_around(scopes, placed, cells, cosine, looks)
            told = [kept.coverage + new, *near_by][: 1 + len(before)]
            pairs = zip(told, found.now, strict=True)
            found.now = tuple(program.xp.where(looks, now, then) for now, then in pairs)
        share, *near_by = found.now
        return share, tuple(near_by)

    def _observation(
        self,
        own: "_Worlds",
        placed: seen_by.Placed,
        before: tuple[Value, Vector],
        action: tuple[Value, ...],
        *wheels: Value,
    ) -> dict[str, Any]:
        """What the device measures, and how that differs from its running means."""
        scopes, xp, config = own.scopes, own.scopes.program.xp, self.rules.config
        rate = xp.where(own.acts, 1 / self.rules.interval, 0.0)
        taken = tuple(xp.where(own.acts, part, 0.0) for part in action[: len(ACTIONS)])
        up, left = wheels
        speed = rate * (scopes.state.load(0) - before[0])
        made: dict[str, Any] = {"state": seen_by.state(xp, self._felt(scopes), (up, left), taken, speed)}
        if config.imager:
            made["imager"] = seen_by.imager(placed, times(rate, minus(placed.tip, before[1])))
        made = {name: [seen_by.clipped(xp, entry) for entry in entries] for name, entries in made.items()}
        if config.memory:
            measured, slot, recent = [entry for part in made.values() for entry in part], len(Kept._fields), []
            for forgets in seen_by.forgetting(config.memory, self.rules.interval):
                for entry in measured:
                    mean = seen_by.renewed(own.numbers.load(slot), forgets, entry)
                    mean = xp.where(own.begins, entry, mean)
                    own.keep(slot, mean)
                    recent.append(seen_by.clipped(xp, entry - mean))
                    slot += 1
            made["recent"] = recent
        return {name: made[name] for name in made if name in self.rows}

    def _felt(self, scopes: ScopeProgram) -> seen_by.Felt:
        hand = scopes.reading("push_force"), scopes.reading("torque"), hand_lead(scopes)
        force = scopes.seen.vector(seen_slot("tip_force"))
        return seen_by.Felt(scopes.bend(), *hand, scopes.state.load(1), inserted_length(scopes), force)

    def _sense(self, scopes: ScopeProgram, placed: seen_by.Placed) -> Sensed:
        xp, arc, facing = scopes.program.xp, tip_arc(scopes), scopes.program.constant(1.0)
        if self.rules.config.weights.facing:
            behind, ahead = (scopes.station(arc + way)[0] for way in seen_by.BESIDE)
            facing = seen_by.facing(xp, placed.frame[2], behind, ahead)
        force, _ = largest_force(scopes)
        nothing = scopes.program.constant(0.0)
        hurts, _ = largest_pain(scopes)
        about = {"pain": hurts, "facing": facing, "coverage": nothing}
        return Sensed(arc, inserted_length(scopes), force, *largest_load(scopes), **about)


@dataclass(frozen=True)
class _Worlds:
    """Worlds in a program, and which of them begin or act; the others keep what they had."""

    scopes: ScopeProgram
    numbers: Lanes
    begins: Value
    acts: Value

    def keep(self, slot: int, value: Value) -> None:
        """Keep a number."""
        self._put(self.numbers, slot, value)

    def tell(self, row: Any, value: Value) -> None:
        """Tell a number, or 1 for true and 0 for false."""
        self._put(self.scopes.told, row, self.scopes.program.xp.where(value, 1.0, 0.0) if value.whole else value)

    def _put(self, lanes: Lanes, slot: Any, value: Value) -> None:
        lanes.store(slot, self.scopes.program.xp.where(self.begins | self.acts, value, lanes.load(slot)))
