"""What a camera in the lumen is spared drawing."""

import numpy as np

from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.state import Controls
from haustra.envs.view.picture.in_sight import SIGHT, LumenInSight
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


def test_only_what_lies_before_the_camera_and_near_is_shown() -> None:
    colon = swept_colon(winding([(0.9, 0.0)]), name="straight")
    options = SceneOptions(wall_law="table", softening=False, insertion_limit=0.3, sample_spacing=0.03)
    engine = LinearSingle(build_scene(colon, None, named_design("adult"), options))
    for _ in range(60):
        engine.step(Controls(0.1, 0.0), 4)
    arc = engine.read().insertion
    sight = LumenInSight(engine.model)
    names = [engine.model.geom(index).name for index in range(engine.model.ngeom)]
    lumen = [index for index, name in enumerate(names) if name.startswith("lumen_")]
    drawn = sight.show(engine.data, arc)
    shown = [engine.model.geom_rgba[index, 3] > 0 for index in lumen]
    begins = np.array([0.1 * int(names[index][-3:]) for index in lumen])
    faces = engine.model.mesh_facenum[engine.model.geom_dataid[lumen]]
    assert faces.sum() == len(colon.lumen.faces)
    assert drawn == faces[shown].sum() < 0.7 * faces.sum()
    assert np.all(begins[shown] < arc + SIGHT)
    assert shown[int(arc / 0.1)] and shown[int((arc + 0.2) / 0.1)]
    assert not shown[0]  # behind
    sight.show_all()
    assert np.all(engine.model.geom_rgba[lumen, 3] == 1)
