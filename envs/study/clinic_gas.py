"""Gas of patients whose endoscopist sucks it out and lets it in again."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from haustra.models.anatomy.colon import Colon
from haustra.models.gas.compartments import lumen_volumes, opened_at, pressure_lost, segment_volumes, typical_colon
from haustra.models.gas.numbers import gas_numbers

_PRESSURES = 64
"""At so many the volume of a colon is told."""


class PatientsGas:
    """One pressure for each patient's whole colon, whose segments are open to each other along the shaft.

    Lumens stay as wide as they are: what is narrower than a scope gives way to it.
    """

    def __init__(self, colons: Sequence[Colon]) -> None:
        """Fill each colon to the pressure at which it is as wide as it was given."""
        told = [_told(colon) for colon in colons]
        self._volumes, self._lost = (np.array(each) for each in zip(*told, strict=True))
        self._whole = self._volumes[:, -1]
        self._volume = self._whole.copy()

    @property
    def full(self) -> bool:
        """Whether all have as much gas as at first, so that nothing of it has changed."""
        return bool((self._volume == self._whole).all())

    def __call__(self, sucks: Bool[np.ndarray, " patients"], seconds: float) -> Float[np.ndarray, " patients"]:
        """Let them be sucked at, or let gas in, for some more seconds.

        Returns:
            What `haustra.models.gas.compartments.pressure_lost` says of each colon then [Pa].
        """
        known = gas_numbers()
        volume = self._volume + np.where(sucks, -known["suction"], known["flow"]) * seconds
        self._volume = np.clip(volume, known["closed_share"] * self._whole, self._whole)
        return np.array([np.interp(*each) for each in zip(self._volume, self._volumes, self._lost, strict=True)])


def _told(colon: Colon) -> tuple[Float[np.ndarray, " pressures"], Float[np.ndarray, " pressures"]]:
    """Volumes of a colon at pressures up to the one at which it is as wide as it was given, and what it lost there."""
    full = opened_at(colon)
    person, pressures = typical_colon(segment_volumes(colon), pressure=full), np.linspace(0.0, full, _PRESSURES)
    volumes = lumen_volumes(np, person, pressures[:, None]).sum(axis=-1)
    return volumes, pressure_lost(np, person, pressures[:, None], full=full)
