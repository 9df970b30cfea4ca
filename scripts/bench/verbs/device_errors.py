"""`haustra bench device-errors`: how far devices other than scopes are off by their time step."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, texts, whole


@dataclass(frozen=True)
class BenchDeviceErrors:
    """Drive devices by their own drivers at their time step and at half of it, in grown colons, fixed and moving.

    Leaves device_errors.json and device_accuracy.toml. Some ten minutes of one core at the defaults.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for what is found; what was finished there is not measured again."""
    devices: tuple[str, ...] = texts(most=16, default=())
    """Devices: names of shipped designs or TOML files; all that ship and are no scopes when none is given."""
    colons: int = whole(1, 1000, default=10)
    """Number of colons grown from seed 0 on; a range over fewer than ten is not stated."""
    seconds: float = number("s", 0.1, 600.0, default=6.0)
    """Length of each run, in simulated time [s]."""
    ship: bool = False
    """Write assets/device_accuracy.toml too, which runs state their errors from."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        import json

        from haustra.assets import asset
        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.models.anatomy.grown import grow_colon
        from haustra.models.devices.base import load_device, shipped_devices
        from haustra.models.devices.scope.interface import Scope
        from haustra.reading import read_document
        from haustra.scripts.bench.device_errors import Differences, accuracy_toml, measure, ranges
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.console import progress_bar

        folder, found = prepare_folder(self.output), []
        devices = [load_device(name) for name in self.devices or shipped_devices()]
        devices = [device for device in devices if not isinstance(device, Scope)]
        colons = [grow_colon(seed=seed) for seed in range(self.colons)]
        with progress_bar("device-errors", 2 * len(devices), unit="devices") as advance:
            for device in devices:
                for moves in (False, True):
                    asked = json.loads(
                        json.dumps({"design": device.describe(), "colons": self.colons, "seconds": self.seconds})
                    )
                    path = folder / f"{device.name}-{'mesentery' if moves else 'fixed'}.json"
                    known = read_document(path, "result") if path.is_file() else {}
                    if known.get("asked") != asked:
                        one = measure(device, colons, seconds=self.seconds, mesentery=moves)
                        known = {"asked": asked, "found": asdict(one)}
                        write_json(path, known)
                    found.append(Differences(**known["found"]))
                    advance(len(found), device.name)
        where = machine()
        text = accuracy_toml(found, where)
        for path in (folder / "device_accuracy.toml", *((asset("device_accuracy.toml"),) if self.ship else ())):
            write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))
        told = {
            f"{each.device}, {'on the mesentery' if each.mesentery else 'fixed'}": {
                **{name: list(span) for name, span in ranges([each]).items()},
                "colons": len(each.rows),
                "diverged": each.lost,
            }
            for each in found
        }
        write_json(folder / "device_errors.json", {"found": [asdict(each) for each in found], "machine": where})
        return {"ranges": told, "machine": where} if self.json else told
