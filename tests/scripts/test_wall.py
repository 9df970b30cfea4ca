"""`haustra wall` writes a wall beside its colon and prints what scripts rely on."""

import json

import numpy as np

from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Surface
from haustra.models.anatomy.store import save_colon
from haustra.models.wall.pieces.store import load_wall
from haustra.provenance import Provenance
from haustra.scripts.main import main

KEYS = {
    *("method", "pieces", "vertices", "intrusion_max_mm", "intrusion_p95_mm", "recess_p95_mm", "rms_mm"),
    *("mean_signed_mm", "rays", "leaks", "seam_step_max_mm", "neighbour_max_mm", "seconds", "cached"),
}


def _tube() -> Colon:
    """A straight tube, 80 mm long, of 20 mm radius."""
    arc = np.linspace(0.0, 0.08, 41)
    angle = 2 * np.pi * np.arange(32) / 32
    ring = 0.02 * np.column_stack([np.cos(angle), np.sin(angle)])
    heights = np.linspace(-0.002, 0.082, 22)
    vertices = np.concatenate(
        [np.column_stack([ring, np.full(32, z)]) for z in heights] + [np.array([[0, 0, -0.002], [0, 0, 0.082]])]
    )
    faces = []
    for k in range(32):
        after = (k + 1) % 32
        for low in range(0, 21 * 32, 32):
            faces += [[low + k, low + after, low + 32 + after], [low + k, low + 32 + after, low + 32 + k]]
        faces += [[704, after, k], [705, 672 + k, 672 + after]]
    points = np.column_stack([np.zeros((41, 2)), arc])
    return Colon(
        name="tube",
        lumen=Surface(vertices, np.array(faces)),
        centreline=Centreline(points, arc, np.tile(np.eye(3), (41, 1, 1))),
        radius=np.full((41, 32), 0.02),
        segments=(ColonSegment("rectum", 0.0, 0.08),),
        provenance=Provenance(inputs={}, configuration={}),
    )


def test_the_verb_prints_one_document_and_writes_the_wall(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path / "cache"))
    folder = save_colon(_tube(), tmp_path / "tube")
    options = ["wall", str(folder), "--method", "prism", "--rays", "2000", "--json"]
    assert main(options) == 0
    printed = json.loads(capsys.readouterr().out)
    assert set(printed) >= KEYS
    assert printed["cached"] is False
    wall = load_wall(folder / "wall-prism")
    assert len(wall.pieces) == printed["pieces"]
    assert main(options) == 0
    assert json.loads(capsys.readouterr().out)["cached"] is True


def test_a_folder_without_a_colon_ends_in_one_line(tmp_path, capsys):
    assert main(["wall", str(tmp_path / "none"), "--json"]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert len(shown.err.strip().splitlines()) == 1


def test_a_wall_over_the_largest_error_is_refused_in_one_line_and_not_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path / "cache"))
    folder = save_colon(_tube(), tmp_path / "tube")
    options = ["--method", "prism", "--tolerance-mm", "3", "--rays", "1000", "--max-error-mm", "0.001", "--json"]
    assert main(["wall", str(folder), *options]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "more than the 0.001 mm asked for" in shown.err
    assert len([line for line in shown.err.splitlines() if line.startswith("haustra:")]) == 1
    assert not (folder / "wall-prism" / "wall.json").exists()
