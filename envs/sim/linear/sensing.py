"""What drivers within a program look up: places, wall forces, loads and pain when scopes were last read off."""

from haustra.envs.sim.linear.program import ScopeProgram
from haustra.envs.sim.linear.trace import Value, Variable
from haustra.models.injury.pain import pain, pressed_tension
from haustra.models.injury.patch import force_on_contact
from haustra.models.injury.perforation import Strength, link_load


def tip_arc(scopes: ScopeProgram) -> Value:
    """Arc length of the tip [m]."""
    return scopes.state.load(scopes.layout.arcs + scopes.spheres)


def inserted_length(scopes: ScopeProgram) -> Value:
    """Length past the anus [m]."""
    return scopes.scope("start") + scopes.state.load(0)


def hand_lead(scopes: ScopeProgram) -> Value:
    """How far the hand aims ahead of the shaft [m]."""
    return scopes.state.load(scopes.layout.hand) - scopes.state.load(0)


def largest_force(scopes: ScopeProgram) -> tuple[Value, Value]:
    """Largest resultant of the wall on one link, and on one of the bending section [N]."""
    program = scopes.program
    wall, tip = program.variable(0.0), program.variable(0.0)
    with program.loop(0, scopes.bodies) as body:
        force = scopes.link_force(body)
        wall.value = program.xp.maximum(wall.value, force)
        with program.when(scopes.of_tip(body)):
            tip.value = program.xp.maximum(tip.value, force)
    return wall.value, tip.value


def largest_load(scopes: ScopeProgram) -> tuple[Value, Value]:
    """Largest load of the wall under a link over the median person's strength [1], and arc length there [m]."""
    program, xp = scopes.program, scopes.program.xp
    up, left = scopes.bend()
    bend, diameter = xp.sqrt(up * up + left * left), 2 * scopes.scope("radius")
    most, where = _by_gas(scopes, "load")
    strength = Strength(*(scopes.world(f"wall_{name}") for name in Strength._fields))
    before, length = (program.variable(0.0), program.variable(1.0)), scopes.link_length
    with program.loop(0, scopes.bodies) as body:
        force, own, last = scopes.link_force(body), length(body), body == scopes.bodies - 1
        following = xp.where(last, body, body + 1)
        after = xp.where(last, 0.0, scopes.link_force(following)), length(following)
        shared = force_on_contact(
            xp, force, own, ((before[0].value, before[1].value), after), contact=strength.contact_length
        )
        before[0].value, before[1].value = force, own
        load = link_load(xp, shared, bend, scopes.of_tip(body), diameter, strength)
        where.value = xp.where(load > most.value, xp.maximum(scopes.link_arc(body), 0.0), where.value)
        most.value = xp.maximum(most.value, load)
    return most.value, where.value


def largest_pain(scopes: ScopeProgram) -> tuple[Value, Value]:
    """Largest tension of wall or mesentery over that which hurts [1], and arc length there [m].

    Backends must know how wide colons that move are (`LinearBackend`'s `width`).
    """
    program, xp, diameter = scopes.program, scopes.program.xp, 2 * scopes.scope("radius")
    most, where = _by_gas(scopes, "pain")

    def judge(hurts: Value, arc: Value) -> None:
        where.value = xp.where(hurts > most.value, xp.maximum(arc, 0.0), where.value)
        most.value = xp.maximum(most.value, hurts)

    with program.loop(0, scopes.bodies) as body:
        wall = pressed_tension(scopes.link_force(body), diameter, scopes.link_length(body))
        judge(pain(xp, wall, program.constant(0.0)), scopes.link_arc(body))
    if axis := scopes.axis:
        with program.loop(0, axis.nodes) as node:
            arc = program.real_of(node) * scopes.world("spacing")
            judge(pain(xp, *axis.tensions(node, scopes.station(arc)[1])), arc)
    return most.value, where.value


def _by_gas(scopes: ScopeProgram, what: str) -> tuple[Variable, Variable]:
    """What gas alone does to the wall [1], and arc length there [m]."""
    own = [scopes.world(f"gas_{what}{name}") if scopes.gas else 0.0 for name in ("", "_arc")]
    return scopes.program.variable(own[0]), scopes.program.variable(own[1])
