"""Strictures, diverticula and polyps in grown colons."""

from pathlib import Path

import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.crossings import crossing_triangles
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.lesion import LesionOrder, read_orders, sizes
from haustra.models.anatomy.properties import describe
from haustra.models.anatomy.store import load_colon, save_colon

ORDERS = (
    *read_orders("polyp", ["sigmoid:small*2", "transverse@0.3:12mm:pedunculated", "ascending:large:flat"]),
    *read_orders("stricture", ["descending:severe"]),
    *read_orders("diverticulum", ["sigmoid:medium*4"]),
)


@pytest.fixture(scope="module")
def healthy() -> Colon:
    return grow_colon(seed=1)


@pytest.fixture(scope="module")
def ill() -> Colon:
    return grow_colon(seed=1, lesions=ORDERS)


def test_every_lesion_is_listed_with_place_size_and_type(ill: Colon, tmp_path: Path):
    assert [lesion.kind for lesion in ill.lesions].count("diverticulum") == 4
    assert len(ill.lesions) == 9
    borders = {segment.name: (segment.start, segment.end) for segment in ill.segments}
    for lesion in ill.lesions:
        start, end = borders[lesion.segment]
        assert start <= lesion.arc <= end
    pedunculated = next(lesion for lesion in ill.lesions if lesion.type == "pedunculated")
    start, end = borders["transverse"]
    assert pedunculated.size == pytest.approx(0.012) and pedunculated.size_class == "large"
    assert pedunculated.arc == pytest.approx(start + 0.3 * (end - start), abs=1e-3)
    assert load_colon(save_colon(ill, tmp_path / "colon")).lesions == ill.lesions


def test_sizes_lie_in_their_class(ill: Colon):
    for lesion in ill.lesions:
        known = sizes(lesion.kind)[lesion.size_class]
        assert known.low - 1e-6 <= lesion.size <= known.high + 1e-6


def test_lesions_leave_a_closed_surface_that_does_not_cross_itself(ill: Colon):
    measures = describe(ill)
    assert measures["watertight"] and measures["genus"] == 0
    assert len(crossing_triangles(ill.lumen)) == 0
    assert measures["centreline_min_clearance_m"] > 2e-3


def test_lesions_change_nothing_else(healthy: Colon, ill: Colon):
    np.testing.assert_array_equal(ill.centreline.points, healthy.centreline.points)
    distance = np.min([np.abs(ill.centreline.arc - lesion.arc) - lesion.extent for lesion in ill.lesions], axis=0)
    far = distance > 0.03
    assert far.mean() > 0.3
    np.testing.assert_allclose(ill.radius[far], healthy.radius[far], atol=1e-4)


def test_a_stricture_narrows_the_lumen_to_its_throat(ill: Colon):
    stricture = next(lesion for lesion in ill.lesions if lesion.kind == "stricture")
    throat = np.abs(ill.centreline.arc - stricture.arc) < 0.4 * stricture.extent
    np.testing.assert_allclose(2 * ill.radius[throat], stricture.size, rtol=0.06)


def test_a_polyp_stands_in_the_lumen_and_a_diverticulum_outside_it(healthy: Colon, ill: Colon):
    line = ill.centreline
    angles = ill.radius.shape[1]
    for lesion in ill.lesions:
        if lesion.kind == "stricture" or lesion.size < 7e-3 or lesion.angle is None:
            continue
        station = int(np.argmin(np.abs(line.arc - lesion.arc)))
        angle = round(lesion.angle / (2 * np.pi) * angles) % angles
        change = ill.radius[station, angle] - healthy.radius[station, angle]
        wanted = lesion.extent if lesion.kind == "diverticulum" else -lesion.extent
        assert change == pytest.approx(wanted, rel=0.5)


@pytest.mark.parametrize(
    ("kind", "text", "complaint"),
    [
        ("polyp", "sigmoid:huge", "Known: diminutive, small, large"),
        ("polyp", "sigmoid", "cannot be read"),
        ("polyp", "colon:small", "Segment 'colon'"),
        ("polyp", "sigmoid:small:round", "Known: sessile, pedunculated, flat"),
        ("polyp", "sigmoid@1.5:small", "from 0"),
        ("polyp", "sigmoid:99mm", "give 2 to 30 mm"),
        ("polyp", "sigmoid:8.8.8mm", "cannot be read"),
        ("diverticulum", "sigmoid:small*0", "give 1 to 50"),
        ("stricture", "sigmoid:small", "Known: mild, moderate, severe"),
    ],
)
def test_orders_that_cannot_be_honoured(kind, text: str, complaint: str):
    with pytest.raises(InvalidOptionError, match=complaint) as caught:
        read_orders(kind, [text])
    assert "\n" not in str(caught.value)


def test_a_lesion_without_room_is_refused():
    order = LesionOrder(kind="polyp", segment="sigmoid", size=0.03, type="pedunculated", share=0.5)
    with pytest.raises(InvalidOptionError, match="No room was found for a polyp"):
        grow_colon(seed=1, lesions=[order])
