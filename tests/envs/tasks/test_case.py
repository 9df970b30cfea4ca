"""Cases and banks: what was written is read, rubbish is refused, the cache answers in milliseconds."""

import time
from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.tasks.bank import grown_bank, make_bank
from haustra.envs.tasks.case import load_case, save_case
from haustra.errors import InvalidOptionError, UnreadableFileError
from haustra.models.devices.scope.library import named_design
from tests.task_bank import DESIGN, short_bank


def test_a_case_reads_as_it_was_written(tmp_path):
    case = short_bank().cases[0]
    again = load_case(save_case(tmp_path / "case.npz", case))
    assert again.name == case.name and again.step == case.step
    assert np.array_equal(again.wall, case.wall) and np.array_equal(again.sight, case.sight)
    for spoiled in (b"", b"PK\x03\x04 nothing"):
        (tmp_path / "case.npz").write_bytes(spoiled)
        with pytest.raises(UnreadableFileError, match="case"):
            load_case(tmp_path / "case.npz")


def test_a_case_is_a_closed_lumen_of_its_radius():
    case = short_bank().cases[0]
    colon = case.colon()
    faces = colon.lumen.faces
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    corners = colon.lumen.vertices[colon.lumen.faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(np.pi * (case.sight.mean(axis=1) ** 2).mean() * case.length, rel=0.02)


def test_a_grown_bank_comes_from_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path))
    design = named_design("adult")
    first = grown_bank([7], design)
    began = time.perf_counter()
    again = grown_bank([7], design)
    assert time.perf_counter() - began < 1.0
    assert np.array_equal(first.cases[0].wall, again.cases[0].wall)
    (entry,) = (tmp_path / "cases").iterdir()
    entry.write_bytes(b"broken")
    assert np.array_equal(grown_bank([7], design).cases[0].wall, first.cases[0].wall)


def test_banks_of_nothing_or_of_another_scope_are_refused():
    with pytest.raises(InvalidOptionError, match="one colon"):
        make_bank([], named_design(DESIGN))
    with pytest.raises(InvalidOptionError, match="diameter"):
        make_bank([replace(short_bank().cases[0], device_radius=0.01)], named_design(DESIGN))
