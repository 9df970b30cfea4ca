"""The spike: a folder and a TOML are all that a new device needs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.envs.sim.device_native import NativeDevice
from haustra.envs.study.questions import find_backend
from haustra.envs.study.run import run_sweep
from haustra.envs.study.study_file import load_study
from haustra.errors import InvalidDesignError
from haustra.models.anatomy.store import save_colon
from haustra.models.device_scene import build_device_scene, device_options, device_tables
from haustra.models.devices.base import Pose, load_device
from haustra.models.devices.capsule.interface import SPHERES, Capsule
from haustra.scripts.main import BAD_INPUT, SUCCESS, main
from tests.tube_colon import RADIUS, straight_tube

ROOT = Path(__file__).parents[4]
FOLDER = ROOT / "models" / "devices" / "capsule"


def capsule(**changes) -> Capsule:
    """The shipped one, led by a wrench unless a test says otherwise."""
    found = load_device("capsule")
    assert isinstance(found, Capsule)
    return replace(found, **{"led_by": "wrench", **changes})


@pytest.fixture(scope="module")
def tube():
    return straight_tube(0.2)


def backend(device: Capsule, tube, *, friction: float = 0.0, worlds: int = 1) -> NativeDevice:
    scene = build_device_scene(device, device_options(friction=friction), pose=Pose())
    return NativeDevice(scene, device_tables(scene, [tube]), worlds=worlds)


def hold(one: NativeDevice, command: list[float], seconds: float) -> None:
    for _ in range(round(seconds / 0.02)):
        assert one.step(np.array([command]), 4).all()


def test_nothing_outside_its_folder_names_it():
    """But for pyproject's list of packages, documents and this test: that is what 'no edit elsewhere' means."""
    names = ("devices.capsule", "devices/capsule", "capsule.toml", 'kind = "capsule"', 'device="capsule"')
    for room in ("haustra", "models", "envs", "scripts", "assets"):
        for path in (ROOT / room).rglob("*"):
            if path.suffix in (".py", ".toml", ".json") and FOLDER not in path.parents and path.stem != "capsule":
                text = path.read_text(encoding="utf-8")
                assert not any(name in text for name in names), path
    assert sum(len(path.read_text().splitlines()) for path in FOLDER.glob("*.py")) <= 400


def test_a_steady_force_moves_it_at_force_over_drag(tube):
    """Far from the wall: v = F / c, in the patient's axes and in its own."""
    for frame in ("patient", "own"):
        one = backend(capsule(frame=frame, tether_friction=0.0, tether_held=0.0), tube)
        hold(one, [0, 0, 0.4, 0, 0, 0], 0.4)
        assert one.readings()["speed"][0] == pytest.approx(0.4 / 10.0, rel=1e-3)
        assert one.readings()["magnet_force"][0] == pytest.approx(0.4)


def test_its_tether_pulls_back_with_the_weight_drawn_in_times_friction(tube):
    """T = mu (m / L) g s in a straight lumen, and v = (F - T) / c."""
    device = capsule(tether_mass_per_length=0.1, tether_friction=2.0, tether_held=0.0)
    one = backend(device, tube)
    hold(one, [0, 0, 0.5, 0, 0, 0], 0.8)
    drag = 2.0 * 0.1 * 9.81 * one.read().tip_arc[0]
    assert one.readings()["tether_drag"][0] == pytest.approx(drag, rel=0.03)
    assert one.readings()["speed"][0] == pytest.approx((0.5 - drag) / 10.0, rel=0.05)
    hold(one, [0, 0, 0.02, 0, 0, 0], 0.6)  # less than the tether's drag: it is held
    assert one.readings()["speed"][0] < 1e-3


def test_pressed_on_the_wall_its_six_spheres_share_the_force(tube):
    """F = 6 K d: each sphere is a spring of K, and the wall's force is what presses."""
    one = backend(capsule(), tube)
    hold(one, [0, 0, 0.5, 0, 0, 0], 0.8)
    hold(one, [0.9, 0, 0, 0, 0, 0], 1.0)
    seen = one.read()
    assert seen.wall_force[0] == pytest.approx(0.9, rel=0.01)
    assert seen.deepest[0] == pytest.approx(0.9 / (SPHERES * 1500), rel=0.05)
    assert np.hypot(*seen.tip[0, :2]) == pytest.approx(RADIUS - 0.0055, abs=3e-4)


def test_a_torque_turns_it_in_its_own_or_the_patients_axes(tube):
    """One torque about x, then about the capsule's own axis: only the body's own axes turn with it."""
    turned = {}
    for frame in ("patient", "own"):
        one = backend(capsule(frame=frame), tube)
        hold(one, [0, 0, 0, 2e-3, 0, 0], 0.4)
        hold(one, [0, 0, 0, 0, 0, 2e-3], 0.4)
        turned[frame] = one.read().tip_frame[0, :, 2]
    assert turned["own"] @ turned["patient"] < 0.99


def test_a_magnet_outside_leads_it_by_the_dipoles_wrench(tube):
    """Forces and torques of its motors are those of two point dipoles, to 1e-6, wherever the magnet stands."""
    device = capsule(led_by="magnet")
    one = backend(device, tube)
    for place, points in (([0.2, 0.1, 0.3], [0, 0, 1]), ([-0.1, 0.25, 0.1], [1, 0, 0]), ([0.0, 0.02, 0.05], [0, 1, 1])):
        seen = one.read()
        model = one.world_data(0)[0]
        centre = model.body("capsule/body").pos + one.positions()[0][0, :3]
        hold_still = np.array([[*place, *points]], float)
        assert one.step(hold_still, 1).all()
        away = centre - np.array(place)
        if np.linalg.norm(away) < device.standoff:
            away *= device.standoff / np.linalg.norm(away)
        moment = device.outside_moment * np.array(points) / np.linalg.norm(points)
        led = device.moment * seen.tip_frame[0, :, 2]
        force, torque = one_dipole_on_another(moment, led, away)
        names = [f"capsule/{what}_{axis}" for what in ("force", "torque") for axis in "xyz"]
        told = one.positions()[1][0, [model.actuator(name).id for name in names]]
        for found, wanted in ((told[:3], force), (told[3:], torque)):
            assert np.linalg.norm(found - wanted) <= 1e-6 * np.linalg.norm(wanted)


def one_dipole_on_another(source: np.ndarray, led: np.ndarray, away: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From the field alone: F = grad(m . B), by a derivative of eighth order, and m x B."""

    def field(r: np.ndarray) -> np.ndarray:
        size = np.linalg.norm(r)
        return 1e-7 * (3 * (source @ r) * r / size**5 - source / size**3)

    shares, step = (4 / 5, -1 / 5, 4 / 105, -1 / 280), 2e-3
    force = [
        sum(
            c * (led @ field(away + (k + 1) * step * e) - led @ field(away - (k + 1) * step * e))
            for k, c in enumerate(shares)
        )
        / step
        for e in np.eye(3)
    ]
    return np.array(force), np.cross(led, field(away))


def test_a_magnet_needs_moments():
    with pytest.raises(InvalidDesignError, match="give its moment and outside_moment"):
        capsule(led_by="magnet", moment=0.0)


def test_values_out_of_range_are_refused():
    with pytest.raises(InvalidDesignError, match=r"Device 'capsule': mass is 5.0; give 0.001 to 0.1 kg"):
        capsule(mass=5.0)


def test_its_driver_takes_it_through(tube):
    run = run_device(capsule(led_by="magnet"), tube, seconds=20.0)
    assert run.outcome.value == "completed"
    assert run.records["tip_arc"].max() > 0.165 and run.records["deepest"].max() < 1e-3


@pytest.fixture(scope="module")
def colon_folder(tube, tmp_path_factory) -> Path:
    return save_colon(tube, tmp_path_factory.mktemp("colon"))


def test_it_runs_from_the_command_line(colon_folder, tmp_path, capsys):
    call = ["run", "--colon", str(colon_folder), "--device", "capsule", "--seconds", "0.6"]
    assert main([*call, "-o", str(tmp_path), "--error", "--json"]) == SUCCESS
    scores = json.loads(capsys.readouterr().out)
    assert scores == json.loads((tmp_path / "scores.json").read_text())
    assert scores["device"] == scores["device_kind"] == "capsule"
    error = scores["numerical_error"]
    assert error["measured_on"] == "this run against half the time step" and error["push"] == [None, None]
    assert 0 < error["tip_mm"][0] == error["tip_mm"][1] < 5
    assert scores["backend"] == "native" and scores["wall_law"] == "table" and scores["mesentery"] is True
    assert 0.2 < scores["reach"] < 0.6 and scores["magnet_force_peak_N"] == pytest.approx(0.5, rel=0.01)
    assert "tether" in scores["not_modelled"] and scores["provenance"]["versions"]["mujoco"]
    for name in ("trajectory.npz", "scene.xml", "outside.png", "report.html"):
        assert (tmp_path / name).stat().st_size > 1000, name
    for change, message in (
        (["--preset", "fast"], "does not honour --preset"),
        (["--start", "0.3"], "does not honour --start"),
    ):
        assert main([*call, *change, "-o", str(tmp_path / "other")]) == BAD_INPUT
        assert message in " ".join(capsys.readouterr().err.split())


STUDY = """
question = "device"
title = "Force of the magnet"
[base]
design = "capsule"
[options]
seconds = 0.5
[[variables]]
name = "limit"
path = "design.force_limit"
unit = "N"
nominal = 1.0
low = 0.4
high = 1.0
values = [0.4, 1.0]
[conditions]
colon = ["{colon}"]
friction = [0.1]
[[objectives]]
score = "reach"
goal = "maximise"
"""


def sweep(colon_folder: Path, tmp_path: Path, backend: str) -> list[float]:
    pytest.importorskip("polars")
    from haustra.envs.study.run import Computing

    path = tmp_path / "study.toml"
    path.write_text(STUDY.format(colon=colon_folder), encoding="utf-8")
    done = run_sweep(load_study(path), tmp_path / "sweep", Computing(backend=backend))
    assert done["finished"] == 2, done
    import polars

    return polars.read_csv(tmp_path / "sweep" / "results.csv")["tip_arc_max_m"].to_list()


def test_it_is_studied(colon_folder, tmp_path):
    weak, strong = sweep(colon_folder, tmp_path, "native")
    assert strong - weak == pytest.approx((0.5 - 0.2) / 10.0 * 0.5, rel=0.05)
    assert find_backend("device", "warp").batch > 1


@pytest.mark.slow
def test_it_is_studied_on_warp_as_natively(colon_folder, tmp_path):
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    (tmp_path / "native").mkdir()
    assert sweep(colon_folder, tmp_path, "warp") == pytest.approx(
        sweep(colon_folder, tmp_path / "native", "native"), abs=1e-5
    )


@pytest.mark.slow
def test_pressed_on_the_wall_warp_agrees_with_native(tube):
    """Places within 5 micrometres and forces within 1 % where it lies pressed on the wall, in single precision.

    For a fifth of a second after it struck the force still swings by some percent. The native force is that of the last
    step but one.
    """
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    from haustra.envs.sim.warp_setup import use_warp

    use_warp()
    import jax
    import jax.numpy as jnp

    from haustra.envs.sim.device_warp import Conditions, WarpDevice

    device = capsule()
    native = backend(device, tube, friction=0.1)
    warp = WarpDevice.of(native.scene, device_tables(native.scene, [tube]))
    conditions = Conditions(jnp.zeros(1, int), jnp.full(1, 0.1), jnp.full(1, 1500.0))
    now = warp.begin(conditions)
    step = jax.jit(lambda now, command: warp.step(conditions, now, command, 4))
    for command in [[0, 0, 0.9, 0, 0, 0]] * 10 + [[0.9, 0, 0.1, 0, 0, 0]] * 24:
        native.step(np.array([command], float), 4)
        now = step(now, jnp.array([command]))
    seen = warp.read(conditions, now)
    np.testing.assert_allclose(seen.tip, native.read().tip, atol=5e-6)
    native.step(np.array([[0.9, 0, 0.1, 0, 0, 0]]), 1)
    assert seen.wall_force[0] > 0.5
    np.testing.assert_allclose(seen.wall_force, native.read().wall_force, rtol=0.01)


def test_it_is_a_gymnasium_environment(tube):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    import haustra.envs  # noqa: F401

    one = gymnasium.make("Haustra/Device-v0", device=capsule(), colons=[tube])
    check_env(one.unwrapped, skip_render_check=True)
    one.reset(seed=0)
    gained, over, info = 0.0, False, {}
    for _ in range(60):
        _, reward, over, _, info = one.step(np.array([0, 0, 1, 0, 0, 0], np.float32))
        gained += float(reward)
        if over:
            break
    assert over and info["outcome"] == "completed"
    assert gained == pytest.approx(100 * (info["progress"] - 0.15), abs=3)
