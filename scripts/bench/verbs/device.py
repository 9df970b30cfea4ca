"""`haustra bench device`: what engineers plot of a device."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class BenchDevice:
    """Put a device on the virtual bench: stiffness, buckling, tip, knob and optics of tubes; pull or grip of others.

    Leaves bench.md, bench.png and bench.json.
    """

    device: Annotated[str, tyro.conf.Positional]
    """Name of a shipped device, or a TOML file."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for the page, the picture and the curves; none are written when not given."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure, draw."""
        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.models.devices.base import load_device
        from haustra.scripts.bench.device_bench import bench_device
        from haustra.scripts.bench.pages.device_page import device_page, draw_bench, shown

        device = load_device(self.device)
        found = {"device": device.name, "kind": device.kind, **bench_device(device)}
        if self.output:
            folder = prepare_folder(self.output)
            page = device_page(device.name, found, command=f"haustra bench device {self.device} -o DIR")
            write_atomically(folder / "bench.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
            draw_bench(folder / "bench.png", found)
            write_json(folder / "bench.json", found)
        if self.json:
            return found
        return {row["quantity"]: f"{shown(row['value'])} {row['unit']}" for row in found["rows"]}
