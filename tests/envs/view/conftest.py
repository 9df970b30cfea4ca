"""A run in a short colon that moves, made once."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.insertion import run_insertion
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.view.dataset.moments import Moments, Source
from haustra.models.anatomy.colon import ColonSegment, Lesion
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

OPTIONS = SceneOptions(
    wall_law="table",
    mesentery=True,
    softening=False,
    insertion_limit=0.35,
    shaft_cell=0.0625,
    bending_cell=0.034,
    twist_hinges=2,
)


@pytest.fixture(scope="session")
def source() -> Source:
    """A scope is pushed into a bend of a colon that hangs on a mesentery."""
    colon = swept_colon(winding([(0.1, 0.0), (0.1, 1.2), (0.2, 0.0)]), name="bend")
    borders = [0.0, 0.05, colon.centreline.length]
    names = ("rectum", "sigmoid")
    segments = tuple(ColonSegment(name, *ends) for name, *ends in zip(names, borders, borders[1:], strict=False))
    foot = np.array([0.06, 0.02, 0.0])
    polyp = Lesion("polyp", "flat", "small", 0.008, 0.002, "sigmoid", 0.06, 0.0, tuple(foot.tolist()))
    colon = replace(colon, segments=segments, lesions=(polyp,))
    scene = build_scene(colon, None, named_design("adult"), OPTIONS, show_lumen=False)
    run = run_insertion(scene, seconds=8.0, backend=LinearSingle)
    return Source("bend", scene, Moments(scene, run.trajectory))
