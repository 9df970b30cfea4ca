"""Colons that move on their mesentery: random numbers, shocks, time steps and numbers that are none."""

from typing import Any

import numpy as np

from haustra.assets import asset
from haustra.envs.sim.state import Controls
from haustra.errors import HaustraError
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.cable import PULL_OUT_LIMIT
from haustra.models.devices.scope.library import named_design
from haustra.models.wall.lumen_table import Tables
from haustra.quantity import load_quantities
from haustra.scripts.bench.result import Criterion, Table, Value
from haustra.scripts.bench.stability.moving_rig import OPTIONS, Act, Found, Given, MovingRig, Numbers, all_finite, load
from haustra.scripts.bench.stability.nan_injection import BAD, BLOCK, Injection
from haustra.scripts.bench.stability.nan_injection import judge as judge_cases
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import HOLD, prepare_colons
from haustra.scripts.bench.stability.ranges import BEYOND, Range, draw

WORLDS, QUICK_WORLDS = 32, 8
"""Number of worlds in one batch: half inside the ranges, half beyond."""
BATCHES, QUICK_BATCHES = 16, 1
SECONDS, QUICK_SECONDS = 10.0, 2.0
"""Simulated in each random run, and in each run of a time step [s]."""
DRIVE_IN, QUICK_DRIVE_IN = 6.0, 3.0
"""Time in which scopes are pushed in before a shock [s]."""
AFTER, QUICK_AFTER = 10.0, 4.0
"""Time to come to rest in [s]; hands are still."""
STEPS = (0.005, 0.007, 0.01, 0.014, 0.02)
"""Time steps that are tried [s]; 20 ms is the longest that a scene takes."""
PUSH, ROLL, PULL = 0.2, 6.28, 1.0
"""Fastest push [m/s] and roll [rad/s], and largest pull of a wire over its limit [1]."""
WARM_UP = 100
"""Time steps before numbers that are none are put in."""
HUNG = ("hold", "support", "tension", "bending", "slack", "drag", "pleating")
"""Arrays of a mesentery that get them."""
KNOWN = ("stiffness", "damping_time", "friction", "bending", "tip_bending", "torsion", "push_limit")
"""Numbers of worlds that get them."""
_DRIVEN = (0.05, 0.0, (20.0, 8.0, 0.0, 0.0))


def moving(order: RunOptions, progress: Progress) -> Part:
    """All of it, in grown colon 0."""
    folder = order.folder / "colons"
    prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"), walls=False)
    rig = MovingRig(load_colon(folder / "grown-0"), QUICK_WORLDS if order.quick else WORLDS)
    batches = QUICK_BATCHES if order.quick else BATCHES
    rows: list[dict[str, Value]] = []
    for number in range(batches):
        progress(0.6 * number / batches, "random numbers")
        rows += random_batch(rig, order.seed, number, seconds=QUICK_SECONDS if order.quick else SECONDS)
    progress(0.6, "shocks")
    shocked = shocks(rig, quick=order.quick)
    progress(0.7, "time steps")
    limit = largest_step(rig, order.seed, quick=order.quick)
    progress(0.8, "numbers that are none")
    return judge(rows, shocked, limit, inject(rig))


def mesentery_ranges() -> tuple[Range, ...]:
    """Ranges of the numbers of a mesentery, and of what else differs between worlds."""
    numbers = load_quantities(asset("numbers/mesentery.toml"))
    contact = load_quantities(asset("numbers/contact.toml"))
    of_mesentery = [
        Range(name, each.low, each.high, each.unit, "numbers", log=each.low > 0) for name, each in numbers.items()
    ]
    worlds = [
        Range(f"world.{name}", quantity.low, quantity.high, quantity.unit, "numbers")
        for name, quantity in (
            ("friction", contact["contact.friction"]),
            ("stiffness", contact["contact.wall_stiffness"]),
        )
    ]
    return (*of_mesentery, *worlds)


def _drawn(rig: MovingRig, seed: int) -> list[dict[str, float]]:
    """Numbers of all worlds, none of them negative: the first half inside the ranges, the others beyond."""
    half, variables = rig.worlds // 2, mesentery_ranges()
    inside = draw(variables, half, seed=seed, beyond=0.0)
    beyond = draw(variables, rig.worlds - half, seed=seed + 1, beyond=BEYOND)
    return [{name: max(value, 0.0) for name, value in row.items()} for row in (*inside, *beyond)]


def _set(rig: MovingRig, drawn: list[dict[str, float]]) -> tuple[Tables, Given]:
    """Colons and numbers of all worlds."""
    of_mesentery: list[Numbers] = [
        {name: value for name, value in row.items() if name.startswith("mesentery.")} for row in drawn
    ]
    own = {name: np.array([row[f"world.{name}"] for row in drawn]) for name in ("friction", "stiffness")}
    return rig.tables(of_mesentery), own


def _random_hands(rig: MovingRig, rng: np.random.Generator, seconds: float) -> Act:
    """Mostly inwards, two wires at most; something else every `HOLD` seconds."""
    changes = int(np.ceil(seconds / HOLD)) + 1
    limit = named_design("adult").wires.pull_limit
    push = PUSH * rng.uniform(-0.5, 1.0, (changes, rig.worlds))
    roll = ROLL * rng.uniform(-1.0, 1.0, (changes, rig.worlds))
    sides = PULL * limit * rng.uniform(-1.0, 1.0, (changes, rig.worlds, 2))
    pulls = np.concatenate([np.maximum(sides, 0.0), np.maximum(-sides, 0.0)], axis=-1)

    def act(time: float) -> Controls:
        now = int(time / HOLD + 1e-6)
        return Controls(push[now], roll[now], pulls[now])

    return act


def random_batch(rig: MovingRig, seed: int, number: int, *, seconds: float) -> list[dict[str, Value]]:
    """Random mesenteries, walls and hands; a row a world."""
    drawn = _drawn(rig, seed + 2 * number)
    tables, given = _set(rig, drawn)
    hands = _random_hands(rig, np.random.default_rng([seed, number]), seconds)
    found = rig.run([(tables, given, hands, seconds)], timestep=OPTIONS.timestep)
    return [
        {
            "ranges": "inside" if world < rig.worlds // 2 else "beyond",
            "outcome": "finished" if found.healthy[world] else "diverged",
            "finite": found.finite,
            "fastest_per_s": float(found.fastest[world]),
            "furthest_colon_m": float(found.furthest[world]),
        }
        for world in range(rig.worlds)
    ]


def largest_step(rig: MovingRig, seed: int, *, quick: bool) -> float:
    """Largest time step up to which random mesenteries inside the ranges and hands are stable [s]; 0 when none is."""
    seconds, best = QUICK_SECONDS if quick else SECONDS, 0.0
    inside = draw(mesentery_ranges(), rig.worlds, seed=seed + 7, beyond=0.0)
    for step in STEPS:
        tables, given = _set(rig, inside)
        hands = _random_hands(rig, np.random.default_rng([seed, 7]), seconds)
        if not rig.run([(tables, given, hands, seconds)], timestep=step).healthy.all():
            break
        best = step
    return best


SHOCKS = (
    "none",
    "friction 0, 1, back",
    "wall stiffness times 100, back",
    "wall stiffness over 100, back",
    "mesentery and tube ten times as stiff, back",
    "mesentery and tube a tenth as stiff, back",
    "mesentery a tenth as high, back",
    "tip released from full bend, pulled out at 1 m/s",
)
"""One a world; what is done to it while the hands go on."""
_STIFF = ("stiffness", "attachment", "anus", "support", "modulus")


def shocks(rig: MovingRig, *, quick: bool) -> list[dict[str, Value]]:
    """Each shock to a world of its own; a row each."""
    step = OPTIONS.timestep
    spare = rig.worlds - len(SHOCKS)
    numbers = {name: each.value for name, each in load_quantities(asset("numbers/mesentery.toml")).items()}
    stiffer, softer = (
        {f"mesentery.{name}": factor * numbers[f"mesentery.{name}"] for name in _STIFF} for factor in (10, 0.1)
    )
    lower = {name: 0.1 * value for name, value in numbers.items() if ".height." in name}
    usual: list[Numbers] = [{}] * rig.worlds
    changed: list[Numbers] = [{}, {}, {}, {}, stiffer, softer, lower, {}, *[{}] * spare]
    one = np.ones(rig.worlds)
    slippery, sticky, wall, out = one.copy(), one.copy(), one.copy(), one.copy()
    slippery[1], sticky[1], wall[2:4] = 0.0, 1 / OPTIONS.friction, (100.0, 0.01)
    out[7] = -PULL_OUT_LIMIT / _DRIVEN[0]
    still, driven = _hands(rig, 0 * one), _hands(rig, one)
    own = {"friction": OPTIONS.friction * one, "stiffness": OPTIONS.wall_stiffness * one}
    as_it_is = rig.tables(usual), own
    shaken = [
        (rig.tables(changed), {"friction": own["friction"] * slip, "stiffness": own["stiffness"] * wall})
        for slip in (slippery, sticky)
    ]
    full = named_design("adult").wires.pull_limit
    bent = _hands(rig, one, pulls=np.where(np.arange(rig.worlds)[:, None] == 7, [full, 0.0, 0.0, 0.0], _DRIVEN[2]))
    leaving = _hands(rig, out, pulls=np.where(np.arange(rig.worlds)[:, None] == 7, 0.0, np.array(_DRIVEN[2])))
    found = rig.run(
        [
            (*as_it_is, driven, QUICK_DRIVE_IN if quick else DRIVE_IN),
            (*as_it_is, bent, 1.0),
            (*shaken[0], leaving, 0.1),
            (*shaken[0], driven, 0.9),
            (*shaken[1], driven, 1.0),
            (*as_it_is, still, QUICK_AFTER if quick else AFTER),
        ],
        timestep=step,
    )
    return _shock_rows(found)


def _hands(rig: MovingRig, share: np.ndarray, *, pulls: Any = None) -> Act:
    """Controls that stay throughout: a share of the usual push, and the usual pulls unless others are given."""
    asked = np.where(share[:, None] != 0, _DRIVEN[2], 0.0) if pulls is None else pulls
    hands = Controls(_DRIVEN[0] * share, 0 * share, asked)
    return lambda time: hands


def _shock_rows(found: Found) -> list[dict[str, Value]]:
    return [
        {
            "shock": name,
            "outcome": "finished" if found.healthy[world] else "diverged",
            "fastest_per_s": float(found.fastest[world]),
            "speed_last_second_per_s": float(found.speed_end[world]),
            "furthest_colon_m": float(found.furthest[world]),
        }
        for world, name in enumerate(SHOCKS)
    ]


_HANDLED = tuple(name for name in Controls._fields if name != "wheels")
"""What hands do but turn wheels, which is refused."""


def inject(rig: MovingRig) -> list[Injection]:
    """NaN and infinities in what hands do, NaN in parameters and in a mesentery, of one world among others."""
    injected, tables = 1, rig.tables()
    hung, hands = tables.mesentery, _hands(rig, np.ones(rig.worlds))(0.0)
    assert hung is not None, "a rig of colons that move"
    options = {"stiffness": OPTIONS.wall_stiffness, "damping_time": OPTIONS.wall_damping_time}
    options |= {"friction": OPTIONS.friction, "push_limit": OPTIONS.push_limit}
    usual = {name: options.get(name, 1.0) for name in KNOWN}
    others = np.arange(rig.worlds) != injected

    def run(where: str = "", name: str = "", value: float = 0.0) -> tuple[list[np.ndarray], bool, bool]:
        """State of all worlds, whether the one was lost, and whether all that can be read is finite."""

        def bad(values: np.ndarray | float) -> np.ndarray:
            shape = np.shape(values) or (rig.worlds,)
            changed = np.array(np.broadcast_to(values, shape), float)
            changed[injected] = value
            return changed

        backend = rig.begin(OPTIONS.timestep)
        load(backend, tables, usual)
        backend.step(hands, WARM_UP)
        if where == "worlds":
            backend.give(name, bad(usual[name]))
        own = hung._replace(**{name: bad(getattr(hung, name))}) if where == "mesentery" else hung
        backend.rehang(own)
        asked = hands._replace(**{name: bad(getattr(hands, name))}) if where == "hands" else hands
        alive = backend.step(asked, BLOCK)
        state = backend.state()
        axis = state.displacement
        parts = [*state[:5], state.pulls, *(axis or ())]
        return parts, not alive[injected], all_finite(backend) if where in ("", "hands") else _finite(parts)

    clean = run()[0]

    def case(where: str, name: str, value: float) -> Injection:
        try:
            found, lost, finite = run(where, name, value)
        except HaustraError:
            return Injection("linear, moving colon", f"{where}: {name}", value, "refused", True, True)
        same = all(np.array_equal(a[others], b[others]) for a, b in zip(found, clean, strict=True))
        # What is read of the world that was given them after bad numbers is not asked for: a reset takes it out.
        return Injection("linear, moving colon", f"{where}: {name}", value, "diverged" if lost else "", same, finite)

    cases = [case("hands", name, value) for name in _HANDLED for value in BAD]
    cases += [case("worlds", name, np.nan) for name in KNOWN]
    return cases + [case("mesentery", name, np.nan) for name in HUNG]


def _finite(parts: list[np.ndarray]) -> bool:
    return all(np.isfinite(part).all() for part in parts)


def judge(rows: list[dict[str, Value]], shocked: list[dict[str, Value]], limit: float, cases: list[Injection]) -> Part:
    """Bars and tables."""
    inside = [row for row in rows if row["ranges"] == "inside"]
    lost = sum(row["outcome"] == "diverged" for row in inside)
    unsound = sum(not row["finite"] for row in rows)
    injected = judge_cases(cases)
    where = "in colons that move"
    criteria = (
        Criterion(f"runs that diverged inside the ranges, {where}", lost, 0, "runs", "at most"),
        Criterion(f"runs that left something not finite to read, {where}", unsound, 0, "runs", "at most"),
        Criterion(
            f"shocks after which a scope diverged, {where}",
            sum(row["outcome"] == "diverged" for row in shocked),
            0,
            "shocks",
            "at most",
        ),
        Criterion(
            f"largest stable time step over that of the presets, {where}",
            limit / OPTIONS.timestep,
            2.0,
            "1",
            "at least",
        ),
        *(
            Criterion(
                f"{criterion.what}, {where}", criterion.measured, criterion.bound, criterion.unit, criterion.sense
            )
            for criterion in injected.criteria
        ),
    )
    kinds = sorted({(str(row["ranges"]), str(row["outcome"])) for row in rows}, reverse=True)
    table = []
    for ranges, outcome in kinds:
        those = [row for row in rows if (row["ranges"], row["outcome"]) == (ranges, outcome)]
        most = {name: max(float(row[name] or 0.0) for row in those) for name in ("fastest_per_s", "furthest_colon_m")}
        table.append({"ranges": ranges, "outcome": outcome, "runs": len(those), **most})
    return Part(
        criteria,
        (
            Table("Random mesenteries", tuple(table)),
            Table("Shocks in colons that move", tuple(shocked)),
            Table("NaN and Inf in inputs, colons that move", injected.tables[0].rows),
        ),
        summary=_SUMMARY,
        counts={"runs in colons that move": len(rows)},
    )


_TRIED = ", ".join(f"{1e3 * step:g}" for step in STEPS)
_SUMMARY = (
    "Colons that move: an adult scope in grown colon 0 on its mesentery, in linear time. All numbers of the mesentery, "
    "friction and the wall's stiffness by Sobol's sequence, half of the runs inside their ranges and half a tenth "
    "beyond (of the logarithm, none negative); hands change what they do every 0.4 s, to 0.2 m/s. The largest time "
    f"step is that of {_TRIED} ms up to which no such run inside the ranges diverges."
)
