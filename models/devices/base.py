"""A device behind one interface: what it adds to a scene, what moves it, what it tells, and how it drives itself.

A kind of device is a folder of `haustra.models.devices` with a module `interface`, whose `DEVICE` is a final class of
`Device`. A design is a TOML file: it names its `kind`, and every other key is a declared field with unit and range. No
code is loaded but what is installed. `control`, `read` and `drive` are functions of arrays of numpy or JAX with worlds
first, so that one device runs on every backend.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.assets import assets
from haustra.errors import InvalidDesignError
from haustra.fields import read_fields, require_declared, shown
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.planes import Sample
from haustra.reading import read_document


@dataclass(frozen=True)
class Channel:
    """One control: an actuator of MuJoCo, so that stock MuJoCo repeats a run from the scene and its controls."""

    name: str
    unit: str
    low: float
    high: float
    actuator: str
    """Name of the actuator whose control it is; a wrench is six motors (`add_wrench`)."""


@dataclass(frozen=True)
class Reading:
    """A quantity of this kind of device, beside those that all have."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Pose:
    """Where a device begins: at the anus, or where it stands."""

    position: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    """Place where the device begins [m]."""
    frame: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))
    """Columns: two normals and the direction into the patient."""
    arc: float = 0.0
    """Its arc length from the anus, for a device that begins further in [m]."""


@dataclass(frozen=True)
class Handles:
    """Names of what a device added to a scene."""

    bodies: tuple[str, ...]
    """Bodies that meet the wall: wall forces are summed over each."""
    samples: tuple[Sample, ...]
    """Spheres that meet the wall."""
    geoms: tuple[str, ...]
    """Geoms that would meet a wall of pieces; without contact where the wall is a table."""
    tip: str
    """Site at the nose, its z axis forwards."""
    start: float
    """Distance of the tip from the anus at first [m]."""
    trail: tuple[str, float] | None = None
    """Site that a tether hangs on, and the tether's radius, for pictures [m]; None without one."""
    patches: Mapping[str, float] = field(default_factory=dict)
    """Diameter of the round patch of wall that a body presses on, by its name, where that is not as wide and as long as
    its spheres lie [m]."""


class State(NamedTuple):
    """What a device may look at, worlds first; arrays of numpy or JAX."""

    qpos: Any
    """(worlds, positions) generalised positions [m, rad]."""
    qvel: Any
    """(worlds, dofs) generalised velocities [m/s, rad/s]."""
    act: Any
    """(worlds, activations) of actuators that have a state."""
    tip_frame: Any
    """(worlds, 3, 3) columns are the tip site's axes."""
    tip_arc: Any
    """(worlds,) arc length of the centreline next to the tip [m]."""
    actuator_force: Any
    """(worlds, actuators) [N, N m]."""
    pressed: Any = None
    """(worlds, spheres) normal force of the wall in the last step [N]; for devices with treads."""
    rubbed: Any = None
    """(worlds, spheres, 3) friction of the wall then, in the scene's axes [N]; for devices with treads."""
    friction: Any = None
    """(worlds, spheres) Coulomb's coefficient of the wall [1]; for devices with treads."""
    bends: Any = None
    """(worlds, `BENDS`) angle that the lumen's axis has turned through between the anus and places evenly spaced from
    there to the tip [rad]: what is trailed is wrapped round so much (`haustra.models.devices.tether`)."""


class Treads(NamedTuple):
    """How the surface of a device runs over its body, worlds first."""

    speed: Any
    """(worlds, spheres, 3) of the surface against its body, in the body's axes [m/s]."""
    grip: Any
    """(worlds, spheres) share of the friction that is left [1]."""
    power: Any
    """(worlds,) what drives the treads [W]: no actuator that has a force does."""


class DeviceReadings(NamedTuple):
    """What every device can be told by, worlds first, in the coordinates of the scene."""

    time: Any
    """(worlds,) simulated time [s]."""
    tip: Any
    """(worlds, 3) position of the tip [m]."""
    tip_frame: Any
    """(worlds, 3, 3) columns are the tip site's axes; the last looks forwards."""
    tip_arc: Any
    """(worlds,) arc length of the centreline next to the tip [m]."""
    ahead: Any
    """(worlds, 3) unit vector from the tip to the lumen's axis `LOOK_AHEAD` further on."""
    wall_force: Any
    """(worlds,) largest resultant normal force of the wall on one body [N]."""
    deepest: Any
    """(worlds,) how deep the device's surface stands in the wall at rest [m]; negative for room."""


BENDS = 65
"""Places from anus to tip at which bends are summed up: 2 cm apart in a colon of 1.3 m, so that what is narrower than a
lumen is wide does not count as a bend; engineering choice."""

LOOK_AHEAD = 0.03
"""How far along the lumen's axis `DeviceReadings.ahead` looks [m]; engineering choice: a bend's radius."""


VIEW_DEG = 140.0
"""Full viewing angle of a camera of which a design says nothing [degrees]; engineering choice, as of shipped
scopes."""


@dataclass(frozen=True, kw_only=True)
class Device(ABC):
    """A design of some kind. Numbers are declared by `haustra.fields.number`, so that each has a unit and a range."""

    kind: ClassVar[str]
    """Name of its folder."""
    left_out: ClassVar[Mapping[str, str]] = {}
    """What its model does not hold, and why."""
    has_treads: ClassVar[bool] = False
    """Its surface runs (`treads`): it is controlled every few time steps and told what the wall does to its spheres."""
    is_shaft: ClassVar[bool] = False
    """Its spheres follow each other on one shaft, from its end to its tip: a colon that moves is drawn to it between
    them too (`haustra.models.wall.threads`)."""

    name: str
    """Name of the device, for people."""

    def __post_init__(self) -> None:
        require_declared(self, f"Device {shown(self.name)}", error=InvalidDesignError)

    @classmethod
    def from_toml(cls, table: Mapping[str, Any], where: str) -> "Device":
        """A design from a parsed file without its `kind`.

        Raises:
            InvalidDesignError: when a key is unknown or missing, or a value is out of its range.
        """
        return read_fields(cls, table, where, error=InvalidDesignError)

    @classmethod
    def named(cls, name: str) -> "Device | None":
        """A shipped design that is made of numbers elsewhere and has no file; None when there is none."""
        return None

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names that `named` knows."""
        return ()

    @property
    @abstractmethod
    def controls(self) -> tuple[Channel, ...]:
        """What moves it."""

    @property
    def in_patient_axes(self) -> bool:
        """Whether what moves it is told in the scene's axes, as a magnet outside is; nobody who sees by its tip can."""
        return False

    @property
    def view_deg(self) -> float:
        """Full viewing angle of the camera at its tip [degrees]."""
        return VIEW_DEG

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What it tells beside what all devices tell: what `read` returns."""
        return ()

    @abstractmethod
    def add_to(self, spec: mujoco.MjSpec, pose: Pose, *, timestep: float, start: float) -> Handles:
        """Put it into a scene.

        Args:
            spec: the scene.
            pose: the anus and the way in.
            timestep: that the scene is stepped with [s].
            start: distance of the tip from the anus [m].
        """

    def control(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Any:
        """Controls (worlds, actuators) of MuJoCo for commands (worlds, channels), held for one control interval.

        Commands are cut off at the channels' limits. A device with actuators that are no channel, such as those that
        hold what is outside the patient, extends this.
        """
        channels = self.controls
        low, high = np.array([one.low for one in channels]), np.array([one.high for one in channels])
        columns = [model.actuator(one.actuator).id for one in channels]
        return put(xp, xp.zeros((len(commands), model.nu), commands.dtype), columns, xp.clip(commands, low, high))

    @property
    def usual(self) -> Mapping[str, Any]:
        """Scene options that suit it, by name, where nobody says otherwise."""
        return {}

    def standing(self, colon: Colon, start: float) -> Pose | None:
        """Where it stands in a colon with its tip at arc length `start` [m]; None for what enters at the anus.

        Raises:
            InvalidDesignError: when it does not fit there.
            InvalidOptionError: when the arc length is not inside the colon.
        """
        return None

    def nearest_start(self, colon: Colon, start: float) -> float:
        """Arc length next to `start` [m] where its tip may begin in a colon; there itself for what enters at the anus.

        Raises:
            InvalidDesignError: when it fits nowhere.
        """
        return start

    def treads(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State, commands: Any) -> Treads:
        """How its surface runs under commands (worlds, channels); asked of devices that have treads."""
        raise NotImplementedError

    def read(self, xp: ModuleType, model: mujoco.MjModel, handles: Handles, state: State) -> dict[str, Any]:
        """Each of `readings`, (worlds,)."""
        return {}

    @abstractmethod
    def drive(self, xp: ModuleType, seen: DeviceReadings, memory: Any) -> tuple[Any, Any]:
        """What a simple driver commands (worlds, channels), and what it remembers (worlds,); zero at first."""

    def describe(self) -> dict[str, Any]:
        """The design as plain JSON values, for provenance."""
        from dataclasses import asdict

        return {"kind": self.kind, **asdict(self)}


def put(xp: ModuleType, array: Any, columns: Any, values: Any) -> Any:
    """An array with some of its columns replaced, in numpy or JAX."""
    if xp is np:
        array[:, columns] = values
        return array
    return array.at[:, np.asarray(columns)].set(values)


def add_wrench(spec: mujoco.MjSpec, site: str, names: tuple[str, ...], *, frame: str) -> None:
    """Six motors at a site, force along and torque about three axes: the site's own, or the patient's.

    Args:
        spec: the scene; for the patient's axes it gets a site at the world's origin.
        site: where the wrench acts.
        names: of the six motors: forces along x, y, z, torques about x, y, z.
        frame: 'own' or 'patient'.
    """
    patient = f"{site}_patient"
    if frame == "patient":
        spec.worldbody.add_site(name=patient, group=5)
    for axis, name in enumerate(names):
        motor = spec.add_actuator(name=name, trntype=mujoco.mjtTrn.mjTRN_SITE, target=site)
        motor.set_to_motor()
        motor.gear = np.eye(6)[axis]
        if frame == "patient":
            motor.refsite = patient


def kinds() -> tuple[str, ...]:
    """Kinds of devices: the folders beside this file that hold an interface."""
    return tuple(sorted(path.parent.name for path in Path(__file__).parent.glob("*/interface.py")))


def shipped_devices() -> tuple[str, ...]:
    """Names of all designs that ship."""
    return (*(name for kind in kinds() for name in device_class(kind).names()), *assets("devices", ".toml"))


def load_device(name: str | Path) -> Device:
    """A shipped design by its name, or one from a file that ends in .toml; a file without a `kind` is a scope.

    Raises:
        InvalidDesignError: when there is no such design or kind, or a value is impossible.
        UnreadableFileError: when the file cannot be read.
    """
    if not str(name).endswith(".toml"):
        for kind in kinds():
            if found := device_class(kind).named(str(name)):
                return found
    files = assets("devices", ".toml")
    if not str(name).endswith(".toml") and name not in files:
        raise InvalidDesignError(
            f"Device '{name}' is not known. Known: {', '.join(shipped_devices())}; or name a file that ends in .toml."
        )
    path = files.get(str(name), Path(name))
    table = read_document(path, "device")
    kind = table.pop("kind", "scope")
    if kind not in kinds():
        raise InvalidDesignError(f"{path.name}: kind {shown(kind)} is not known. Known: {', '.join(kinds())}.")
    return device_class(kind).from_toml(table, path.name)


def device_class(kind: str) -> type[Device]:
    """The class of a kind of device (`kinds`)."""
    return import_module(f"haustra.models.devices.{kind}.interface").DEVICE
