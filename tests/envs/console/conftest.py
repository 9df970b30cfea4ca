"""A short bent colon in a folder, and what is driven through it."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from haustra.models.anatomy.colon import ColonSegment
from haustra.models.anatomy.store import save_colon
from haustra.models.devices.base import load_device
from haustra.models.devices.scope.library import named_design
from haustra.models.presets import find_preset
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@pytest.fixture(scope="session")
def colon_folder(tmp_path_factory) -> Path:
    colon = swept_colon(winding([(0.06, 0.0), (0.06, 0.8), (0.1, 0.0)]), name="bent tube")
    length = colon.centreline.length
    segments = ColonSegment("rectum", 0.0, 0.08), ColonSegment("sigmoid", 0.08, length)
    return save_colon(replace(colon, segments=segments), tmp_path_factory.mktemp("colon"))


@pytest.fixture(scope="session")
def scope() -> dict[str, Any]:
    """A scope on a colon that moves and is full of gas."""
    options = replace(find_preset("fast").apply(), wall_law="table", mesentery=True, gas=2500.0)
    about = {"design": asdict(named_design("paediatric")), "options": asdict(options)}
    return {"kind": "scope", **about, "driver": "follower"}


@pytest.fixture(scope="session")
def capsule() -> dict[str, Any]:
    device: Any = replace(load_device("capsule"), led_by="wrench", tether_friction=0.0, tether_held=0.0)
    return {"kind": "device", "device": device.describe(), "options": {}}
