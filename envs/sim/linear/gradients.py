"""Derivatives of what is read off scopes by what they are made of, by the wall and by the hand, step after step.

They are exact for the time steps that are made: derivatives go with all numbers of the program, through the recursion
that solves the implicit step as through every law (`haustra.envs.sim.linear.dual`). So they are those of the discrete
step, not of what it approximates. Which spheres touch, which stops and limits are reached, whether wires stick and
between which rows of tables a place lies are taken as they are: where a parameter would change one of them, a reading
bends or jumps, and its derivative is that of the side on which the scope is.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.layout import DOF, WORLD
from haustra.envs.sim.scope_reading import read_scope, stack_scopes
from haustra.envs.sim.scope_values import Scope
from haustra.envs.sim.state import Controls, Readings, refuse_others
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import Tables

_OF_WORLD = {"friction": "friction", "wall_stiffness": "stiffness", "shaft_stiffness": "bending"}
_OF_HAND = ("push_rate", "roll_rate", *WIRE_NAMES)
_OF_SPRING = ("stiffness", "damping", "armature")


@dataclass(frozen=True)
class Direction:
    """A direction among parameters: how much each of them changes for 1 along it."""

    friction: float = 0.0
    """Coulomb coefficient between scope and wall [1]."""
    wall_stiffness: float = 0.0
    """Normal stiffness of a contact, whose damping goes with it [N/m]."""
    shaft_stiffness: float = 0.0
    """Bending stiffness of the whole shaft over the design's [1]."""
    joint_stiffness: Float[np.ndarray, " dofs"] | None = None
    """Stiffness of each joint's spring over the design's [1]; what damps it goes with it, as for the whole shaft."""
    push_rate: float = 0.0
    """Speed at which the hand pushes [m/s]."""
    roll_rate: float = 0.0
    """Speed at which the hand turns the shaft [rad/s]."""
    pulls: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Pulls of the wires: up, left, down, right [N]."""
    during: range | None = None
    """Control steps since the reset in which what the hand does changes; all when None."""


class Gradients:
    """Scopes in colons on a CPU, in double precision, with derivatives along some directions."""

    def __init__(
        self,
        scene: Scene,
        tables: Tables,
        *,
        worlds: int,
        directions: Sequence[Direction],
        threads: int = 1,
        scopes: Scope | None = None,
    ) -> None:
        """Compile, or read what was compiled before.

        Args:
            scene: as of `LinearBackend`.
            tables: as of `LinearBackend`.
            worlds: how many.
            directions: along which derivatives are taken, in every world. Each adds to the time that a step takes.
            threads: of the CPU.
            scopes: as of `LinearBackend`.

        Raises:
            InvalidOptionError: when there is no direction, or one has not a number for each joint.
            UnsupportedSceneError: when the scene has what the backend 'linear' cannot honour.
        """
        if not directions:
            raise InvalidOptionError("Derivatives need a direction: give at least one.")
        self.directions = tuple(directions)
        if scopes is None and any(each.joint_stiffness is not None for each in directions):
            scopes = stack_scopes([read_scope(scene, backend=LinearBackend.name)] * worlds)
        self.backend = LinearBackend(
            scene,
            tables,
            worlds=worlds,
            threads=threads,
            real=np.float64,
            scopes=scopes,
            directions=_carried(len(self.directions)),
        )
        self._begin()

    def reset(self, case: Int[np.ndarray, " worlds"], conditions: Conditions) -> None:
        """Lay all scopes straight, in the colons of those numbers; nothing has a derivative but the parameters."""
        self.backend.reset(np.arange(self.backend.worlds), case, conditions)
        self._begin()

    def redesign(self, scopes: Scope) -> None:
        """As `LinearBackend.redesign`; derivatives by stiffness are then by that of the new designs."""
        self.backend.redesign(scopes)

    def step(self, inputs: Controls, count: int) -> Bool[np.ndarray, " worlds"]:
        """As `LinearBackend.step`: a world that diverges keeps its derivatives of before, too."""
        refuse_others(inputs, self.backend.worlds)
        slopes = self.backend.slopes("worlds")
        for number, each in enumerate(self.directions):
            there = each.during is None or self._steps in each.during
            for name, value in zip(_OF_HAND, (each.push_rate, each.roll_rate, *each.pulls), strict=True):
                slopes[:, WORLD.index(name), number] = value if there else 0.0
        self._steps += 1
        return self.backend.step(inputs, count)

    def read(self) -> tuple[Readings, Readings]:
        """What can be read off, and its derivatives, with an axis of directions behind that of worlds."""
        slopes, count = self.backend.read_slopes(), len(self.directions)
        return self.backend.read(), Readings(*(None if each is None else each[:, :count] for each in slopes))

    def rollout(self, script: Iterable[Controls], count: int) -> Iterator[tuple[Readings, Readings]]:
        """What can be read off after each of a script's controls, held for so many time steps, with derivatives."""
        for inputs in script:
            self.step(inputs, count)
            yield self.read()

    def close(self) -> None:
        """End the threads."""
        self.backend.close()

    def _begin(self) -> None:
        """Parameters have their derivatives."""
        self._steps = 0
        worlds = self.backend.slopes("worlds")
        for number, each in enumerate(self.directions):
            for name, slot in _OF_WORLD.items():
                worlds[:, WORLD.index(slot), number] = getattr(each, name)
            if each.joint_stiffness is not None:
                self._stiffen(number, each.joint_stiffness)

    def _stiffen(self, number: int, joints: Any) -> None:
        slopes, values = self.backend.slopes("design"), self.backend.numbers("design")
        own, count = np.asarray(joints, float), self.backend.positions().shape[1]
        if own.shape != (count,):
            raise InvalidOptionError(f"joint_stiffness is of shape {own.shape}: give one number a joint, {count}.")
        for name in _OF_SPRING:
            slots = np.arange(len(own)) * len(DOF) + DOF.index(name)
            slopes[:, slots, number] = own[:, None] * values[:, slots]


def _carried(directions: int) -> int:
    """Directions that a program carries: a power of two, since registers are; those that nobody asked for stay 0.

    Measured on an AMD EPYC: 5 directions, carried as 5, take 1.7 times as long as 8.
    """
    return 1 << (directions - 1).bit_length()
