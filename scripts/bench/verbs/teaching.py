"""`haustra bench teaching`: what demonstrations of a driver are worth to PPO."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.children import cores
from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchTeaching:
    """Let PPO learn after demonstrations of the endoscopist, or of the follower, and without, for equal steps.

    Goes on where it was cut short.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for recordings, policies and teaching.json."""
    training: Literal["insertion", "insertion-easy"] = "insertion"
    """Shipped training whose episodes they are: colons of any band, or easy ones."""
    episodes: int = whole(1, 10_000, default=20)
    """Demonstrations of each driver, in as many training colons."""
    steps: int = whole(1, 10**9, default=60_000)
    """Environment steps of each training."""
    seeds: int = whole(1, 1000, default=5)
    """Trainings of each arm, with seeds of their own."""
    colons: int = whole(1, 10_000, default=16)
    """Held-out colons, two episodes each."""
    seconds: float = number("s", 1.0, 3600.0, default=240.0)
    """Longest episode [s]."""
    processes: int = whole(1, 4096, default=cores())
    """Processes that work beside each other, a thread each."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Record, train, judge, compare, write."""
        from haustra.files import prepare_folder, write_json
        from haustra.provenance import Provenance, backend_record
        from haustra.scripts.bench.teaching import TEACHERS, Lesson, bench_teaching
        from haustra.scripts.console import progress_bar
        from haustra.scripts.learning_extra import require_learning

        require_learning("torch", "stable_baselines3")
        folder = prepare_folder(self.output)
        lesson = Lesson(self.training, self.episodes, self.steps, self.seeds, self.colons, self.seconds)
        arms = len(lesson.arms(folder)) * self.seeds
        jobs, done = self.episodes * (1 + len(TEACHERS)) + self.colons + 2 * arms + len(TEACHERS), iter(range(10**9))
        with progress_bar("teach", jobs, unit="jobs") as advance:
            tell = lambda said: advance(next(done) + 1, said)  # noqa: E731
            found = bench_teaching(folder, lesson, processes=self.processes, progress=tell)
        provenance = Provenance(inputs={}, configuration=found["lesson"], backend=backend_record("linear"))
        write_json(folder / "teaching.json", found | {"provenance": provenance.to_json()})
        return found
