"""A real colon, whose bends at rest are sharper than its lumen is wide, moves without falling or turning over."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.tasks.bank import make_bank
from haustra.envs.tasks.case import case_of
from haustra.envs.tasks.config import Limits, Randomisation, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.models.anatomy.mesh_colon import import_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import entry_of
from haustra.models.wall.signed_distance import surface_arcs
from haustra.models.wall.unfolding import facing_out

_SECONDS, _SEEDS = 20.0, range(8)
_FASTEST = 40.0
"""No section turns about the axis faster for longer than a moment [rad/s]: those that rocked came to 65 and more."""


def test_sections_of_a_real_colon_do_not_rock_under_a_scope(shared_data: Path):
    name, design = "EdinGCA_3D_00020", named_design("paediatric-long")
    rest = import_colon(shared_data / "colons" / f"{name}_lumen_mm.stl", units="mm", name=name)
    bank = make_bank([case_of(rest, device_radius=design.diameter / 2)], design).with_mesentery(True)
    slippery = replace(Randomisation(), friction=(0.03, 0.05))
    limits = Limits(seconds=_SECONDS, perforation_force=9e3)
    config = TaskConfig(design="paediatric-long", limits=limits, mesentery=True, randomisation=slippery)
    task = ScopeTask(config, worlds=len(_SEEDS), backend="linear", bank=bank)
    seen, driver = task.reset(seeds=list(_SEEDS)), FollowerDriver(task)
    driver.begin(np.ones(len(_SEEDS), bool))
    rocked, force, pose = np.zeros(len(_SEEDS)), 0.0, np.zeros(0)
    for _ in range(round(_SECONDS / task.interval)):
        done = task.step(driver.act(seen))
        seen, force = done.observation, max(force, float(done.info["wall_force"].max()))
        assert not done.info["diverged"].any()
        assert isinstance(task.backend, LinearBackend)
        moved = task.backend.state().displacement
        assert moved is not None
        pose = moved.pose
        spins = np.abs(moved.speed[..., 3]).max(axis=1)
        rocked += spins > _FASTEST
    task.close()
    assert rocked.max() <= 2
    assert force < 60.0
    current, arcs = CurrentColon(rest, bank.tables, *entry_of(rest)), surface_arcs(rest)
    for world in (0, 3):
        now = current.colon(pose[world])
        assert not (facing_out(rest, arcs) & ~facing_out(now, arcs)).any()
