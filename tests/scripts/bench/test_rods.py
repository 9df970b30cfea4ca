"""The cable against the rods of the shared data: a sample of shapes and one release; `haustra bench rods` runs all.

Source of the data: SoroSim (a Cosserat rod), as published with ContinuumRoboticsLab/opencr-mujoco.
"""

from dataclasses import replace

import pytest

from haustra.errors import InvalidOptionError, UnreadableFileError
from haustra.scripts.bench.release import release_errors
from haustra.scripts.bench.rod_data import load_rod_data
from haustra.scripts.bench.statics import observed_order, static_errors


@pytest.fixture(scope="module")
def rods(shared_data):
    return load_rod_data(shared_data / "rods")


@pytest.fixture(scope="module")
def sample(rods):
    """Every tenth shape."""
    shapes = rods.shapes
    return type(shapes)(**{name: getattr(shapes, name)[::10] for name in shapes.__dataclass_fields__})


@pytest.mark.parametrize(("joints", "mean"), [(25, 1e-3), (50, 5e-4)])
def test_tips_of_static_shapes_are_where_the_data_has_them(rods, sample, joints, mean):
    found = static_errors(rods.rod, sample, joints)
    assert found.errors.mean() < mean
    assert found.errors.max() < 3 * mean
    assert found.iterations < 6


def test_tips_converge_with_order_two(rods, sample):
    few = type(sample)(**{name: getattr(sample, name)[::5] for name in sample.__dataclass_fields__})
    rows = [static_errors(rods.rod, few, joints) for joints in (16, 32, 64)]
    order = observed_order(rows)[0]
    assert order is not None
    assert order > 1.8


def test_a_release_follows_the_data(rods):
    found = release_errors(rods.rod, rods.releases[0], 25)
    assert found.tip_rms < 1e-3
    assert found.mid_rms < 1e-3


def test_numerical_damping_of_scenes_shows(rods):
    short = rods.releases[0]
    kept = short.time < 2
    short = replace(short, time=short.time[kept], mid=short.mid[kept], tip=short.tip[kept])
    accurate = release_errors(rods.rod, short, 12)
    coarse, fine = (release_errors(rods.rod, short, 12, timestep=step, scheme="as in scenes") for step in (4e-3, 5e-4))
    assert accurate.tip_rms < fine.tip_rms < coarse.tip_rms


def test_an_unstable_step_is_refused(rods):
    with pytest.raises(InvalidOptionError, match="not stable"):
        release_errors(rods.rod, rods.releases[0], 12, timestep=0.01)


@pytest.mark.parametrize("content", ["", "length_m = 1", "length_m = -1\nradius_m=1\n", "\x00"])
def test_a_broken_folder_is_refused(tmp_path, content):
    (tmp_path / "rod.toml").write_text(content)
    with pytest.raises(UnreadableFileError, match=r"rod\.toml"):
        load_rod_data(tmp_path)


def test_broken_tables_are_refused(tmp_path, shared_data):
    (tmp_path / "rod.toml").write_bytes((shared_data / "rods" / "rod.toml").read_bytes())
    with pytest.raises(UnreadableFileError, match="dataStatics"):
        load_rod_data(tmp_path)
    (tmp_path / "a_dataStatics.csv").write_text("rowLabel,a\narc,1\nx,nan\n")
    with pytest.raises(UnreadableFileError, match="shapes"):
        load_rod_data(tmp_path)
    source = shared_data / "rods" / "SpringSteelRodMuJoCo_dataStatics.csv"
    (tmp_path / "a_dataStatics.csv").write_bytes(source.read_bytes())
    (tmp_path / "a_1.txt").write_text("0.1 2 3\n")
    with pytest.raises(UnreadableFileError, match="tip release"):
        load_rod_data(tmp_path)
