"""Which strut spacing, pitch and worm starts ripple least at the same mean force."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from haustra.errors import InvalidDesignError
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign, Worm
from haustra.models.devices.tracked.law import PadLaw, device_ripple, load_table, track_ripple


@dataclass(frozen=True)
class Candidate:
    """A tread drive and its ripple at the design's mean force."""

    starts: int
    """Worm starts; the pitch is the lead over it."""
    pitch: float
    """[m]."""
    spacing: float
    """Tip spacing [pitches]."""
    indentation: float
    """Indentation that gives each tip its share of the bellows' preload [m]."""
    track_ripple: float
    """Root of the sum of squared harmonic amplitudes of a track's force over its mean."""
    device_ripple: float
    """Root of the sum of squared harmonic amplitudes of four tracks' summed force over its mean."""


def candidates(
    design: TrackedDesign, spacings: Sequence[float], starts: Sequence[int] = (1, 2, 3, 4)
) -> list[Candidate]:
    """Every combination whose tread has a stored force table, in the given order.

    Tooth width stays half a pitch, heights and belt stay, so does the lead and with it the speed.
    """
    found: list[Candidate] = []
    for count in starts:
        pitch = design.worm.lead / count
        tread = replace(design.tread, pitch=pitch, tooth_width=pitch / 2)
        try:
            law = PadLaw.fit(load_table(tread))
        except InvalidDesignError:
            continue
        indentation = law.indentation(design.bellows.preload / 2)
        for spacing in spacings:
            found.append(
                Candidate(
                    starts=count,
                    pitch=pitch,
                    spacing=float(spacing),
                    indentation=indentation,
                    track_ripple=_size(track_ripple(law, spacing)),
                    device_ripple=_size(device_ripple(law, spacing, count, TRACKS)),
                )
            )
    return found


def redesigned(design: TrackedDesign, choice: Candidate) -> TrackedDesign:
    """The design with a candidate's worm, pitch and spacing."""
    tread = replace(
        design.tread, pitch=choice.pitch, tooth_width=choice.pitch / 2, tip_spacing=choice.spacing * choice.pitch
    )
    worm: Worm = replace(design.worm, starts=choice.starts)
    return replace(design, name=f"{design.name}, {choice.starts} starts", tread=tread, worm=worm)


def _size(amplitudes: np.ndarray) -> float:
    return float(np.sqrt((amplitudes**2).sum()))
