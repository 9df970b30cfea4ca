"""What throughput says of memory."""

import pytest

pytest.importorskip("jax")

from haustra.scripts.bench.throughput import Rate, memory_per_world


def _rate(worlds: int, memory: float, devices: int = 1) -> Rate:
    return Rate(worlds, devices, 1.0, 1.0, 1.0, 1.0, 1.0, memory, 1.0, 1.0)


def test_a_world_takes_the_slope_of_memory_over_worlds() -> None:
    rates = [_rate(1, 150.09), _rate(1024, 242.16), _rate(8192, 887.28), _rate(8192, 5.0, devices=2)]
    assert memory_per_world(rates) == pytest.approx(0.09)


def test_a_device_that_does_not_say_has_no_slope() -> None:
    assert memory_per_world([_rate(1, 0.0), _rate(32, 0.0)]) is None
    assert memory_per_world([_rate(32, 100.0)]) is None
