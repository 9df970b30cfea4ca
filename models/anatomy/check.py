"""What a user must know about a colon before relying on it: a table of verdicts."""

from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.mesh_colon import LONGEST, SHORTEST
from haustra.models.anatomy.passage import Narrow, Passage, narrow_places, passage_of
from haustra.models.anatomy.rays import LumenRays
from haustra.models.anatomy.repair import genus, is_watertight, signed_volume
from haustra.models.anatomy.section import effective_diameter
from haustra.models.anatomy.self_contact import Contact, self_contacts

DEVICE_DIAMETER = 0.0128
"""Diameter of the device when none is named [m]: an adult colonoscope's."""
USUAL_VOLUME = (0.3e-3, 5e-3)
"""Volume of a colon [m^3]: from not inflated (0.65 L in EdinGCA_3D_00090) to more than the largest open one (4 L)."""
USUAL_DIAMETER = (0.015, 0.09)
"""Mean diameter of a segment [m]: from collapsed to the upper normal of a caecum."""

State = Literal["good", "note", "bad"]


@dataclass(frozen=True)
class Verdict:
    """One line of the table."""

    what: str
    """What was looked at."""
    state: State
    """good; note: usable, read it; bad: repair it first."""
    finding: str
    """What was found, with its unit."""


@dataclass(frozen=True)
class Check:
    """Everything that was found about a colon."""

    verdicts: tuple[Verdict, ...]
    passage: Passage
    """The largest ball at each station."""
    narrow: tuple[Narrow, ...]
    """Where the device cannot pass."""
    contacts: tuple[Contact, ...]
    """Where loops touch."""
    device_diameter: float
    """Diameter that was asked for [m]."""

    @property
    def state(self) -> State:
        """The worst of the table."""
        states = [verdict.state for verdict in self.verdicts]
        return "bad" if "bad" in states else "note" if "note" in states else "good"

    def to_json(self) -> dict:
        """As JSON values, SI units."""
        return {
            "state": self.state,
            "verdicts": [asdict(verdict) for verdict in self.verdicts],
            "device_diameter_m": self.device_diameter,
            "smallest_passage_m": float(self.passage.diameter.min()),
            "narrow_places": [asdict(place) for place in self.narrow],
            "self_contacts": [asdict(contact) for contact in self.contacts],
        }


def check_colon(colon: Colon, *, device_diameter: float = DEVICE_DIAMETER) -> Check:
    """Look at surface, scale, centreline, passage and contacts of a colon.

    Args:
        colon: What to look at.
        device_diameter: Diameter of the device that is to pass [m].
    """
    passage = passage_of(colon)
    narrow = narrow_places(colon, passage, device_diameter)
    contacts = self_contacts(colon)
    verdicts = (
        *_surface(colon),
        *_scale(colon),
        _centreline(colon),
        _passage(passage, narrow, device_diameter),
        _by_segment(colon, passage, device_diameter),
        _contacts(contacts),
    )
    return Check(verdicts, passage, narrow, contacts, device_diameter)


def _surface(colon: Colon) -> list[Verdict]:
    faces = colon.lumen.faces
    closed, handles = is_watertight(faces), genus(faces)
    return [
        Verdict("watertight", "good" if closed else "bad", "closed" if closed else "open: repair it"),
        Verdict(
            "handles",
            "good" if handles == 0 else "note",
            "none" if handles == 0 else f"{handles}: loops or folds are joined; the centreline keeps to the widest way",
        ),
    ]


def _scale(colon: Colon) -> list[Verdict]:
    length = colon.centreline.length
    volume = signed_volume(colon.lumen.vertices, colon.lumen.faces)
    diameter = effective_diameter(colon.centreline, colon.radius)
    arc = colon.centreline.arc
    means = {
        s.name: float(np.sqrt((diameter[(arc >= s.start) & (arc <= s.end)] ** 2).mean()))
        for s in colon.segments
        if ((arc >= s.start) & (arc <= s.end)).any()
    }
    odd = [name for name, mean in means.items() if not USUAL_DIAMETER[0] <= mean <= USUAL_DIAMETER[1]]
    listed = ", ".join(f"{name} {mean * 1e3:.0f}" for name, mean in means.items())
    return [
        Verdict("length", "good" if SHORTEST <= length <= LONGEST else "bad", f"{length:.2f} m"),
        Verdict("volume", "good" if USUAL_VOLUME[0] <= volume <= USUAL_VOLUME[1] else "note", f"{volume * 1e3:.2f} L"),
        Verdict("mean diameters", "note" if odd else "good", f"{listed} mm" + (f"; unusual: {odd}" if odd else "")),
    ]


def _centreline(colon: Colon) -> Verdict:
    points = colon.centreline.points
    crossings = int((~LumenRays(colon.lumen).clear(points[:-1], points[1:])).sum())
    if crossings:
        return Verdict("centreline", "bad", f"crosses the wall {crossings} times: import the colon again")
    return Verdict("centreline", "good", "inside the lumen everywhere")


def _passage(passage: Passage, narrow: tuple[Narrow, ...], device: float) -> Verdict:
    if not narrow:
        return Verdict(
            "passage",
            "good",
            f"a ball of {device * 1e3:.1f} mm passes; the narrowest place has {passage.diameter.min() * 1e3:.1f} mm",
        )
    listed = "; ".join(f"{p.diameter * 1e3:.1f} mm at {p.narrowest:.2f} m ({p.segment})" for p in narrow[:6])
    more = f"; and {len(narrow) - 6} more" if len(narrow) > 6 else ""
    return Verdict(
        "passage",
        "bad",
        f"{device * 1e3:.1f} mm cannot pass {len(narrow)} places: {listed}{more}. Open them with --insufflate",
    )


def _by_segment(colon: Colon, passage: Passage, device: float) -> Verdict:
    """The largest ball that passes each segment."""
    arc = colon.centreline.arc
    widths = {
        s.name: float(passage.diameter[inside].min())
        for s in colon.segments
        if (inside := (arc >= s.start) & (arc <= s.end)).any()
    }
    listed = ", ".join(f"{name} {width * 1e3:.0f}" for name, width in widths.items())
    return Verdict("narrowest places", "good" if min(widths.values()) >= device else "bad", f"{listed} mm")


def _contacts(contacts: tuple[Contact, ...]) -> Verdict:
    if not contacts:
        return Verdict("self-contact", "good", "no loop touches another")
    listed = "; ".join(f"{c.first:.2f} and {c.second:.2f} m ({c.gap * 1e3:.1f} mm apart)" for c in contacts[:4])
    more = f"; and {len(contacts) - 4} more" if len(contacts) > 4 else ""
    return Verdict("self-contact", "note", f"{len(contacts)} places: {listed}{more}")
