"""Doing a recording again, step by step, and comparing bits."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from haustra.envs.console.recording import COLON, Recording
from haustra.envs.console.vehicle import Vehicle
from haustra.envs.console.vehicles import make_vehicle
from haustra.errors import UnreadableFileError
from haustra.provenance import backend_record


@dataclass(frozen=True)
class Repeat:
    """What came of doing a recording again."""

    steps: int
    first_difference: int | None
    """First step whose state differed in any bit; None when none did."""
    same_machine: bool
    """Whether versions and kind of processor are those of the recording."""

    @property
    def exact(self) -> bool:
        """Whether every state was the same to the bit."""
        return self.first_difference is None


def repeat(
    recording: Recording, *, vehicle: Vehicle | None = None, progress: Callable[[int], None] = lambda step: None
) -> Repeat:
    """Do a recording again.

    Args:
        recording: the recording.
        vehicle: at its start; made from the recording when None.
        progress: told the step.

    Raises:
        UnreadableFileError: when the vehicle has other levers now than it was recorded with.
    """
    own = vehicle or make_vehicle(recording.folder / COLON, recording.about["vehicle"])
    now = tuple(lever.name for lever in own.levers)
    if recording.levers != now:
        raise UnreadableFileError(
            f"'{recording.folder}' was recorded with the levers {', '.join(recording.levers)}, and the vehicle has "
            f"{', '.join(now)} now: record it again."
        )
    rows = recording.rows
    conditions, levers, digests = rows["conditions"], rows["levers"], rows["digest"]
    first = None if int(own.look().row["digest"]) == int(digests[0]) else 0
    before = conditions[0]
    for step in range(1, len(levers)):
        if first is not None:
            break
        for number in np.flatnonzero(conditions[step] != before):
            own.change(own.conditions[number].name, float(conditions[step, number]))
        before = conditions[step]
        own.step(levers[step])
        if int(own.look().row["digest"]) != int(digests[step]):
            first = step
        progress(step)
    if vehicle is None:
        own.close()
    return Repeat(len(levers) - 1, first, backend_record(own.backend) == recording.about["provenance"]["backend"])
