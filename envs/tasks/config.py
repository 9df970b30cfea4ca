"""What an episode is: who is examined with what, how an action becomes motion, what is paid, and when it ends."""

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from haustra.errors import InvalidOptionError
from haustra.fields import choice, number, read_fields, require_declared, several, span, whole
from haustra.models.anatomy.person import DIFFICULTIES
from haustra.models.devices.scope.library import DESIGN_NAMES
from haustra.models.injury.numbers import injury_number
from haustra.models.scene import SceneOptions

OBSERVATIONS = ("state", "lumen", "depth", "pixels", "dict")
"""What a learner sees: what scope and hand can measure; a few distances as a depth camera gives them; the whole picture
of such a camera; pictures in colour; or the first two (and depth and pictures, when asked for) under names."""

TASKS = ("insertion", "withdrawal")

_LONGEST_MEMORY = 600.0
"""Beyond it a running mean is that of the whole episode [s]."""
MOST_PAID = 1e4
"""Largest weight of a reward's term."""
HELD_OUT_SEEDS = 100_000
"""Colons with seeds from here on are for evaluation only: no shipped training draws them."""


@dataclass(frozen=True)
class Weights:
    """Weights of the reward's terms (`haustra.envs.tasks.rewards`)."""

    progress: float = number("1", 0.0, MOST_PAID, default=100.0)
    """Reward for the whole colon, paid in proportion to the share newly reached [1]."""
    advance: float = number("1", 0.0, MOST_PAID, default=0.0)
    """Reward for the whole colon, in proportion to where the tip is, and taken back for what is lost [1]."""
    facing: float = number("1", 0.0, MOST_PAID, default=0.0)
    """Cost of each control step in which the tip looks back along the way [1]; half of it when it looks aside."""
    reached: float = number("1", 0.0, MOST_PAID, default=20.0)
    """Reward paid once, in the caecum, or at the anus in withdrawal [1]."""
    time: float = number("1", 0.0, MOST_PAID, default=0.01)
    """Cost of each control step [1]."""
    wall_force: float = number("1", 0.0, MOST_PAID, default=0.02)
    """Cost of a control step, times the square of the largest wall force over `Limits.safe_force` [1]."""
    looping: float = number("1/m", 0.0, MOST_PAID, default=0.0)
    """Cost of a control step for each metre of scope inside beyond the colon passed [1/m]."""
    perforation: float = number("1", 0.0, MOST_PAID, default=20.0)
    """Cost of a perforation, paid once [1]."""
    coverage: float = number("1", 0.0, MOST_PAID, default=0.0)
    """Reward for seeing the whole surface, in proportion to the share newly seen [1]; 100 in withdrawal."""
    haste: float = number("1", 0.0, MOST_PAID, default=0.0)
    """Cost of a control step, times the share of the way that the tip has come sooner than `Limits.pace` [1]."""


@dataclass(frozen=True)
class Limits:
    """When an episode ends, and what counts as safe."""

    seconds: float = number("s", 0.002, 36_000.0, default=90.0)
    """Longest episode [s]; then it is truncated."""
    perforation_force: float = number("N", 0.01, 1e4, default=injury_number("strength.bent"))
    """Resultant wall force on one link that ends an episode as a perforation [N]: the highest measured, since a link
    of the model gathers the load of 6 cm of scope. A rule; how likely the wall is torn is told beside it."""
    safe_force: float = number("N", 0.01, 1e4, default=injury_number("strength.straight"))
    """Peak wall force up to which an episode counts as safe [N]: the lowest force that perforated."""
    pace: float = number("s", 1.0, 36_000.0, default=360.0)
    """Time that the whole way takes without haste [s]: six minutes, the least that guidelines ask of a withdrawal
    (Rex 2015, Gastrointest Endosc 81:31, from memory)."""
    caecum_margin: float = number("m", 0.0, 0.5, default=0.03)
    """The caecum counts as reached this far before the end of the centreline [m], as in a single run."""


@dataclass(frozen=True)
class Randomisation:
    """Ranges that each episode draws from, evenly."""

    friction: tuple[float, float] = span("1", 0.0, 2.0, default=(0.03, 0.1))
    """Range of Coulomb's coefficient between scope and wall [1]."""
    wall_stiffness: tuple[float, float] = span("N/m", 50.0, 1e5, default=(700.0, 2400.0))
    """Range of the stiffness of a contact with the wall [N/m]: as measured."""
    shaft_stiffness: tuple[float, float] = span("1", 0.05, 20.0, default=(0.85, 1.15))
    """Range of the shaft's stiffness over the design's [1]; engineering choice."""
    wire_gain: tuple[float, float] = span("1", 0.05, 1.0, default=(0.85, 1.0))
    """Range of the pull that arrives over the pull asked for [1]; engineering choice."""
    wire_slack: tuple[float, float] = span("1", 0.0, 0.9, default=(0.0, 0.05))
    """Range of the share of a wheel's travel that does nothing [1]; engineering choice."""
    start_roll: tuple[float, float] = span("rad", -2 * math.pi, 2 * math.pi, default=(-3.14159, 3.14159))
    """Range of the angle of the colon about its entry, as the scope sees it at the start [rad]."""


@dataclass(frozen=True)
class Drive:
    """How actions, each from -1 to 1, become motion."""

    control_interval: float = number("s", 0.002, 1.0, default=0.04)
    """Time between two actions [s]: 25 Hz. A whole number of the steps that physics takes, `SceneOptions.timestep`."""
    push_rate: float = number("m/s", 0.001, 0.5, default=0.06)
    """Speed of the hand along the scope at full action [m/s]; engineering choice."""
    roll_rate: float = number("rad/s", 0.01, 20.0, default=1.57)
    """Rate at which the hand rolls the scope at full action [rad/s]; engineering choice."""
    wheel_rate: float = number("1/s", 0.05, 100.0, default=4.0)
    """Largest change of a tip action in a second [1/s]: a wheel goes from neutral to full in a quarter second."""
    hand_lead: float = number("m", 1e-4, 0.1, default=0.01)
    """Largest distance that the hand aims ahead of where the shaft is [m]: it then presses with 40 N."""


@dataclass(frozen=True)
class TaskConfig:
    """An episode's rules. Everything here is a plain value: JSON in, JSON out."""

    task: str = choice(*TASKS, default="insertion")
    """What is to be done: insertion as far as the caecum, or withdrawal from there to the anus."""
    design: str = choice(*DESIGN_NAMES, default="paediatric")
    """Name of a shipped scope design."""
    difficulty: str = choice(*DIFFICULTIES, default="any")
    """Band of tortuosity that colons are drawn from."""
    seeds: tuple[int, int] = span("1", 0, 10**9, default=(0, 16), whole=True)
    """Seeds of the grown colons: from the first up to, not including, the last."""
    mesentery: bool = False
    """Let colons swing, stretch and pleat on their mesentery instead of standing fixed."""
    gas: float | None = number("Pa", 500.0, 8000.0, default=None)
    """Set point of insufflation [Pa], up to which the scope lets gas in at its tip (`SceneOptions.gas`); no gas when
    None. On `linear` only; no camera sees colons that gas holds open."""
    gas_flow: float = number("m^3/s", 0.0, 1e-4, default=SceneOptions.gas_flow)
    """Flow of the gas that insufflation lets in [m^3/s]."""
    gas_start: float = number("Pa", 300.0, 8000.0, default=SceneOptions.gas_start)
    """Gas pressure that the colon is filled to at the start of an episode [Pa]."""
    water: float = number("m^3", 0.0, 2e-3, default=0.0)
    """Water in rectum and sigmoid at the start of an episode, in place of gas [m^3] (`SceneOptions.water`); colons that
    take less are refused. With gas only."""
    gas_action: bool = False
    """Let the learner let gas in and suck it out instead of the insufflator, by a fifth action over `gas_flow`, and
    show it under the name 'gas' the pressure at the tip, the colon's gas and what it last asked for; `memory` leaves
    these out. With gas only."""
    bleeding: bool = False
    """Keep account of where the wall bleeds, at the end of each action: sheared, and under `gas_action` sucked at by a
    share of the suction of a drive as large as what it asks for. Told with each step, seen in no picture."""
    observation: str = choice(*OBSERVATIONS, default="dict")
    """What the learner sees: readings of scope and hand (state), a few distances (lumen), a depth camera's picture
    (depth), one in colour (pixels), or state and lumen under names (dict)."""
    privileged: bool = False
    """Add what no device knows: arc length, the way ahead, the wall's place. For teachers and baselines."""
    imager: bool = False
    """Add what a magnetic imager of the scope's shape gives: where tip and shaft are, and how fast the tip moves.
    It has no noise here; a real one has some millimetres."""
    memory: tuple[float, ...] = several("s", 0.01, _LONGEST_MEMORY, default=(), most=8)
    """Also show how all that is measured differs from its running means over these times [s]. A policy without
    memory of its own cannot tell else that it has stood still for a while."""
    picture_size: int = whole(8, 512, default=64)
    """Rows and columns of pictures [pixels]."""
    stool: float = number("1", 0.0, 1.0, default=0.0)
    """Share of the lower wall that pictures in colour show under stool [1]."""
    mucus: float = number("1", 0.0, 1.0, default=0.0)
    """Share of the wall that pictures in colour show under mucus [1]."""
    depth: bool = False
    """Add the tip camera's depth to the observation 'dict'."""
    pictures: bool = False
    """Add the tip camera's pictures in colour to the observation 'dict'."""
    drive: Drive = field(default_factory=Drive)
    limits: Limits = field(default_factory=Limits)
    randomisation: Randomisation = field(default_factory=Randomisation)
    weights: Weights = field(default_factory=Weights)

    def __post_init__(self) -> None:
        require_declared(self)
        if self.seeds[0] == self.seeds[1]:
            raise InvalidOptionError(f"seeds {self.seeds} hold no colon: give a first and a larger last one.")
        if self.water and self.gas is None:
            raise InvalidOptionError("Water takes the place of gas: give a set point `gas` too, or leave water out.")
        if self.gas_action and self.gas is None:
            raise InvalidOptionError("gas_action lets gas in and out, of which there is none: give a set point `gas`.")

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "TaskConfig":
        """Read what `to_json` wrote.

        Raises:
            InvalidOptionError: naming a value that is not known or out of its range.
        """
        return read_fields(cls, values)
