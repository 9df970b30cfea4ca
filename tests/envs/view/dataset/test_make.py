"""A data set is as exact as it says, is read by loaders of C3VD's conventions, and goes on where it was interrupted."""

import json
from dataclasses import replace

import numpy as np
import pytest
import tifffile
from PIL import Image

from haustra.envs.view.dataset.accuracy import clip_accuracy
from haustra.envs.view.dataset.clip import read_plain
from haustra.envs.view.dataset.make import RECORD, make_dataset
from haustra.envs.view.picture.lens import named_lens
from haustra.errors import InvalidOptionError
from tests.envs.view.dataset.conftest import SETTINGS


@pytest.fixture(scope="module")
def clip(folder):
    return folder / "bend_clip_00"


def test_what_was_written_is_as_exact_as_is_promised(folder):
    """Reprojection within 0.1 pixels, depth within 0.05 mm of exact rays, normals within 0.5 degrees."""
    found = json.loads((folder / RECORD).read_text())["accuracy"]
    assert found["frames"] == 3 and found["flows"] > 2000
    assert 0 < found["reprojection_px"] <= 0.1
    assert 0 < found["depth_error_mm"] <= 0.05
    assert 0 < found["normals_error_deg"] <= 0.5


def test_a_flow_that_is_a_tenth_of_a_pixel_off_is_found(clip, source, tmp_path):
    lens = named_lens("cf-hq190l").at(SETTINGS.width, SETTINGS.height)
    for file in clip.rglob("*"):
        if file.is_file():
            target = tmp_path / file.relative_to(clip)
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(file.read_bytes())
    path = tmp_path / "0002_flow.tiff"
    bits = tifffile.imread(path)
    bits[..., 0] += np.where(bits[..., 0] > 0, round(0.2 / 40 * 65535), 0).astype(np.uint16)
    tifffile.imwrite(path, bits, photometric="rgb")
    assert clip_accuracy(tmp_path, source.scene.colon.lumen.faces, lens).reprojection_px > 0.15


def test_a_loader_of_c3vds_conventions_finds_the_wall_where_it_was(clip):
    """Rays by the published model, names of intrinsics, depth in 16 bits, poses whose rows are columns."""
    own = json.loads((clip / "camera.json").read_text())
    columns, rows = np.meshgrid(np.arange(own["width"]), np.arange(own["height"]))
    plane = np.stack([columns - own["cx"], rows - own["cy"]], axis=-1)
    plane = plane @ np.linalg.inv([[own["c"], own["d"]], [own["e"], 1.0]]).T
    radius = np.hypot(plane[..., 0], plane[..., 1])
    ahead = own["a0"] + own["a2"] * radius**2 + own["a3"] * radius**3 + own["a4"] * radius**4
    rays = np.concatenate([plane, ahead[..., None]], axis=-1)
    faces = _faces(clip)
    positions = np.fromfile(clip / "world_vertex_positions.bin", "<f4").reshape(3, -1, 3)
    poses = [np.fromstring(line, sep=",").reshape(4, 4) for line in (clip / "pose.txt").read_text().splitlines()]
    for frame, pose in enumerate(poses):
        bits = tifffile.imread(clip / f"{frame:04d}_depth.tiff")
        assert bits.dtype == np.uint16 and bits.shape == (own["height"], own["width"])
        known = (bits > 0) & (bits < 65535)
        depth = bits[known] / 65535 * 100
        local = rays[known] * (depth / rays[known][:, 2])[:, None]
        world = np.column_stack([local, np.ones(len(local))]) @ pose
        corners = positions[frame].astype(float)[faces[read_plain(clip, frame)["triangle"][known]]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        off = np.abs(((world[:, :3] - corners[:, 0]) * normal).sum(axis=1))
        assert known.mean() > 0.5
        assert off.max() < 0.01  # [mm]
        seen = tifffile.imread(clip / f"{frame:04d}_normals.tiff")[known] / 65535 * 2 - 1
        assert ((normal @ pose[:3, :3].T) * seen).sum(axis=1) == pytest.approx(-1.0, abs=1e-4)
        assert (seen * rays[known]).sum(axis=1).max() < 0  # towards the camera


def _faces(clip) -> np.ndarray:
    lines = [line.split()[1:] for line in (clip / "coverage_mesh.obj").read_text().splitlines() if line[:2] == "f "]
    return np.array([[int(word.split("/")[0]) - 1 for word in line] for line in lines])


def test_the_mesh_says_what_was_seen(clip):
    lines = [line for line in (clip / "coverage_mesh.obj").read_text().splitlines() if line[:2] == "f "]
    seen = np.array([line.split()[1].endswith("/1") for line in lines])
    shown = np.unique(read_plain(clip, 0)["triangle"])
    assert 0.02 < seen.mean() < 0.98
    assert seen[shown[shown >= 0]].all()


def test_the_wall_moves_and_flow_goes_along(clip):
    """Some vertices move between two pictures; flow says where the same wall was, so depths there agree."""
    positions = np.fromfile(clip / "world_vertex_positions.bin", "<f4").reshape(3, -1, 3)
    assert np.abs(positions[2] - positions[0]).max() > 0.01  # [mm]
    flow = tifffile.imread(clip / "0001_flow.tiff")
    known = (flow[..., :2] > 0).any(axis=-1)
    assert known.mean() > 0.3
    assert not (clip / "0000_flow.tiff").exists()


def test_masks_name_what_is_seen(clip, source):
    triangles = read_plain(clip, 2)["triangle"]
    segment = np.asarray(Image.open(clip / "0002_segment.png"))
    assert set(np.unique(segment)) <= {0, 1, 2}
    assert ((segment > 0) == (triangles >= 0)).all()


def test_a_contact_sheet_shows_colour_and_seven_ground_truths(folder):
    shown = np.asarray(Image.open(folder / "contact.png"))
    assert shown.shape == (77, 8 * 96, 3)
    for part in range(6):  # neither landmark nor polyp is in view of this clip for sure
        assert shown[:, part * 96 : (part + 1) * 96].std() > 1, part


def test_tables_hold_forces_and_hands_of_each_picture(clip):
    import polars

    frames, contacts = (polars.read_parquet(clip / name) for name in ("frames.parquet", "contacts.parquet"))
    assert frames["frame"].to_list() == [0, 1, 2]
    assert frames["push_rate_m_s"][2] > 0
    assert frames["time_s"].diff()[1] == pytest.approx(0.04)
    assert set(contacts.columns) == {"frame", "arc_m", "force_N"}


def test_an_interrupted_data_set_goes_on_and_another_is_refused(folder, source, tmp_path):
    def stop(done: int, _: str) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_dataset(tmp_path, SETTINGS, name="test", sources=iter([source]), progress=stop)
    kept = tmp_path / "bend_clip_00" / "0000_color.png"
    stamp = kept.stat().st_mtime_ns
    make_dataset(tmp_path, SETTINGS, name="test", sources=iter([source]))
    assert kept.stat().st_mtime_ns == stamp
    for name in ("0002_flow.tiff", "0002_depth.tiff", "pose.txt", "world_vertex_positions.bin"):
        assert (tmp_path / "bend_clip_00" / name).read_bytes() == (folder / "bend_clip_00" / name).read_bytes(), name
    with pytest.raises(InvalidOptionError, match="another data set"):
        make_dataset(tmp_path, replace(SETTINGS, frames=4), name="test", sources=iter([source]))


def test_a_run_that_is_too_short_is_refused(source, tmp_path):
    with pytest.raises(InvalidOptionError, match="records"):
        make_dataset(tmp_path, replace(SETTINGS, frames=400), name="test", sources=iter([source]))


def test_camera_and_residue_are_options_and_leave_the_ground_truth(folder, source, tmp_path):
    """Noise, motion blur, a fixed gain, gamma, stool and mucus change colours alone, twice in the same way."""

    def colours(name: str, **options: float) -> np.ndarray:
        settings = replace(SETTINGS, frames=2, **options)
        if not (tmp_path / name).exists():
            make_dataset(tmp_path / name, settings, name="test", sources=iter([source]))
        return np.asarray(Image.open(tmp_path / name / "bend_clip_00" / "0001_color.png")).astype(float)

    plain, fixed = colours("plain"), colours("fixed", gain=3e-5)
    within = named_lens("cf-hq190l").at(SETTINGS.width, SETTINGS.height).within
    noisy = colours("noisy", noise=0.05)
    assert 2.0 < (noisy - plain)[within].std() < 40.0
    np.testing.assert_array_equal(noisy, colours("again", noise=0.05))
    mid = (fixed > 20) & (fixed < 235)
    steep = colours("steep", gain=3e-5, gamma=1.1)
    np.testing.assert_allclose(steep[mid], 255 * (fixed[mid] / 255) ** (2.2 / 1.1), atol=3.0)
    blurred = colours("blurred", exposure=0.04)
    assert np.abs(blurred - plain)[within].max() > 0.5 and np.abs(blurred - plain)[within].mean() < 20.0
    residue = colours("residue", stool=0.7, mucus=0.6)
    assert (np.abs(residue - plain).max(axis=-1) > 5)[within].mean() > 0.1
    for name in ("noisy", "blurred", "residue"):
        for file in ("0001_depth.tiff", "0001_flow.tiff", "0001_segment.png"):
            own, known = (tmp_path / each / "bend_clip_00" / file for each in (name, "plain"))
            assert own.read_bytes() == known.read_bytes()
    assert "noise at full light 0.05" in (tmp_path / "noisy" / "README.md").read_text()
