"""The haptic port under a device that asks a thousand times a second, and under one that is killed."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.console.haptic import HapticClient, HapticPort
from haustra.envs.console.session import Session
from haustra.envs.console.source import Drive
from haustra.envs.console.vehicles import make_vehicle

_DEVICE_RATE = 1000.0
"""Rate at which the haptic client asks, as far as it is answered [Hz]."""
_KILLED = 10
"""Clients that are killed, one after the other."""
_PUSHES = """
import sys, time
from haustra.envs.console.haptic import HapticClient
client, begun = HapticClient(int(sys.argv[1])), time.perf_counter()
while True:
    client.ask(0.02 * (time.perf_counter() - begun) % 0.02, 0.0)
    print(flush=True)
    time.sleep(0.001)
"""


def measure_haptic(colon: Path, configuration: dict[str, Any], *, seconds: float) -> dict[str, float]:
    """Let a device push at a kilohertz, and kill others while they push.

    Returns:
        Answers in a second, on average and in the worst whole second, round trip and the time between answers [ms],
        and how long after its client was killed the hand had let go at the latest [ms].
    """
    source = Drive([Session(make_vehicle(colon, configuration))], size=64)
    source.start(lambda what, message: None)
    source.command({"pause": False})
    try:
        with HapticPort(source) as port:
            trips, at = _asked(port, seconds)
            killed = [_kill(port) for _ in range(_KILLED)]
    finally:
        source.close()
    gaps = 1e3 * np.diff(at)
    each = np.bincount(at.astype(int))[: max(1, int(at[-1]))]
    return {
        "rate_Hz": len(at) / at[-1],
        "rate_worst_second_Hz": float(each.min()),
        "seconds_below_500_Hz": float((each < 500).sum()),
        "round_trip_median_ms": 1e3 * float(np.median(trips)),
        "round_trip_99_ms": 1e3 * float(np.quantile(trips, 0.99)),
        "gap_99_ms": float(np.quantile(gaps, 0.99)),
        "gap_deviation_ms": float(gaps.std()),
        "gap_max_ms": float(gaps.max()),
        "let_go_ms": 1e3 * max(killed),
    }


def _asked(port: HapticPort, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Round trips, and when answers came from the beginning on [s]."""
    client, trips, at = HapticClient(port.port), [], []
    begun = time.perf_counter()
    while (now := time.perf_counter()) < begun + seconds:
        trips.append(client.ask(0.005 * np.sin(now - begun), 0.0)[2])
        at.append(time.perf_counter() - begun)
        rest = len(at) / _DEVICE_RATE - at[-1]
        if rest > 0:
            time.sleep(rest)
    client.close()
    return np.array(trips), np.array(at)


def _kill(port: HapticPort) -> float:
    with subprocess.Popen(
        [sys.executable, "-c", _PUSHES, str(port.port)], stdout=subprocess.PIPE, env=os.environ
    ) as pushing:
        assert pushing.stdout is not None
        while not port.holds:
            pushing.stdout.readline()
        for _ in range(100):
            pushing.stdout.readline()
        pushing.kill()
        killed = time.perf_counter()
    while port.holds:
        time.sleep(0.001)
    return port.let_go_at - killed
