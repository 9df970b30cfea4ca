"""Small studies for tests."""

from pathlib import Path

from haustra.envs.study.study import Study
from haustra.envs.study.study_file import read_study

SPACING = {"name": "spacing", "path": "drive.spacing_pitches", "unit": "1", "nominal": 3, "low": 2, "high": 4}
PRESSURE = {"name": "pressure", "path": "design.bellows.pressure", "unit": "Pa", "nominal": 0, "low": 0, "high": 12000}


def table(**changes) -> dict:
    """A propulsion study as a parsed file: 4 spacings × 3 pressures, the highest impossible, × 2 frictions."""
    return {
        "question": "propulsion",
        "variables": [SPACING | {"levels": 4}, PRESSURE | {"levels": 3}],
        "conditions": {"friction": [0.2, 0.4], "speed": [0.0325]},
        "objectives": [{"score": "force_N", "goal": "maximise"}, {"score": "ripple_fraction", "goal": "minimise"}],
        **changes,
    }


def study(**changes) -> Study:
    """Study read from the small table, with changes."""
    return read_study(table(**changes), Path("small.toml"))
