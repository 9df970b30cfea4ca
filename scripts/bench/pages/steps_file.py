"""Write assets/stability/steps.json from stability.json.

`python -m haustra.scripts.bench.pages.steps_file stability.json`.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.assets import asset
from haustra.files import write_json
from haustra.scripts.bench.stability.step import REFERENCE, TABLE


def kept_limits(result: Mapping[str, Any]) -> dict[str, Any]:
    """Limits, and the date and versions they were found with."""
    (table,) = (table for table in result["tables"] if table["title"] == TABLE)
    limits = [
        {
            "scene": row["scene"],
            "integrator": row["integrator"],
            "preset": row["preset"],
            "limit_s": round(row["limit_ms"] * 1e-3, 6),
        }
        for row in table["rows"]
    ]
    return {"made_by": "haustra bench stability --only step", "machine": result["machine"], "limits": limits}


if __name__ == "__main__":
    found = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    print(write_json(asset(REFERENCE), kept_limits(found)))
