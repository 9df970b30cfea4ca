"""Backends of many worlds against MuJoCo on CPU threads: same inputs, same scopes, same observations."""

from importlib.util import find_spec

import numpy as np
import pytest

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.load import load_backend
from haustra.envs.sim.state import Controls
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import InvalidOptionError, MissingDependencyError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import lumen_table, stack
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.task_bank import short_bank

_DESIGN = named_design("adult")
_OPTIONS = SceneOptions(
    wall_law="table",
    softening=False,
    insertion_limit=0.3,
    shaft_cell=0.0625,
    bending_cell=0.034,
    twist_hinges=2,
    sample_spacing=0.03,
)


NEEDS_WARP = pytest.mark.skipif(find_spec("warp") is None, reason="the extra warp is not installed")
BACKENDS = ["linear", pytest.param("warp", marks=NEEDS_WARP)]


@pytest.mark.parametrize("name", BACKENDS)
def test_backends_see_the_same(name: str) -> None:
    """A bend, pushed and steered: tips within 1 mm on average, forces within a tenth; a reset world begins anew."""
    colons = [swept_colon(winding([(0.08, 0.0), (0.1, turn), (0.2, 0.0)]), name=f"bend {turn}") for turn in (-1.2, 1.6)]
    scene = build_scene(colons[0], None, _DESIGN, _OPTIONS, show_lumen=False)
    tables = stack(
        [lumen_table(each, device_radius=_DESIGN.diameter / 2).seen_from(*entry_of(each)) for each in colons]
    )
    stiffness = np.array([2400.0, 700.0])
    conditions = Conditions(np.array([0.05, 0.1]), stiffness, np.array([1.0, 0.8]), np.array([0.0, 0.3]))
    backends = [load_backend(each, scene, tables, worlds=2) for each in ("native", name)]
    for backend in backends:
        backend.reset(np.arange(2), np.array([1, 0]), conditions)
    inputs = Controls(np.array([0.06, 0.05]), np.array([0.0, 0.2]), np.tile([12.0, 0.0, 0.0, 0.0], (2, 1)))
    apart, forces, insertion = [], [], 0.0
    for _ in range(80):
        assert all(backend.step(inputs, 8).all() for backend in backends)
        threads, device = (backend.read() for backend in backends)
        apart.append(np.linalg.norm(threads.tip - device.tip, axis=1))
        forces.append([threads.link_forces.sum(), device.link_forces.sum()])
        insertion = device.insertion[0]
        np.testing.assert_allclose(threads.roll, device.roll, atol=0.02)
        np.testing.assert_allclose(threads.coils, device.coils, atol=0.01)
    assert np.mean(apart) < 0.001
    ours, theirs = np.mean(forces, axis=0)
    assert ours == pytest.approx(theirs, rel=0.1)
    for backend in backends:
        backend.reset(np.array([1]), np.array([0]), conditions.of(np.array([1])))
    seen = backends[1].read()
    assert seen.insertion[0] == pytest.approx(insertion)
    assert seen.insertion[1] == pytest.approx(0.03)
    # A pull that is no number.
    nothing = Controls(np.zeros(2), np.zeros(2), np.array([[np.nan, 0.0, 0.0, 0.0], np.zeros(4)]))
    assert backends[1].step(nothing, 1).tolist() == [False, True]
    backends[1].reset(np.array([0]), np.array([1]), conditions.of(np.array([0])))
    # A hand that is asked to push without end: its force is limited, so that only its place gives it away.
    endless = Controls(np.array([0.0, np.inf]), np.zeros(2), np.zeros((2, 4)))
    for backend in backends:
        assert backend.step(endless, 4).tolist() == [True, False]
        assert np.isfinite(backend.read().hand_lead).all()


@pytest.mark.parametrize("name", BACKENDS)
def test_a_vector_environment_runs_on_every_backend(name: str) -> None:
    made = NavigationVectorEnv(2, bank=short_bank(), observation="dict", depth=True, picture_size=24, backend=name)
    made.reset(seed=3)
    seen, reward, *_ = made.step(np.tile([1.0, 0, 0, 0], (2, 1)).astype(np.float32))
    assert made.observation_space.contains(seen)
    assert np.all(reward != 0)
    depth = seen["depth"]
    assert depth.shape == (2, 24, 24, 1)
    assert depth[:, 0, 0].max() == 0  # outside the lens's circle
    assert depth[:, 12, 12].min() > depth[:, 12, 1].max()


def test_a_backend_that_is_not_known_is_named() -> None:
    with pytest.raises(InvalidOptionError, match="cuda"):
        NavigationVectorEnv(2, bank=short_bank(), backend="cuda")


@pytest.mark.skipif(find_spec("warp") is not None, reason="the extra warp is installed")
def test_without_warp_it_says_what_to_install(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(MissingDependencyError, match="haustra\\[warp\\]"):
        NavigationVectorEnv(2, bank=short_bank(), backend="warp")
    assert capfd.readouterr().out == ""


@NEEDS_WARP
def test_warp_takes_a_worlds_own_stiffness_and_push() -> None:
    """Twice as stiff in one world is twice as stiff in it alone: the same scope bends half as far."""
    import jax.numpy as jnp

    from haustra.envs.sim.device_arrays import on_device
    from haustra.envs.sim.warp_scopes import WarpScopes

    scene, tables = short_bank().scene, on_device(short_bank().tables)
    backend = WarpScopes.of(scene)
    bending, push = np.array([1.0, 2.0, 1.0]), np.array([20.0, 20.0, 0.0])
    parameters = backend.parameters(scene, 3, stiffness=10.0, tip_bending=bending, push_limit=push)
    hands = Controls(jnp.full(3, 0.02), jnp.zeros(3), jnp.tile(jnp.array([1.0, 0.0, 0.0, 0.0]), (3, 1)))
    now = backend.steps(tables, parameters, backend.begin(parameters, tables), hands, 200)
    seen = backend.read(parameters, tables, now)
    assert float(seen.bend[0, 0]) == pytest.approx(2 * float(seen.bend[1, 0]), rel=0.05)
    assert float(seen.insertion[0]) > 0.04
    assert float(seen.insertion[2]) == pytest.approx(0.03, abs=1e-4)  # a hand without force
    assert np.asarray(now.healthy).all()
