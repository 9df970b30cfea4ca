"""Passage, contacts, verdicts, insufflation, remeshing and landmarks of one tube with a collapsed place."""

from pathlib import Path

import numpy as np
import pytest
from bent_tube import hairpin

from haustra.envs.view.picture.check_figure import write_check_figure
from haustra.errors import InvalidMeshError, InvalidOptionError
from haustra.models.anatomy.check import Check, check_colon
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.insufflation import insufflated, opening_from
from haustra.models.anatomy.landmarks import landmark_positions
from haustra.models.anatomy.mesh_colon import colon_from_surface
from haustra.models.anatomy.passage import passage_of
from haustra.models.anatomy.points import surface_through
from haustra.models.anatomy.remesh import remeshed
from haustra.models.anatomy.repair import genus, is_watertight, signed_volume
from haustra.models.anatomy.self_contact import self_contacts
from haustra.models.anatomy.tube import tube
from haustra.provenance import Provenance
from tests.models.anatomy.conftest import short_ones_allowed

APART, RADIUS, LEG, COLLAPSED, THROAT = 0.0412, 0.02, 0.15, 0.07, 0.0035


@pytest.fixture(scope="module")
def colon() -> Colon:
    """Two legs 1.2 mm apart, and one of them narrowed to 7 mm."""
    line = centreline_through(hairpin(LEG, APART), 0.005)
    radius = RADIUS - (RADIUS - THROAT) * np.exp(-(((line.arc - COLLAPSED) / 0.02) ** 2))
    surface = tube(line.points, line.frames, np.repeat(radius[:, None], 24, axis=1))
    start = {"anus": np.array([0.0, 0.0, 0.0])}
    about = {"name": "tube", "provenance": Provenance(inputs={}, configuration={}), "positions": start}
    with short_ones_allowed():
        return colon_from_surface(surface, **about)


@pytest.fixture(scope="module")
def check(colon: Colon) -> Check:
    """What is found on the way of a scope of 12.8 mm."""
    return check_colon(colon, device_diameter=0.0128)


def test_collapsed_place_is_found_with_where_and_how_narrow(colon: Colon, check: Check):
    assert len(check.narrow) == 1
    place = check.narrow[0]
    assert colon.centreline.points[np.searchsorted(colon.centreline.arc, place.narrowest), 2] == pytest.approx(
        COLLAPSED, abs=0.006
    )
    assert place.diameter == pytest.approx(2 * THROAT, abs=5e-4)
    assert check.state == "bad"
    verdict = next(v for v in check.verdicts if v.what == "passage")
    assert f"{place.diameter * 1e3:.1f} mm at" in verdict.finding and "--insufflate" in verdict.finding
    by_segment = next(v for v in check.verdicts if v.what == "narrowest places")
    assert f"{place.segment} 7" in by_segment.finding and by_segment.state == "bad"
    assert all(segment.name in by_segment.finding for segment in colon.segments)
    with short_ones_allowed():
        assert check_colon(colon, device_diameter=0.006).state == "note"  # the touching legs remain


def test_legs_that_touch_are_reported_and_the_bend_is_not(colon: Colon):
    contacts = self_contacts(colon)
    assert contacts
    for contact in contacts:
        assert contact.gap == pytest.approx(APART - 2 * RADIUS, abs=4e-4)
        assert contact.second - contact.first > 0.1


def test_verdicts_are_drawn(colon: Colon, check: Check, tmp_path: Path):
    path = write_check_figure(colon, check, tmp_path / "check.png")
    assert path.read_bytes().startswith(b"\x89PNG")


def test_insufflation_to_a_diameter_opens_and_merges_nothing(colon: Colon):
    opened = insufflated(colon, opening_from("13mm"))
    assert passage_of(opened).diameter.min() >= 0.013
    assert is_watertight(opened.lumen.faces) and genus(opened.lumen.faces) == 0
    assert signed_volume(opened.lumen.vertices, opened.lumen.faces) > signed_volume(
        colon.lumen.vertices, colon.lumen.faces
    )
    assert any("Assumed" in warning for warning in opened.warnings)


def test_more_pressure_opens_more_and_a_little_nothing(colon: Colon):
    """Hardly anything opens below 8 mmHg (docs/validation/gas.md)."""
    found = [insufflated(colon, opening_from(p)) for p in ("2mmHg", "10mmHg", "2kPa")]
    narrow, wide, wider = (passage_of(each).diameter.min() for each in found)
    assert narrow == pytest.approx(2 * THROAT, abs=5e-4)
    assert narrow + 1e-3 < wide < wider


def test_opening_that_would_merge_loops_is_refused(colon: Colon):
    with pytest.raises(InvalidMeshError, match="merging loops"):
        insufflated(colon, opening_from("45 mm"))


@pytest.mark.parametrize("text", ["", "14", "wide", "-3mm", "900mm", "5bar", "1000mmHg", "nanmm", "1e3mmHg", "1..2mm"])
def test_openings_that_make_no_sense(text: str):
    with pytest.raises(InvalidOptionError, match="no opening"):
        opening_from(text)


def test_remeshing_reports_its_error_and_keeps_the_shape(colon: Colon):
    new, report = remeshed(colon)
    assert is_watertight(new.lumen.faces) and genus(new.lumen.faces) == genus(colon.lumen.faces)
    assert report["triangles"] == len(new.lumen.faces)
    assert report["p95_m"] <= report["hausdorff_m"] < 2.5e-3
    near = np.abs(new.lumen.vertices[:, 2] - COLLAPSED) < 0.01
    throat = near & (new.lumen.vertices[:, 0] < 0.01)
    corners = new.lumen.vertices[new.lumen.faces]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(1)
    assert edge[throat[new.lumen.faces].all(1)].mean() < 0.6 * np.median(edge)  # narrower, so finer


def test_named_landmarks_override_and_the_valve_begins_the_caecum(colon: Colon):
    places = {"ileocaecal_valve": (APART, 0.0, 0.03), "splenic_flexure": (APART / 2, 0.0, LEG + 0.03)}
    positions = {**landmark_positions(places, np.eye(3)), "anus": np.zeros(3)}
    with short_ones_allowed():
        named = colon_from_surface(colon.lumen, name="named", provenance=colon.provenance, positions=positions)
    assert named.landmarks["caecum"] == named.landmarks["ileocaecal_valve"]
    at = np.searchsorted(named.centreline.arc, named.landmarks["caecum"])
    assert named.centreline.points[at, 2] == pytest.approx(0.03, abs=0.003)
    assert named.segments[-1].start == named.landmarks["caecum"]
    assert not any("shows no valve" in warning for warning in named.warnings)


@pytest.mark.parametrize(
    ("places", "message"),
    [
        ({"appendix": (0.0, 0.0, 0.0)}, "not known"),
        ({"caecum": (0.0, float("inf"), 0.0)}, "finite"),
        ({"caecum": (0.0, 0.0, 0.0), "ileocaecal_valve": (0.0, 0.0, 0.0)}, "one of the two"),
    ],
)
def test_landmarks_that_make_no_sense(places: dict, message: str):
    with pytest.raises(InvalidOptionError, match=message):
        landmark_positions(places, np.eye(3))


def test_points_become_the_surface_that_they_lie_on():
    """A hairpin whose legs are 3 mm apart: normals must not be carried across the gap."""
    line = centreline_through(hairpin(0.1, 0.033), 0.0015)
    wall = tube(line.points, line.frames, np.full((len(line.points), 60), 0.015))
    rng = np.random.default_rng(1)
    found = surface_through(wall.vertices + rng.normal(scale=1e-4, size=wall.vertices.shape))
    assert genus(found.surface.faces) == 0
    volume = signed_volume(wall.vertices, wall.faces)
    assert signed_volume(found.surface.vertices, found.surface.faces) == pytest.approx(volume, rel=0.03)
    assert "median" in found.notes[0]
