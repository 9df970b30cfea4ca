"""Steps on MuJoCo Warp that Newton's method loses in single precision are made again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS
from haustra.envs.sim.state import Controls
from haustra.envs.tasks.bank import grown_bank
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.models.devices.scope.library import named_design

STATES = Path(__file__).parent / "pressed_scopes.npz"
"""Scopes of native insertions in grown colons that are fixed, seeds 4, 11 and 28 of `bench agreement`, pressed on the
wall by 14 to 25 N a contact: nothing is wrong with them natively."""
OPTIONS = replace(BATCH_OPTIONS, shaft_cell=0.0625, bending_cell=0.034, sample_spacing=0.0315)
"""The cells and spheres that they had."""


def _healthy(monkeypatch: pytest.MonkeyPatch, *, repeats: bool) -> np.ndarray:
    """Which of those scopes are sound after one control interval."""
    import jax
    import jax.numpy as jnp

    from haustra.envs.sim.warp_backend import WarpBackend

    with np.load(STATES, allow_pickle=False) as kept:
        known = {name: jnp.asarray(kept[name]) for name in kept.files}
    count = len(known["colon"])
    with monkeypatch.context() as changed:
        if not repeats:
            changed.setattr(jax.lax, "cond", lambda lost, again, plain, made: plain(made))
        bank = grown_bank(range(8), named_design("adult"), options=OPTIONS)
        config = TaskConfig(design="adult", observation="state")
        backend = ScopeTask(config, worlds=count, backend="warp", bank=bank).backend
        own = {name: known[name] for name in ("colon", "friction", "stiffness", "bending")}
        arcs = jnp.concatenate([known["arcs"], known["tip_arcs"].reshape(count, 1)], axis=1)
        assert isinstance(backend, WarpBackend)
        state = backend._state._replace(
            qpos=known["qpos"], qvel=known["qvel"], hand=known["act"][:, :2], arcs=arcs, pulls=known["arriving"]
        )
        controls = Controls(known["push_rate"], known["roll_rate"], known["pulls"])
        after, _ = backend._advance(backend._parameters._replace(**own), state, controls, 4)
        return np.asarray(after.healthy)


@pytest.mark.slow
def test_what_newtons_method_loses_in_single_precision_conjugate_gradients_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Cholesky's factors of a matrix of condition 10^8 do not exist in 24 bits, or do: by rounding alone."""
    pytest.importorskip("warp", reason="MuJoCo Warp is not installed")
    assert not _healthy(monkeypatch, repeats=False).all()
    assert _healthy(monkeypatch, repeats=True).all()
