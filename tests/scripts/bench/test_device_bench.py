"""The virtual bench: what is measured on the chain is what the design says, and what is published."""

import json
from dataclasses import replace

import numpy as np
import pytest

from haustra.models.devices.base import load_device
from haustra.models.devices.scope.library import at_body_temperature, named_design
from haustra.scripts.bench import curved_tube, device_bench
from haustra.scripts.bench.curved_tube import BEND_RADIUS, BORE, TubeBench, bending_force
from haustra.scripts.bench.device_bench import (
    PUPIL,
    TARGET,
    bench_device,
    buckling_force,
    knob_loop,
    lens_half_angle,
    stiffness_profile,
    tip_force,
)
from haustra.scripts.main import SUCCESS, main


@pytest.fixture(scope="module")
def adult():
    return named_design("adult")


def test_stiffness_is_that_of_the_design_and_of_a_published_scope(adult):
    """Wehrmeyer: EI 260 to 400 N cm^2, GJ 68 to 88 N cm^2 per degree; 17 and 7 % less at 37 degrees Celsius."""
    cold, warm = stiffness_profile(adult), stiffness_profile(at_body_temperature(adult))
    shaft = cold["along_m"] < adult.shaft[0].length
    ei, gj = cold["EI_N_cm2"][shaft], cold["GJ_N_cm2_deg"][shaft][:-4]
    np.testing.assert_allclose(ei, adult.shaft[0].flexural_rigidity * 1e4, rtol=1e-3)
    np.testing.assert_allclose(gj, adult.shaft[0].torsional_rigidity * 1e4 * np.pi / 180, rtol=0.05)
    assert ei.min() >= 260 and ei.max() <= 400 and gj.min() >= 68 and gj.max() <= 88
    assert (warm["EI_N_cm2"] / cold["EI_N_cm2"])[shaft].mean() == pytest.approx(0.83, abs=0.001)
    assert (warm["GJ_N_cm2_deg"] / cold["GJ_N_cm2_deg"])[shaft].mean() == pytest.approx(0.93, abs=0.001)


@pytest.mark.parametrize(
    ("angle", "friction"), [(np.pi / 2, 0.3), pytest.param(2 * np.pi, 0.1, marks=pytest.mark.thorough)]
)
def test_torque_goes_through_bends_less_what_friction_takes(adult, angle, friction):
    """mu r times the sum of the wall's forces; a rod that is alike all round turns at its tip as at its handle."""
    turns = []
    for mu in (0.0, friction):
        bench = TubeBench(adult, angle, friction=mu)
        bench.push_through()
        turns.append(bench.turn())
    smooth, rough = turns
    assert smooth.ratio == pytest.approx(1.0, abs=0.01) and rough.ratio == pytest.approx(1.0, abs=0.01)
    taken = friction * adult.diameter / 2 * rough.wall_force
    assert rough.torque - smooth.torque == pytest.approx(taken, rel=0.04)
    assert rough.lag > smooth.lag


def test_without_friction_a_bend_takes_what_bending_takes_up(adult):
    """EI / (2 R^2), R between that of the tube's axis and of a scope on its outer side."""
    push = TubeBench(adult, np.pi / 2, friction=0.0).push_through().push
    least = bending_force(adult, radius=BEND_RADIUS + BORE - adult.diameter / 2)
    assert least < push.max() < bending_force(adult)
    assert TubeBench(adult, np.pi / 2, friction=0.1).push_through().push.max() > push.max()


def test_field_of_view_is_what_the_lens_shows(adult):
    """An equidistant lens ends at its angle; a CF-HQ190L shows 126 degrees across, more at its mask's corners."""
    ideal = replace(adult, tip=replace(adult.tip, lens="equidistant", field_of_view_deg=120.0))
    assert 2 * np.degrees(lens_half_angle(ideal)) == pytest.approx(120.0, abs=0.6)
    assert 126.0 < 2 * np.degrees(lens_half_angle(adult)) < adult.tip.field_of_view_deg
    rows = {row["quantity"]: row["value"] for row in device_bench._optics(ideal)}
    method_a = 2 * np.degrees(np.arctan((TARGET + PUPIL) / TARGET * np.tan(np.radians(60))))
    assert rows["field of view, method A (from the distal window)"] == pytest.approx(method_a, abs=0.6)


def test_long_free_shafts_buckle_by_euler(adult):
    """pi^2 EI / L^2, which cells of 50 mm in 0.5 m come to within 1 %."""
    euler = np.pi**2 * adult.shaft[0].flexural_rigidity / 0.5**2
    assert buckling_force(adult, 0.5) == pytest.approx(euler, rel=0.01)


def test_wires_without_losses_follow_the_knob_and_worn_ones_lag(adult):
    """Slack of 2 mm at 5 mm from the axis is 23 degrees of the tip; friction makes the way back another."""
    stiff = replace(adult, wires=replace(adult.wires, compliance=0.0))
    knob, tip = knob_loop(stiff)
    np.testing.assert_allclose(tip[np.abs(knob) < 150], knob[np.abs(knob) < 150], atol=0.5)
    slack = replace(stiff, wires=replace(stiff.wires, slack=0.002))
    knob, tip = knob_loop(slack)
    idle = np.abs(knob)[np.abs(tip) < 0.5].max()
    assert idle == pytest.approx(np.degrees(0.001 / adult.wires.routing_radius), abs=2.0)
    worn = named_design("adult-worn")
    knob, tip = knob_loop(worn)
    assert np.abs(tip).max() < 0.9 * worn.limits.up
    assert np.abs(tip[:200] - np.interp(knob[:200], knob[200:][::-1], tip[200:][::-1])).max() > 10.0


def test_the_tip_presses_less_the_more_it_is_bent(adult):
    _, force = tip_force(adult)
    assert (np.diff(force) < 0).all()
    tube = adult.bending.length + adult.tip.length
    assert force[0] == pytest.approx(adult.wires.pull_limit * adult.wires.routing_radius / tube)


@pytest.mark.parametrize("name", ["vine", "tracked", "capsule", "inchworm"])
def test_every_kind_has_its_figures(name):
    found = bench_device(load_device(name))
    assert any("ISO 8600-4" in row["quantity"] for row in found["rows"])
    assert json.dumps(found, allow_nan=False) and found["curves"]


def test_the_verb_leaves_page_picture_and_numbers(tmp_path, capsys, monkeypatch):
    """With a hasty hand and a lens that is not measured: both have their tests above."""
    monkeypatch.setattr(device_bench, "lens_half_angle", lambda _: np.radians(63.0))
    for name, hasty in {"PUSH_RATE": 0.08, "_REST": 0.2, "_TURN": 0.5}.items():
        monkeypatch.setattr(curved_tube, name, hasty)
    assert main(["bench", "device", "adult", "-o", str(tmp_path), "--json"]) == SUCCESS
    told = json.loads(capsys.readouterr().out)
    assert told["rows"] == json.loads((tmp_path / "bench.json").read_text())["rows"]
    assert "Wehrmeyer" in (tmp_path / "bench.md").read_text() and (tmp_path / "bench.png").stat().st_size > 1000
