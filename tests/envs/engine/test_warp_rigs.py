"""MuJoCo Warp pulls as the native engine does. On a CPU its kernels take a minute to compile: not in CI."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the extra warp is not installed")

from haustra.envs.engine.warp_rigs import WarpRigs
from haustra.envs.measure.propulsion import pull
from haustra.errors import InvalidOptionError
from haustra.models.tracked.design import TrackedDesign
from haustra.models.tracked.law import PadLaw, load_table
from haustra.models.tracked.rig import Rig, flat_rig

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def track(friction: float) -> Rig:
    design = TrackedDesign()
    law = PadLaw.fit(load_table(design.tread))
    return flat_rig(design, friction=friction, indentation=law.indentation(design.bellows.preload / 2))


@pytest.mark.slow
def test_each_world_pulls_as_it_does_alone() -> None:
    """Single against double precision: forces within 1e-4, ripple within 1e-3."""
    speeds, frictions = np.array([0.065, 0.0325, 0.065]), np.array([0.4, 0.4, 0.2])
    many = WarpRigs(track(0.4), worlds=3, device="cpu").pull(speeds, frictions)
    assert many.sound.all()
    for world in range(3):
        alone = pull(track(frictions[world]), speeds[world])
        assert many.force[world] == pytest.approx(alone.mean, rel=1e-4)
        assert many.normal[world] == pytest.approx(alone.normal.mean(), rel=1e-4)
        np.testing.assert_allclose(many.ripple[world], alone.ripple(), rtol=1e-3, atol=1e-5)


def test_impossible_inputs_are_refused() -> None:
    rigs = WarpRigs(track(0.4), worlds=2, device="cpu")
    with pytest.raises(InvalidOptionError, match="each of the 2 worlds"):
        rigs.pull(np.array([0.03]), np.array([0.4]))
    with pytest.raises(InvalidOptionError, match="speeds"):
        rigs.pull(np.array([0.03, np.nan]), np.array([0.4, 0.4]))
    with pytest.raises(InvalidOptionError, match="at least 1"):
        WarpRigs(track(0.4), worlds=0)
