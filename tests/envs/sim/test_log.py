"""A simulation that blows up leaves no file behind."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.envs.sim.log import log_to_stderr_only


def test_no_log_file_appears_where_the_user_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    log_to_stderr_only()
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qvel[:] = np.nan
    mujoco.mj_step(model, data)
    assert data.warning[int(mujoco.mjtWarning.mjWARN_BADQVEL)].number == 1
    assert "QVEL" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())
