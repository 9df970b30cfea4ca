"""The stored force tables of the finite-element reference, and the pad law that a fast model takes from them."""

import csv
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.errors import InvalidDesignError
from haustra.models.devices.tracked.tread import TreadGeometry

HARMONICS = 3
"""Harmonics of the tooth-passing frequency that a pad's law keeps: the fourth is below 1 % of the mean force."""

_SAME_LENGTH = 1e-3
"""Relative difference up to which a design's tread counts as the tread of a table."""


@dataclass(frozen=True)
class TreadTable:
    """Force and stress of one strut tip under a long tread, from the finite-element reference."""

    geometry: TreadGeometry
    phases: Float[np.ndarray, " phases"]
    """Position of the tip in a pitch; 0 under a tooth's centre."""
    indentations: Float[np.ndarray, " indentations"]
    """[m]."""
    forces: Float[np.ndarray, "phases indentations"]
    """Normal force between teeth and tissue [N]."""
    stresses: Float[np.ndarray, "phases indentations"]
    """Mean von Mises stress of the belt above the tip [Pa]."""
    scale: float = 1.0
    """Size over the table's own."""


def load_table(tread: TreadGeometry) -> TreadTable:
    """The shipped table for a tread, scaled with it: same stress, forces with the square of length.

    The tip spacing does not matter: a table is of one tip.

    Raises:
        InvalidDesignError: when no table was solved for this shape of tread.
    """
    return _read(*_solved_for(tread))


def load_law(tread: TreadGeometry) -> "PadLaw":
    """The law of that table.

    Raises:
        InvalidDesignError: when no table was solved for this shape of tread.
    """
    return _fitted(*_solved_for(tread))


def _solved_for(tread: TreadGeometry) -> tuple[str, float]:
    """Name of the tread's table, and its size over the table's."""
    known, others = [], []
    for table, entry in _index().items():
        lengths = {name: value for name, value in entry["geometry"].items() if name != "tip_spacing"}
        scales = {name: getattr(tread, name) / value for name, value in lengths.items()}
        usual = float(np.median(list(scales.values())))
        off = [name for name, scale in scales.items() if abs(scale / usual - 1) >= _SAME_LENGTH]
        if not off:
            return table, usual
        others.append(off)
        known.append(f"pitch {entry['geometry']['pitch'] * 1e3:.3g} mm")
    unlike = ", ".join(f"{name} {getattr(tread, name) * 1e3:.3g} mm" for name in min(others, key=len))
    raise InvalidDesignError(
        f"No force table for a tread of pitch {tread.pitch * 1e3:.3g} mm with {unlike}. Solved so far: "
        f"{', '.join(known)}; solve another with `haustra tread fem`."
    )


@lru_cache(maxsize=1)
def _index() -> dict[str, dict]:
    """What tables there are. A study of many designs asks for each of them."""
    return tomllib.loads(asset("tracked/tables.toml").read_text(encoding="utf-8"))


@lru_cache(maxsize=64)
def _read(table: str, scale: float) -> TreadTable:
    entry = _index()[table]
    with asset(f"tracked/{entry['file']}").open(encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    phases = np.unique([row["phase"] for row in rows])
    indentations = np.unique([row["indentation_mm"] for row in rows])
    shape = (len(phases), len(indentations))
    rows.sort(key=lambda row: (row["phase"], row["indentation_mm"]))
    geometry = TreadGeometry(**{name: value * scale for name, value in entry["geometry"].items()})
    arrays = {
        "phases": phases,
        "indentations": indentations * 1e-3 * scale,
        "forces": np.reshape([row["contact_N"] for row in rows], shape) * scale**2,
        "stresses": np.reshape([row["stress_rear_kPa"] for row in rows], shape) * 1e3,
    }
    for array in arrays.values():
        array.flags.writeable = False  # all who ask share them
    return TreadTable(geometry=geometry, scale=scale, **arrays)


@lru_cache(maxsize=64)
def _fitted(table: str, scale: float) -> "PadLaw":
    return PadLaw.fit(_read(table, scale))


@dataclass(frozen=True)
class PadLaw:
    """N(delta, phase) = (k1 delta + k2 delta^2 + k3 delta^3) (1 + sum a_n cos 2 pi n phase + b_n sin 2 pi n phase).

    All k are positive or zero, so the law stays stable beyond the table.
    """

    stiffness: tuple[float, float, float]
    """k1 [N/m], k2 [N/m^2], k3 [N/m^3]."""
    cosines: Float[np.ndarray, " harmonics"]
    """a_n."""
    sines: Float[np.ndarray, " harmonics"]
    """b_n."""
    largest: float
    """Deepest indentation of the table [m]; beyond it the law is an extrapolation."""
    mean_error: float
    """RMS error of the mean force over the table, relative to its RMS."""
    error: float
    """RMS error of the force over the whole table, likewise: what taking force and phase apart costs."""

    @classmethod
    def fit(cls, table: TreadTable) -> "PadLaw":
        """Least squares on a table: positive cubic for the mean over phases, then harmonics of the ratio to it."""
        from scipy.optimize import nnls

        mean = table.forces.mean(0)
        size = table.indentations[-1]
        powers = np.stack([(table.indentations / size) ** n for n in (1, 2, 3)], 1)
        scaled, _ = nnls(powers, mean)
        k1, k2, k3 = (float(value / size**n) for n, value in enumerate(scaled, 1))
        angles = 2 * np.pi * table.phases[:, None] * np.arange(1, HARMONICS + 1)
        ratio = (table.forces @ mean) / (mean @ mean)
        cosines = 2 * (ratio[:, None] * np.cos(angles)).mean(0)
        sines = 2 * (ratio[:, None] * np.sin(angles)).mean(0)
        shape = 1 + np.cos(angles) @ cosines + np.sin(angles) @ sines
        fitted = powers @ scaled
        return cls(
            stiffness=(k1, k2, k3),
            cosines=cosines,
            sines=sines,
            largest=float(size),
            mean_error=_relative_rms(fitted - mean, mean),
            error=_relative_rms(shape[:, None] * fitted - table.forces, table.forces),
        )

    def behind(self, contact_stiffness: float) -> tuple[float, float, float]:
        """k1, k2, k3 of a spring that gives this law's mean force in series with a contact of that stiffness [N/m].

        Raises:
            InvalidDesignError: when the contact alone is softer than the law.
        """
        from scipy.optimize import nnls

        pressed = np.linspace(0.02, 1.0, 50) * self.largest
        force = np.asarray(self.mean_force(pressed))
        left = pressed - force / contact_stiffness
        if left.min() <= 0:
            raise InvalidDesignError(
                f"A contact of {contact_stiffness:.3g} N/m is softer than the tread on the tissue: raise it."
            )
        scaled, _ = nnls(np.stack([(left / left[-1]) ** n for n in (1, 2, 3)], 1), force)
        k1, k2, k3 = (float(value / left[-1] ** n) for n, value in enumerate(scaled, 1))
        return k1, k2, k3

    def mean_force(self, indentation: Float[np.ndarray, "*n"] | float) -> Float[np.ndarray, "*n"] | float:
        """Force averaged over a pitch [N]."""
        k1, k2, k3 = self.stiffness
        return indentation * (k1 + indentation * (k2 + indentation * k3))

    def phase_factor(self, phase: Any, *, xp: ModuleType = np) -> Any:
        """Force at a tooth phase (...) over the mean; the phase is in pitches and may run on."""
        angles = 2 * np.pi * xp.asarray(phase)[..., None] * np.arange(1, HARMONICS + 1)
        return 1 + xp.cos(angles) @ self.cosines + xp.sin(angles) @ self.sines

    def indentation(self, force: float) -> float:
        """Indentation that gives a mean force [m].

        Raises:
            InvalidDesignError: when the force is not positive and finite.
        """
        if not 0 < force < 1e6:
            raise InvalidDesignError(f"A tip cannot press with {force} N: give a positive force.")
        k1, k2, k3 = self.stiffness
        roots = np.roots([k3, k2, k1, -force])
        return float(min(root.real for root in roots if abs(root.imag) < 1e-9 * abs(root) and root.real > 0))


def track_ripple(law: PadLaw, spacing_in_pitches: float) -> Float[np.ndarray, " harmonics"]:
    """Amplitude of each harmonic of a track's normal force over its mean, two tips apart by a spacing.

    Tips superpose: harmonic n of the sum is that of one tip times |cos(pi n spacing)|. At half-odd spacings all odd
    harmonics cancel.
    """
    order = np.arange(1, HARMONICS + 1)
    return np.hypot(law.cosines, law.sines) * np.abs(np.cos(np.pi * order * spacing_in_pitches))


def device_ripple(law: PadLaw, spacing_in_pitches: float, starts: int, tracks: int = 4) -> Float[np.ndarray, " h"]:
    """Amplitude of each harmonic over the mean, of the sum of tracks out of phase by starts x azimuth / 360 degrees.

    Harmonic n of the sum survives only where n x starts is a multiple of the number of tracks.
    """
    order = np.arange(1, HARMONICS + 1)
    return track_ripple(law, spacing_in_pitches) * (order * starts % tracks == 0)


def _relative_rms(error: np.ndarray, reference: np.ndarray) -> float:
    return float(np.sqrt((error**2).mean() / (reference**2).mean()))
