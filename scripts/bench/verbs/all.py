"""`haustra bench`: run time against error, stability and skipping, on one page."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class BenchAll:
    """Measure run time against error, stability, and what skipping gains; leave one page and one JSON document."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for report.html, bench.json and what each benchmark leaves."""
    quick: bool = False
    """Take some ten minutes on two cores instead of hours."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run all; each goes on where an earlier call was stopped."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.report import report_bench, said
        from haustra.scripts.bench.result import bench_from_json
        from haustra.scripts.bench.verbs.accuracy import BenchAccuracy
        from haustra.scripts.bench.verbs.profile import BenchProfile
        from haustra.scripts.bench.verbs.skip import BenchSkip
        from haustra.scripts.bench.verbs.stability import BenchStability

        folder = prepare_folder(self.output)
        verbs = (BenchAccuracy, BenchStability, BenchSkip, BenchProfile)
        found = [verb(output=folder, quick=self.quick, json=True)() for verb in verbs]
        write_json(folder / "bench.json", {"benches": found})
        benches = [bench_from_json(values) for values in found]
        report = report_bench(folder, benches)
        criteria = [criterion for bench in benches for criterion in bench.criteria]
        return {
            "report": str(report),
            "criteria": len(criteria),
            "criteria_met": sum(criterion.met for criterion in criteria),
            "not_met": [said(criterion) for criterion in criteria if not criterion.met],
        }
