"""What is drawn of a device is what is in its scene, where it is, and none of it touches or weighs anything."""

import mujoco
import numpy as np
import pytest

from haustra.envs.view.picture.shapes import drawn_shapes
from haustra.models.device_scene import build_device_scene, device_options, pose_in
from haustra.models.devices.base import load_device
from haustra.models.devices.tracked.interface import TrackedRobot
from tests.ring_wall import bent_colon


def test_shapes_are_closed_around_their_volume_and_stand_where_the_body_is() -> None:
    """By the divergence theorem a closed surface's volume is the sum of x . n dA / 3."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="body", pos=[1.0, 2.0, 3.0], quat=[0.8, 0.6, 0, 0])
    body.add_freejoint()
    kinds = mujoco.mjtGeom
    sizes = {
        kinds.mjGEOM_SPHERE: ([0.1, 0, 0], 4 / 3 * np.pi * 0.1**3),
        kinds.mjGEOM_CAPSULE: ([0.1, 0.2, 0], 4 / 3 * np.pi * 0.1**3 + np.pi * 0.1**2 * 0.4),
        kinds.mjGEOM_CYLINDER: ([0.1, 0.2, 0], np.pi * 0.1**2 * 0.4),
        kinds.mjGEOM_BOX: ([0.1, 0.2, 0.3], 8 * 0.1 * 0.2 * 0.3),
        kinds.mjGEOM_ELLIPSOID: ([0.1, 0.2, 0.3], 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
    }
    for kind, (size, volume) in sizes.items():
        for geom in body.geoms:
            spec.delete(geom)
        body.add_geom(type=kind, size=size, pos=[0.0, 0.0, 0.5])
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        found = drawn_shapes(model, data)
        a, b, c = (found.vertices[found.faces[:, corner]] for corner in range(3))
        centre = data.geom_xpos[0]
        within = np.einsum("fi,fi->", a - centre, np.cross(b - centre, c - centre)) / 6
        assert within == pytest.approx(volume, rel=0.03)
        assert (np.einsum("vi,vi->v", found.normals, found.vertices - centre) > -1e-9).all()


def test_a_tracked_robot_shows_belts_bellows_and_core_which_touch_and_weigh_nothing() -> None:
    colon, device = bent_colon(bend=0.06, leg=0.12, length=0.25), load_device("tracked")
    options = device_options(device, start_depth=0.1)
    model = build_device_scene(device, options, pose=pose_in(colon, device, options)).compile()
    names = [model.geom(number).name for number in range(model.ngeom)]
    for track in range(4):
        for part in ("belt", "bellows", "front_tip", "rear_tip"):
            assert f"tracked/strut{track}_{part}" in names
    assert not model.geom_contype[model.geom_group == 0].any()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = drawn_shapes(model, data)
    size = np.ptp((found.vertices - data.body("tracked/core").xpos) @ data.body("tracked/core").xmat.reshape(3, 3), 0)
    assert isinstance(device, TrackedRobot)
    design = device.design
    assert size[0] >= design.core_length and np.all(np.abs(size[1:] / design.nominal_diameter - 1) < 0.1)
    camera = data.camera("tracked/tip/camera").xmat.reshape(3, 3)
    np.testing.assert_allclose(-camera[:, 2], data.site("tracked/tip").xmat.reshape(3, 3)[:, 2], atol=1e-9)
