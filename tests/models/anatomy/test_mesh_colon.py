from pathlib import Path

import numpy as np
import pytest
import trimesh
from bent_tube import bent_tube, hairpin

from haustra.errors import InvalidMeshError, InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.mesh_colon import check_length, colon_from_surface, import_colon
from haustra.models.anatomy.properties import Clearance, describe
from haustra.models.anatomy.rays import LumenRays
from haustra.provenance import Provenance
from tests.models.anatomy.conftest import short_ones_allowed

RADIUS, LEG, APART = 0.02, 0.24, 0.0405


def write(folder: Path, scale: float, *, inverted: bool = False) -> Path:
    surface = bent_tube(hairpin(LEG, APART), RADIUS)
    mesh = trimesh.Trimesh(
        surface.vertices * scale, surface.faces[:, ::-1] if inverted else surface.faces, process=False
    )
    file = folder / "hairpin.stl"
    mesh.export(file)
    return file


@pytest.fixture(scope="module")
def colon(tmp_path_factory: pytest.TempPathFactory) -> Colon:
    """Two legs half a millimetre apart: any voxel picture of them is one blob."""
    with short_ones_allowed():
        return import_colon(write(tmp_path_factory.mktemp("mesh"), 1e3), units="mm", name="hairpin")


def test_touching_loops_are_no_short_cut(colon: Colon):
    whole = 2 * LEG + np.pi * APART / 2
    assert colon.centreline.length == pytest.approx(whole, rel=0.06)  # it cuts the bend's inner side a little
    assert colon.centreline.points[:, 2].max() > LEG


def test_centreline_stays_in_the_middle_and_never_crosses_the_wall(colon: Colon):
    points = colon.centreline.points
    assert LumenRays(colon.lumen).clear(points[:-1], points[1:]).all()
    straight = (colon.centreline.arc > 0.05) & (colon.centreline.arc < LEG - 0.05)
    assert Clearance(colon.lumen)(points[straight]).min() > RADIUS - 0.003


def test_radius_and_volume_of_the_tube(colon: Colon):
    straight = (colon.centreline.arc > 0.05) & (colon.centreline.arc < LEG - 0.05)
    assert np.sqrt((colon.radius[straight] ** 2).mean()) == pytest.approx(RADIUS, rel=0.01)
    measures = describe(colon)
    assert measures["volume_m3"] == pytest.approx(np.pi * RADIUS**2 * (2 * LEG + np.pi * APART / 2), rel=0.05)
    assert measures["watertight"] and measures["genus"] == 0


def test_segments_cover_the_colon_without_gaps(colon: Colon):
    assert [s.name for s in colon.segments] == ["rectum", "sigmoid", "descending", "transverse", "ascending", "caecum"]
    assert colon.segments[0].start == 0.0
    assert colon.segments[-1].end == colon.centreline.length
    assert all(a.end == b.start and a.end > a.start for a, b in zip(colon.segments, colon.segments[1:], strict=False))


def test_named_anus_turns_the_colon_round_and_units_agree(tmp_path: Path, colon: Colon):
    with short_ones_allowed():
        other = import_colon(write(tmp_path, 1.0, inverted=True), units="m", anus=(APART, 0.0, 0.0))
    assert other.centreline.points[0, 0] == pytest.approx(APART, abs=0.01)
    assert other.centreline.length == pytest.approx(colon.centreline.length, rel=0.01)


@pytest.mark.parametrize(
    ("length", "units", "advice"),
    [
        (1500.0, "m", "probably in mm"),
        (15.0, "cm", "probably in mm"),
        (0.0015, "mm", "probably in m"),
        (5.0, "mm", "whole colon"),
    ],
)
def test_wrong_units_are_named(length: float, units, advice: str):
    with pytest.raises(InvalidMeshError, match=advice):
        check_length(length, units)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"units": "voxel"}, "spacing"),
        ({"units": "mm", "spacing_mm": (1.0, 1.0, 1.0)}, "spacing"),
        ({"units": "voxel", "spacing_mm": (1.0, -1.0, 1.0)}, "positive"),
        ({"units": "mm", "anus": (0.0, float("nan"), 0.0)}, "finite"),
    ],
)
def test_options_that_do_not_fit(tmp_path: Path, options: dict, message: str):
    with pytest.raises(InvalidOptionError, match=message):
        import_colon(tmp_path / "none.stl", **options)


@pytest.mark.parametrize("place", [(0.0, 0.0, -200.0), (1e6, 0.0, 0.0), (0.0, 500.0, 200.0)])
def test_a_landmark_that_is_nowhere_near_is_refused_with_its_distance(tmp_path: Path, place) -> None:
    with pytest.raises(InvalidMeshError, match=r"anus is \S+ m from the surface, more than 0\.05 m: check"):
        import_colon(write(tmp_path, 1e3), units="mm", anus=place)


def test_a_landmark_in_another_unit_is_named() -> None:
    """The colon stands 2 m from the origin, as in a scanner's coordinates."""
    surface = bent_tube(hairpin(LEG, APART) + np.array([2.0, 0.0, 0.0]), RADIUS)
    positions = {"anus": np.array([2e-3, 0.0, 0.0])}
    with pytest.raises(InvalidMeshError, match=r"anus is 1\.98 m from the surface.*probably in m"):
        colon_from_surface(surface, name="far", provenance=Provenance({}, {}), positions=positions, units="mm")


def test_an_anus_that_is_not_at_an_end_is_told() -> None:
    surface = bent_tube(hairpin(0.35, APART), RADIUS)
    positions = {"anus": np.array([0.0, 0.0, 0.16])}
    with short_ones_allowed():
        made = colon_from_surface(surface, name="cut", provenance=Provenance({}, {}), positions=positions, units="m")
    assert any("not at an end of the lumen" in note and "are left out" in note for note in made.warnings)
