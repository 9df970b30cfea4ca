"""What a clinic would have measured of patients that are examined side by side."""

from collections.abc import Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.control.endoscopist import Memory
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.insertion_program import TOLD
from haustra.envs.runs.measure.loops import LoopKind
from haustra.envs.sim.chain import pose
from haustra.envs.sim.scope_reading import read_chain, read_scope
from haustra.envs.study.clinic_gas import PatientsGas
from haustra.envs.study.clinic_loops import Seen, all_loops
from haustra.envs.study.clinic_pain import PainWatch
from haustra.envs.study.patients import Patient, clinic_number, numbers
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.numbers import gas_numbers

if TYPE_CHECKING:
    from haustra.envs.runs.linear_insertions import LinearInsertions

EVERY = 5
"""Control intervals between two looks: ten a second."""
_LOOPS_EVERY = 20
"""Looks between two at shapes: one in two seconds."""
SECONDS = CONTROL_INTERVAL * EVERY
"""Time between two looks [s]."""
_CURVE_POINTS = 240


class ClinicWatch:
    """Looks at all patients of a batch after every `EVERY` control intervals."""

    def __init__(
        self,
        batch: "LinearInsertions",
        patients: Sequence[Patient],
        colons: Sequence[Colon],
        case: Int[np.ndarray, " worlds"],
    ) -> None:
        """Get to know them.

        Args:
            batch: worlds that are stepped.
            patients: each world's.
            colons: each world's.
            case: which of the batch's colons each world has; the batch has all of them once for each thing that an
                assistant may do.
        """
        self._batch, self._patients, self._colons, self._case = batch, patients, colons, case
        scene, worlds = batch.backend.scene, len(patients)
        self._chain, scope = read_chain(scene).chain, read_scope(scene)
        self._pose = jax.jit(partial(pose, self._chain, scope.links))
        self._tip = scope.tip_place[0, 0]
        self._behind = np.concatenate([scene.cable.node_distances, [0.0]])[-len(self._chain.last_dof) - 1 :]
        self._borders = {
            name: np.array([next(part.start for part in colon.segments if part.name == name) for colon in colons])
            for name in SEGMENTS
        }
        self._looks: list[Float[np.ndarray, "told worlds"]] = []
        self._shapes: list[Float[np.ndarray, "worlds points 3"]] = []
        self._beside: list[Float[np.ndarray, "worlds points"]] = []
        self._inserted: list[Float[np.ndarray, " worlds"]] = []
        self._loop_times: list[Float[np.ndarray, " worlds"]] = []
        self._loads: list[Float[np.ndarray, "2 worlds"]] = []
        self._assist = np.zeros(worlds)
        self._gas = PatientsGas(colons)
        self._pain = PainWatch(
            patients,
            colons,
            self._mesentery(),
            self._borders,
            diameter=2 * float(scope.radius[0]),
            lengths=np.append(scope.links.offset[0, 1:, 2], self._tip[2]),
        )

    def __call__(self) -> None:
        """Look, and let the assistants do what they are asked."""
        self._looks.append(self._batch.told()[: len(TOLD)].astype(float))
        tally = self._batch.program.tally_of(self._batch.driver_numbers())
        self._loads.append(np.array([tally.load_peak, tally.load_arc]))
        if len(self._looks) % _LOOPS_EVERY == 0:
            seen = self._batch.backend.read()
            self._look_at_shapes(seen)
            self._look_for_pain(seen)
        self._help()

    def _help(self) -> None:
        """Give each patient the abdomen that its driver asks for, and the gas that it leaves."""
        backend, program = self._batch.backend, self._batch.program
        memory = program.memory_of(self._batch.driver_numbers())
        if not isinstance(memory, Memory):
            return
        sucks = memory.sucks > 0
        if backend.gas is not None:
            backend.gas.asked = np.where(sucks, -gas_numbers()["suction"], np.nan)
        elif sucks.any() or not self._gas.full:
            backend.give("pressure_lost", self._gas(sucks, SECONDS))
        if (memory.assist != self._assist).any():
            self._assist = memory.assist.copy()
            backend.hang(self._assist.astype(int))

    def _look_at_shapes(self, seen: Any) -> None:
        """Keep the scopes' shapes, whose loops are named at the end."""
        where = self._pose(self._batch.backend.positions().astype(np.float32))
        origin, rotation = np.asarray(where.origin), np.asarray(where.rotation)
        tips = origin[:, -1] + rotation[:, -1] @ self._tip.astype(np.float32)
        arcs = seen.link_arcs
        middle = np.concatenate([arcs[:, :1], (arcs[:, 1:] + arcs[:, :-1]) / 2, seen.tip_arc[:, None]], axis=1)
        self._shapes.append(np.concatenate([origin, tips[:, None]], axis=1))
        self._beside.append(middle.astype(np.float32))
        self._inserted.append(np.array(seen.insertion))
        self._loop_times.append(seen.time.copy())

    @cached_property
    def _loops(self) -> list[list[frozenset[LoopKind]]]:
        """Loops of each patient, at those looks at shapes before which its examination went on."""
        if not self._shapes:
            return [[] for _ in self._patients]
        looks = []
        for world in range(len(self._patients)):
            fresh = self._fresh(world)
            shapes, beside, inserted = (
                np.array([each[world] for each in part])[fresh] for part in (self._shapes, self._beside, self._inserted)
            )
            looks.append(Seen(shapes, beside, inserted))
        return all_loops(looks, list(self._colons), self._behind)

    def _fresh(self, world: int) -> Bool[np.ndarray, " looks"]:
        """Looks at shapes at which more time had passed than at the one before."""
        return np.diff([each[world] for each in self._loop_times], prepend=0.0) > 0

    def _mesentery(self) -> Any:
        """Each patient's own, as it is without an assistant."""
        hung = self._batch.backend.tables.mesentery
        assert hung is not None
        return type(hung)(*(np.asarray(part)[self._case] for part in hung))

    def _look_for_pain(self, seen: Any) -> None:
        """See what hurts those whose examination goes on, and has not come past the valve."""
        before = self._looks[-1 - _LOOPS_EVERY][0] if len(self._looks) > _LOOPS_EVERY else 0.0
        tally = self._batch.program.tally_of(self._batch.driver_numbers())
        going = (seen.time > before) & (tally.tip_arc_max < self._borders["caecum"])
        self._pain(seen, going, SECONDS * _LOOPS_EVERY)

    def scores(self, world: int) -> dict[str, Any]:
        """What a patient's examination showed, up to where the tip came past the valve."""
        time, shaft, arc, force, torque = self._course(world)
        valve, flexure = self._borders["caecum"][world], self._borders["transverse"][world]
        there = np.flatnonzero(arc >= valve)
        reached = bool(len(there))
        last = int(there[0]) + 1 if reached else len(time)
        time, shaft, arc, force, torque = (part[:last] for part in (time, shaft, arc, force, torque))
        loads, places = self._loads_seen[self._going_on(world), :, world][:last].T
        loops, at_flexure = self._loops_until(world, float(time[-1]), time[arc >= flexure])
        each = SECONDS * _LOOPS_EVERY
        stood = {kind: each * sum(kind in seen for seen in loops) for kind in LoopKind}
        lasts, length = clinic_number("loop_lasts"), self._colons[world].centreline.length
        strong = numbers()["contact.pain_proxy_force"].value
        half = bool(((shaft <= 0.5) & (arc >= flexure)).any())
        edges = np.array([self._borders[name][world] for name in SEGMENTS])
        segment = np.searchsorted(edges, arc, side="right") - 1
        axial = {
            f"axial_{name}_N": float(np.abs(force[segment == index]).mean()) if (segment == index).any() else None
            for index, name in enumerate(SEGMENTS)
        }
        return {
            "sex": self._patients[world].sex,
            "reach": float(min(arc.max() / length, 1.0)),
            "caecum": float(reached),
            "time_s": float(time[-1]),
            "descending_s": _first(time, arc >= (self._borders["descending"][world] + flexure) / 2),
            "flexure_s": _first(time, arc >= flexure),
            "inserted_m": float(shaft[-1]) if reached else None,
            "half_metre": float(half),
            "any_loop": float(each * sum(bool(seen) for seen in loops) >= lasts),
            "n_loop": float(stood[LoopKind.N] >= lasts),
            **{f"loop_{_column(kind)}_s": seconds for kind, seconds in stood.items()},
            **{
                f"at_flexure_{_column(kind)}": None if at_flexure is None else float(kind in at_flexure)
                for kind in LoopKind
            },
            "looped_share": float(np.mean([bool(seen) for seen in loops])) if loops else 0.0,
            "push_peak_N": float(max(force.max(), 0.0)),
            "pull_peak_N": float(max(-force.min(), 0.0)),
            "torque_peak_Nm": float(np.abs(torque).max()),
            "torque_clockwise_Nm": float(max(torque.max(), 0.0)),
            "torque_anticlockwise_Nm": float(max(-torque.min(), 0.0)),
            "strong_share": float((np.abs(force) > strong).mean()),
            **axial,
            "straightenings": float(pull_backs(shaft, clinic_number("pull_back"))),
            **self._pain.scores(world),
            "p_perforation": self._patients[world].torn(float(loads[-1])),
            "load_peak": float(loads[-1]),
            "load_s": float(time[np.argmax(loads >= loads[-1])]),
            "load_from_tip_m": float(arc[np.argmax(loads >= loads[-1])] - places[-1]),
        }

    def _loops_until(
        self, world: int, last: float, passed: np.ndarray
    ) -> tuple[list[frozenset[LoopKind]], frozenset[LoopKind] | None]:
        """Loops at each look up to a time [s], and those when the tip first was past the splenic flexure."""
        times = np.array([each[world] for each in self._loop_times])[self._fresh(world)]
        seen = [kinds for kinds, t in zip(self._loops[world], times, strict=True) if t <= last]
        if not len(passed) or not seen:
            return seen, None
        first = min(int(np.searchsorted(times, passed[0])), len(seen) - 1)
        return seen, seen[first]

    def _course(self, world: int) -> tuple[np.ndarray, ...]:
        """Time, shaft inside, arc of the tip, force and torque of the hand, while the examination went on."""
        return tuple(self._told_seen[self._going_on(world), :, world].T)

    def _going_on(self, world: int) -> Bool[np.ndarray, " looks"]:
        """Looks before which a patient's examination went on."""
        return np.diff(self._told_seen[:, 0, world], prepend=-1.0) > 0

    @cached_property
    def _told_seen(self) -> Float[np.ndarray, "looks told worlds"]:
        return np.array(self._looks)

    @cached_property
    def _loads_seen(self) -> Float[np.ndarray, "looks 2 worlds"]:
        return np.array(self._loads)

    def curves(self, world: int) -> dict[str, list[float]]:
        """The course of an examination at some moments."""
        names = ("time_s", "insertion_m", "tip_arc_m", "push_force_N", "torque_Nm")
        course = self._course(world)
        kept = np.unique(np.linspace(0, len(course[0]) - 1, _CURVE_POINTS).astype(int))
        return {name: [float(v) for v in np.round(part[kept], 5)] for name, part in zip(names, course, strict=True)}


def pull_backs(shaft: np.ndarray, least: float) -> int:
    """Times that at least so much shaft was drawn out in one go [m]; a stroke in by a tenth of it ends a go."""
    count, top, bottom, counted = 0, shaft[0], shaft[0], False
    for now in shaft:
        if now > bottom + least / 3:
            top, bottom, counted = now, now, False
        top, bottom = max(top, now) if now > top else top, min(bottom, now)
        if not counted and top - bottom >= least:
            count, counted = count + 1, True
    return count


def _first(time: np.ndarray, there: np.ndarray) -> float | None:
    """The first of the times at which it was there, if it ever was."""
    return float(time[there][0]) if there.any() else None


def _column(kind: LoopKind) -> str:
    return kind.value.replace(" ", "_")
