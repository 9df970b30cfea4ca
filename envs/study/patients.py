"""Virtual patients: who is examined, every number drawn from the range that its source gives."""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from haustra.assets import asset, assets
from haustra.children import children
from haustra.envs.study.study import Value, Variable
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import METADATA, load_colon, save_colon
from haustra.models.injury.perforation import Strength, deviation_of, perforation_probability
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.cache import cache_folder
from haustra.models.wall.lumen_table import lumen_table
from haustra.provenance import content_hash
from haustra.quantity import Quantity, load_quantities

_FORMAT = 1
"""Raised when the same patient grows another colon."""
_MESENTERY = {
    "mesentery_sigmoid": "mesentery.height.sigmoid",
    "mesentery_transverse": "mesentery.height.transverse",
    "mesentery_descending": "mesentery.height.descending",
    "mesentery_ascending": "mesentery.height.ascending",
    "mesentery_stiffness": "mesentery.stiffness",
    "attachment": "mesentery.attachment",
    "support": "mesentery.support",
    "modulus": "mesentery.modulus",
    "thickness_sigmoid": "mesentery.thickness.sigmoid",
    "thickness_other": "mesentery.thickness.other",
    "bending": "mesentery.bending",
    "pleating": "mesentery.pleating",
}
"""Variables that are numbers of the mesentery, by their names there."""

_HUNG = {name: f"mesentery.{name}" for name in ("torsion", "drag", "anus", "grip")}
"""Numbers of the mesentery that a study may vary and a cohort leaves as they are: variables, by their names there."""
_AFTERWARDS = ("human_over_porcine", "between_persons")
"""Numbers of injury that act on the largest load of a run after it: names in assets/numbers/injury.toml."""
_WITHIN = {f"strength_{shape}": f"strength.{shape}" for shape in ("straight", "bent", "sideways")} | {
    name: name for name in ("head_diameter", "contact_length", "size_share")
}
"""Those that say which load that is, and so act while it runs: variables, by their names there."""


@cache
def numbers() -> Mapping[str, Quantity]:
    """Every number of assets/numbers, by its name."""
    return {name: each for path in assets("numbers", ".toml").values() for name, each in load_quantities(path).items()}


def clinic_number(name: str) -> float:
    """Value of a number of assets/numbers/clinic.toml, by its name behind 'clinic.'."""
    return float(numbers()[f"clinic.{name}"].value)


@cache
def patient_variables() -> tuple[Variable, ...]:
    """What differs between patients, with bounds and spread, as variables of a study (assets/clinic/patients.toml)."""
    listed = tomllib.loads(asset("clinic/patients.toml").read_text(encoding="utf-8"))
    return tuple(_variable(name, entry) for name, entry in listed.items())


def _variable(name: str, entry: Mapping) -> Variable:
    number = numbers().get(entry.get("number", ""))
    if entry["spread"] == "trait":
        share = number.value if number else 0.5
        return Variable(name, f"patient.{name}", "1", share, 0.0, 1.0, "uniform")
    low, high = entry.get("low", number and number.low), entry.get("high", number and number.high)
    low = max(low, 1e-3 * high) if entry["spread"] == "log-uniform" else low
    unit = number.unit if number else entry["unit"]
    middle = float(f"{(low + high) / 2:.12g}")  # as a study would write it
    return Variable(name, f"patient.{name}", unit, middle, low, high, entry["spread"])


@cache
def injury_variables() -> tuple[Variable, ...]:
    """Numbers of what tears that a study may vary beside patients'; a cohort leaves them as they are."""
    listed = {name: name for name in _AFTERWARDS} | _WITHIN
    known = {name: numbers()[f"injury.{number}"] for name, number in listed.items()}
    return tuple(
        Variable(name, f"injury.{name}", n.unit, n.value, n.low, n.high, "uniform") for name, n in known.items()
    )


@cache
def mesentery_variables() -> tuple[Variable, ...]:
    """Numbers of how a colon moves that a study may vary beside patients'; a cohort leaves them as they are."""
    known = {name: numbers()[number] for name, number in _HUNG.items()}
    return tuple(
        Variable(name, f"mesentery.{name}", n.unit, n.value, n.low, n.high, "log-uniform") for name, n in known.items()
    )


@cache
def left_as_they_are() -> tuple[Variable, ...]:
    """What a study may vary beside what differs between patients."""
    return (*injury_variables(), *mesentery_variables())


@cache
def traits() -> Mapping[str, float]:
    """Share of people who have each trait: a patient has it whose draw from 0 to 1 lies below."""
    return {each.name: each.nominal for each in patient_variables() if each.name in _TRAITS}


def adhesion_share(sex: str) -> float:
    """Share of a sex whose sigmoid has grown to what is beside it [1].

    That of all people is published; women have what hysterectomies leave beside what others have.
    """
    everybody, after = clinic_number("sigmoid_adhesions"), clinic_number("adhesions_after_surgery")
    operated = clinic_number("hysterectomy") * after
    men = max(2 * everybody - operated, 0.0) / (2 - operated)
    return men if sex == "male" else 2 * everybody - men


_TRAITS = ("sex", "coiled", "mobile_descending", "mobile_ascending", "adhesions")


@dataclass(frozen=True)
class Patient:
    """One patient: a colon, what it lies in, and how it is to the touch."""

    values: Mapping[str, float]
    """Value of every variable, by name; traits are draws from 0 to 1."""

    def has(self, trait: str) -> bool:
        """Whether the patient has a trait."""
        share = adhesion_share(self.sex) if trait == "adhesions" else traits()[trait]
        return self.values[trait] < share

    @property
    def sex(self) -> str:
        """Female or male."""
        return "female" if self.has("sex") else "male"

    @property
    def abdomen(self) -> Abdomen:
        """What the colon lies in, on the back, with no hand on the belly."""
        mobile = tuple(name for name in ("descending", "ascending") if self.has(f"mobile_{name}"))
        return Abdomen(mobile=mobile, adhesions=("sigmoid",) if self.has("adhesions") else ())

    @property
    def mesentery(self) -> dict[str, float]:
        """Numbers of the mesentery that are this patient's own, by their names in assets/numbers."""
        return {number: self.values[name] for name, number in (_MESENTERY | _HUNG).items()}

    @property
    def strength(self) -> Strength:
        """What this patient's wall bears, but for how much more people bear than pigs (`torn`)."""
        return Strength.of({number: self.values[name] for name, number in _WITHIN.items()})

    def torn(self, load: float) -> float:
        """Share of people like this patient whose wall is torn by a load over the median person's strength [1]."""
        weaker = injury_variables()[0].nominal / self.values["human_over_porcine"]
        return float(perforation_probability(load * weaker, sigma=deviation_of(self.values["between_persons"])))

    def folder(self) -> Path:
        """Where the colon is kept."""
        key = content_hash(repr((_FORMAT, *self._grown().items())).encode())
        return cache_folder() / "patients" / key

    def colon(self) -> Colon:
        """The colon, grown when it is first asked for.

        Raises:
            InvalidMeshError: when no course was found for the patient's seed.
        """
        folder = self.folder()
        if not (folder / METADATA).is_file():
            grow_patient(folder, self._grown())
        return load_colon(folder)

    def _grown(self) -> dict[str, Value]:
        return {
            "seed": int(self.values["seed"]),
            "sex": self.sex,
            "pressure": round(self.values["gas_pressure"], 3),
            "sigmoid": "coiled" if self.has("coiled") else "omega",
        }

    @classmethod
    def of(cls, values: Mapping[str, float]) -> "Patient":
        """The patient of a job's variables; those that it leaves out are as in the middle of their range."""
        usual = {each.name: each.nominal for each in (*patient_variables(), *left_as_they_are())}
        return cls({**usual, **{name: float(value) for name, value in values.items()}})


def grow_patient(folder: Path, grown: Mapping) -> None:
    """Grow a colon into a folder, which appears at once, and stays where another process has grown it meanwhile."""
    import os
    import shutil

    half = folder.with_name(f".{folder.name}.{os.getpid()}")
    save_colon(grow_colon(**grown), half)
    if not (folder / METADATA).is_file():
        shutil.rmtree(folder, ignore_errors=True)
    try:
        half.rename(folder)
    except OSError:  # another process was first; what it has grown may be read already
        if not (folder / METADATA).is_file():
            raise
        shutil.rmtree(half)


def grow_patients(
    patients: Sequence[Patient],
    radii: Sequence[float],
    *,
    processes: int,
    tell: Callable[[int], None] = lambda done: None,
) -> None:
    """Grow and tabulate colons that are missing, on so many processes; what cannot be grown says so when asked for.

    Args:
        patients: whose colons.
        radii: of the scopes that they are tabulated for [m].
        processes: how many.
        tell: told how many patients are ready.
    """
    missing = [
        one
        for one in patients
        if not (one.folder() / METADATA).is_file() or not all(_marker(one, radius).is_file() for radius in radii)
    ]
    if not missing:
        return
    with children(min(processes, len(missing))) as pool:
        for done, future in enumerate([pool.submit(_made_ready, one, tuple(radii)) for one in missing]):
            future.exception()
            tell(len(patients) - len(missing) + done + 1)


def _made_ready(patient: Patient, radii: Sequence[float]) -> None:
    colon = patient.colon()
    for radius in radii:
        lumen_table(colon, device_radius=radius)
        _marker(patient, radius).touch()


def _marker(patient: Patient, radius: float) -> Path:
    """What stands beside a patient's colon once it is tabulated for scopes of that radius [m]."""
    folder = patient.folder()
    return folder.with_name(f"{folder.name}-{radius:.9g}")
