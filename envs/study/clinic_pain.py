"""For how long, how much and by what patients are hurt at the sites that a clinic asks about."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.study.patients import Patient, clinic_number
from haustra.models.anatomy.colon import Colon
from haustra.models.injury.pain import axis_tensions, pressed_tension

SITES = ("sigmoid", "left", "right")
"""Where patients feel pain: the sigmoid, the left and the right flexure."""
HURTS = ("stretched_wall", "mesentery", "pressed_wall")
"""What hurts: the wall along the colon, the mesentery, and the wall under the scope."""


class PainWatch:
    """Counts, patient by patient, for how long each site hurts by each cause, and how much it hurts in all."""

    def __init__(
        self,
        patients: Sequence[Patient],
        colons: Sequence[Colon],
        own: Any,
        borders: Mapping[str, Float[np.ndarray, " worlds"]],
        *,
        diameter: float,
        lengths: Float[np.ndarray, " links"],
    ) -> None:
        """Get to know the patients.

        Args:
            patients: each world's.
            colons: each world's.
            own: each world's mesentery, as it is without an assistant.
            borders: arc length at which each segment of each colon begins, by its name [m].
            diameter: of the scope [m].
            lengths: of its links [m].
        """
        self._own, self._borders, self._diameter, self._lengths = own, borders, diameter, lengths
        self._arcs = own.spacing[:, None] * np.arange(own.nodes.shape[1])
        radii = [
            np.interp(arc, colon.centreline.arc, np.median(colon.radius, axis=1))
            for arc, colon in zip(self._arcs, colons, strict=True)
        ]
        self._radius = np.array(radii)
        self._wall, self._mesentery = (
            np.array([patient.values[name] for patient in patients])[:, None]
            for name in ("painful_wall", "painful_mesentery")
        )
        self._hurting = np.zeros((len(patients), len(SITES)))
        self._by_cause = np.zeros((len(patients), len(HURTS)))
        self._dose = np.zeros(len(patients))
        self._tension = np.zeros(len(patients))

    def __call__(self, seen: Any, going: Bool[np.ndarray, " worlds"], seconds: float) -> None:
        """Look at those whose examination goes on, some seconds after the last look [s]."""
        along, held = axis_tensions(np, self._own, seen.displacement, self._radius, seen.time)
        self._tension = np.where(going, np.maximum(self._tension, held.max(axis=1)), self._tension)
        forces = np.where(seen.link_arcs > 0, seen.link_forces, 0.0)
        pressed = pressed_tension(forces, self._diameter, self._lengths)
        each = (
            (self._arcs, along / self._wall),
            (self._arcs, held / self._mesentery),
            (seen.link_arcs, pressed / self._wall),
        )
        most = np.zeros((len(going), len(SITES), len(HURTS)))
        for column, site in enumerate(SITES):
            low, high = self._site(site)
            for cause, (places, pain) in enumerate(each):
                inside = (places >= low[:, None]) & (places < high[:, None])
                most[:, column, cause] = np.where(inside, pain, 0.0).max(axis=1)
        self._hurting += seconds * (most.max(axis=2) > 1) * going[:, None]
        self._by_cause += seconds * (most.max(axis=1) > 1) * going[:, None]
        self._dose += seconds * np.maximum(most.max(axis=(1, 2)) - 1, 0.0) * going

    def _site(self, site: str) -> tuple[np.ndarray, np.ndarray]:
        near = clinic_number("flexure_site")
        if site == "sigmoid":
            return self._borders["sigmoid"], self._borders["descending"]
        flexure = self._borders["transverse" if site == "left" else "ascending"]
        return flexure - near, flexure + near

    def scores(self, world: int) -> dict[str, float]:
        """What hurt a patient: each site, for how long each cause, and how much in all."""
        hurts = self._hurting[world] >= clinic_number("pain_lasts")
        return {
            **{f"pain_{site}": float(hurt) for site, hurt in zip(SITES, hurts, strict=True)},
            **{f"pain_{site}_s": float(value) for site, value in zip(SITES, self._hurting[world], strict=True)},
            **{f"pain_{cause}_s": float(value) for cause, value in zip(HURTS, self._by_cause[world], strict=True)},
            "pain_dose_s": float(self._dose[world]),
            "mesentery_peak_N_m": float(self._tension[world]),
        }
