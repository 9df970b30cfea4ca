"""Any device on MuJoCo Warp does as natively: fixed or on the mesentery, worlds with conditions of their own."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.sim.device_native import NativeDevice
from haustra.envs.sim.device_worlds import load_device_worlds
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.device_scene import DeviceScene, build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import load_device
from haustra.models.devices.capsule.interface import Capsule
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.models.devices.vine.interface import Vine
from haustra.models.wall.abdomen import Abdomen
from tests.ring_wall import bent_colon
from tests.tube_colon import straight_tube

COLONS = (
    replace(straight_tube(0.4), segments=(ColonSegment("rectum", 0.0, 0.05), ColonSegment("sigmoid", 0.05, 0.4))),
    replace(bent_colon(bend=0.05, leg=0.1, length=0.35), segments=(ColonSegment("sigmoid", 0.0, 0.35),)),
)

FITTING = bent_colon(bend=0.06, leg=0.11, length=0.36, radius=0.017)
"""As wide as the tracked robot."""


class Held(Capsule):
    """A capsule whose spheres are softer and rub more than the wall."""

    def add_to(self, *args, **options):
        handles = super().add_to(*args, **options)
        return replace(handles, samples=tuple(replace(one, stiffness=300.0, friction=0.6) for one in handles.samples))


class Undrawn(Vine):
    """A vine to which no colon is drawn between its spheres."""

    is_shaft = False


def capsule(kind: type[Capsule] = Capsule) -> Capsule:
    found = load_device("capsule")
    assert isinstance(found, Capsule)
    return kind(**{**vars(found), "led_by": "wrench"})


def scene_in(device: Capsule, colons: tuple[Colon, ...], **changed) -> tuple[DeviceScene, dict]:
    options = device_options(device, **changed)
    poses = [pose_in(colon, device, options) for colon in colons]
    scene = build_device_scene(device, options)
    return scene, {"tables": device_tables(scene, list(colons), poses), "starts": [pose.arc for pose in poses]}


def press(world: int, instant: int) -> list[float]:
    """Sideways on the wall, then on along it."""
    side = [0.6, 0.0, 0.0] if world == 0 else [0.0, -0.5, 0.0]
    return [*side[:2], 0.4 if instant > 30 else 0.0, 0, 0, 0]


@pytest.mark.slow
def test_a_colon_on_its_mesentery_moves_as_natively() -> None:
    """Two colons, frictions and stiffnesses: axes and tips within 1 % of what has moved, mean forces 2 %.

    In the bend the capsule begins in touch with the wall: it strikes once, natively in one interval, here in two.
    """
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    scene, rest = scene_in(capsule(), COLONS, mesentery=True, start_depth=0.15)
    native = NativeDevice(scene, **rest, worlds=2)
    warp = load_device_worlds("warp", scene, **rest, worlds=2)
    own = {"friction": np.array([0.05, 0.3]), "wall_stiffness": np.array([1500.0, 2400.0])}
    forces: dict[str, list] = {"native": [], "warp": []}
    for one in (native, warp):
        one.reset(np.arange(2), np.arange(2), **own)
        for instant in range(80):
            assert one.step(np.array([press(world, instant) for world in range(2)]), 5).all()
            forces[one.name].append(one.read().wall_force)
    mine, theirs = native.read(), warp.read()
    assert native.displacement is not None and warp.displacement is not None
    largest = np.linalg.norm(native.displacement[..., :3], axis=2).max(axis=1)
    assert (largest > 0.005).all()
    apart = np.linalg.norm(warp.displacement[..., :3] - native.displacement[..., :3], axis=2).max(axis=1)
    assert (apart < 0.01 * largest).all()
    assert (np.linalg.norm(theirs.tip - mine.tip, axis=1) < 0.01 * largest).all()
    np.testing.assert_allclose(theirs.tip_arc, mine.tip_arc, atol=1e-4)
    np.testing.assert_allclose(np.mean(forces["warp"][4:], axis=0), np.mean(forces["native"][4:], axis=0), rtol=0.02)
    np.testing.assert_allclose(theirs.ahead, mine.ahead, atol=2e-3)
    for one in (native, warp):
        one.reset(np.array([1]), np.array([0]), friction=np.array([0.1]), wall_stiffness=np.array([1000.0]))
        assert one.displacement is not None
        assert not one.displacement[1, :, :3].any() and one.displacement[0, :, :3].any()
    with pytest.raises(InvalidOptionError, match="stiffness of the wall"):
        warp.reset(np.array([0]), np.array([0]), friction=np.array([0.1]), wall_stiffness=np.array([1e12]))


@pytest.mark.slow
def test_all_options_of_a_scene_count_as_natively() -> None:
    """Time step, damping, gravity and what the colon lies in, at once: axis and tip within 1 % of what has moved."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    around = {"abdomen": Abdomen(posture="left"), "gravity": (0.0, -9.81, 0.0), "mesentery": True}
    own = {"timestep": 0.0025, "wall_damping_time": 0.02, "wall_stiffness": 800.0, "friction": 0.2, "start_depth": 0.2}
    device = capsule()
    options = device_options(device, **around, **own)
    scene = build_device_scene(device, options, pose=pose_in(COLONS[0], device, options))
    found = {}
    for name in ("native", "warp"):
        one = load_device_worlds(name, scene, device_tables(scene, [COLONS[0]]))
        for _ in range(40):
            assert one.step(np.array([[0.2, 0, 0, 0, 0, 0]]), 10).all()
        assert one.displacement is not None
        found[name] = one.read().tip[0], one.displacement[0, :, :3]
    (tip, axis), (own_tip, own_axis) = found["native"], found["warp"]
    largest = np.linalg.norm(axis, axis=1).max()
    assert largest > 0.005 and tip[1] < -0.01
    assert np.linalg.norm(own_axis - axis, axis=1).max() < 0.01 * largest
    assert np.linalg.norm(own_tip - tip) < 0.01 * largest


@pytest.mark.slow
def test_a_colon_is_drawn_to_a_shaft_as_natively() -> None:
    """A vine straight across a bend: the axis moves as natively within 1 % of its largest way, and not so undrawn.

    Natively the axis takes its first step with the second of MuJoCo's.
    """
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    found = load_device("vine")
    assert isinstance(found, Vine)
    axes = {}
    for name, kind, steps in (("native", Vine, 4), ("warp", Vine, 3), ("native", Undrawn, 4)):
        device = kind(**{**vars(found), "length": 0.3})
        options = device_options(device, mesentery=True, start_depth=0.2)
        scene = build_device_scene(device, options, pose=pose_in(COLONS[1], device, options))
        one = load_device_worlds(name, scene, device_tables(scene, [COLONS[1]]))
        assert one.step(np.zeros((1, len(device.controls))), steps).all()
        assert one.displacement is not None
        axes[name, kind] = one.displacement[0, :, :3]
    native, warp, undrawn = axes.values()
    largest = np.linalg.norm(native, axis=1).max()
    assert largest > 1e-3
    assert np.linalg.norm(warp - native, axis=1).max() < 0.01 * largest
    assert np.linalg.norm(undrawn - native, axis=1).max() > 0.1 * largest


@pytest.mark.slow
def test_spheres_with_a_law_of_their_own_keep_it_on_warp() -> None:
    """Softer spheres stand deeper in the wall, and what rubs more is drawn less far; both as natively."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    found = {}
    for kind in (Capsule, Held):
        scene, rest = scene_in(capsule(kind), COLONS[:1], friction=0.05)
        for name in ("native", "warp"):
            one = load_device_worlds(name, scene, **rest)
            for instant in range(60):
                assert one.step(np.array([press(0, instant)]), 5).all()
            found[kind, name] = one.read()
    for kind in (Capsule, Held):
        mine, theirs = found[kind, "native"], found[kind, "warp"]
        np.testing.assert_allclose(theirs.deepest, mine.deepest, rtol=0.02)
        np.testing.assert_allclose(theirs.tip, mine.tip, atol=2e-5)
    assert found[Held, "warp"].deepest[0] > 3 * found[Capsule, "warp"].deepest[0]
    assert found[Held, "warp"].tip_arc[0] < found[Capsule, "warp"].tip_arc[0] - 0.003


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"gas": 3333.0}, r"device\.gas = 3333\.0 of a device of kind 'capsule'"),
        (
            {"mesentery": True, "abdomen": Abdomen(loops_touch=True)},
            r"device\.abdomen\.loops_touch = True of a device of kind 'capsule'",
        ),
        ({"elasticity": "exponential"}, r"device\.elasticity = 'exponential' of a device of kind 'capsule'"),
    ],
)
def test_what_warp_cannot_honour_of_a_device_is_refused_by_name_without_warp(changed: dict, named: str) -> None:
    scene, rest = scene_in(capsule(), COLONS[:1], **changed)
    with pytest.raises(UnsupportedSceneError, match=f"'warp' cannot honour {named}: 'native' can"):
        load_device_worlds("warp", scene, **rest)


@pytest.mark.slow
@pytest.mark.parametrize("mesentery", [False, True])
def test_treads_drive_a_robot_as_natively(mesentery: bool) -> None:
    """Spheres of several radii, some with a law of their own; one worm at half the other's speed: way within 1 %."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    robot = load_device("tracked")
    assert isinstance(robot, TrackedRobot)
    tube = replace(FITTING, segments=(ColonSegment("rectum", 0.0, 0.05), ColonSegment("sigmoid", 0.05, 0.36)))
    options = device_options(robot, start_depth=0.1, mesentery=mesentery)
    pose, scene = pose_in(tube, robot, options), build_device_scene(robot, options)
    found = {}
    for name in ("native", "warp"):
        one = load_device_worlds(name, scene, device_tables(scene, [tube], [pose]), starts=[pose.arc], worlds=2)
        begun = one.read().tip_arc
        for _ in range(15):
            assert one.step(np.array([[robot.rpm], [robot.rpm / 2]]), 10).all()
        found[name] = one.read().tip_arc - begun, one.readings()["normal"], one.displacement
    (way, normal, moved), (own_way, own_normal, own_moved) = found["native"], found["warp"]
    np.testing.assert_allclose(own_way, way, rtol=0.01)
    np.testing.assert_allclose(own_normal, normal, rtol=0.01)
    assert 1.8 < way[0] / way[1] < 2.2
    assert (moved is None) == (own_moved is None) == (not mesentery)


def test_a_tread_takes_as_much_room_as_its_worlds() -> None:
    """What a step changes of the model has one row a world, however many there are."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    import jax
    import jax.numpy as jnp

    from haustra.envs.sim import device_warp

    robot, worlds = load_device("tracked"), 5
    options = device_options(robot, start_depth=0.1)
    pose, scene = pose_in(FITTING, robot, options), build_device_scene(robot, options)
    device = device_warp.WarpDevice.of(scene, device_tables(scene, [FITTING], [pose]), starts=[pose.arc])
    own = device_warp.Conditions(*(jnp.full(worlds, value) for value in (0, 0.1, 1500.0)))
    shapes = jax.make_jaxpr(device.step)(own, device.begin(own), jnp.ones((worlds, 1)), 1)
    assert f"{worlds},{worlds},{len(scene.handles.samples)}" not in str(shapes)


def test_an_unknown_backend_is_named() -> None:
    scene, rest = scene_in(capsule(), COLONS[:1])
    with pytest.raises(InvalidOptionError, match=r"Backend 'linear' is not known\. Known: native, warp"):
        load_device_worlds("linear", scene, **rest)


@pytest.mark.slow
def test_an_environment_shows_the_same_as_natively() -> None:
    """Observations of a capsule pressed on a colon on its mesentery, entry by entry, within 0.002."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    pytest.importorskip("gymnasium")
    from haustra.envs.tasks.device_env import DeviceEnv

    shown = {}
    for backend in ("native", "warp"):
        one = DeviceEnv(capsule(), colons=COLONS[:1], rules={"mesentery": True}, backend=backend)
        one.reset(seed=3)
        for _ in range(12):
            shown[backend] = one.step(np.array([0.6, 0, 0.5, 0, 0, 0], np.float32))[0]
    assert shown["native"][4] > 0.1  # the wall presses
    np.testing.assert_allclose(shown["warp"], shown["native"], atol=0.002)
