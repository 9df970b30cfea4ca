"""MuJoCo Warp pulls as the native backend does. On a CPU its kernels take a minute to compile: not in CI."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the extra warp is not installed")

from haustra.envs.runs.measure.propulsion import pull
from haustra.envs.runs.warp_rigs import WarpRigs
from haustra.errors import InvalidOptionError
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.law import PadLaw, load_table
from haustra.models.devices.tracked.rig import Rig, flat_rig, tube_rig

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def track(friction: float) -> Rig:
    design = TrackedDesign()
    law = PadLaw.fit(load_table(design.tread))
    return flat_rig(design, friction=friction, indentation=law.indentation(design.bellows.preload / 2))


@pytest.mark.slow
def test_each_world_pulls_as_it_does_alone() -> None:
    """Single against double precision: forces within 1e-4, ripple within 1e-3."""
    speeds, frictions = np.array([0.065, 0.0325, 0.065]), np.array([0.4, 0.4, 0.2])
    many = WarpRigs([track(0.4)], which=np.zeros(3, int), device="cpu").pull(speeds, frictions)
    assert many.sound.all()
    for world in range(3):
        alone = pull(track(frictions[world]), speeds[world])
        assert many.force[world] == pytest.approx(alone.mean, rel=1e-4)
        assert many.normal[world] == pytest.approx(alone.normal.mean(), rel=1e-4)
        np.testing.assert_allclose(many.ripple[world], alone.ripple(), rtol=1e-3, atol=1e-5)


def test_impossible_inputs_are_refused() -> None:
    rigs = WarpRigs([track(0.4)], which=np.zeros(2, int), device="cpu")
    with pytest.raises(InvalidOptionError, match="each of the 2 worlds"):
        rigs.pull(np.array([0.03]), np.array([0.4]))
    with pytest.raises(InvalidOptionError, match="speeds"):
        rigs.pull(np.array([0.03, np.nan]), np.array([0.4, 0.4]))
    with pytest.raises(InvalidOptionError, match="free"):
        rigs.pull(np.array([0.03, 0.03]), np.array([0.4, 0.4]), roll_torque=np.zeros(2))
    with pytest.raises(InvalidOptionError, match="at least 1"):
        WarpRigs([track(0.4)], which=np.zeros(0, int))


def test_rigs_with_other_parts_do_not_share_a_batch() -> None:
    with pytest.raises(InvalidOptionError, match="the same parts"):
        WarpRigs([track(0.4), tube_rig(TrackedDesign(), friction=0.4)], which=np.array([0, 1]), device="cpu")
