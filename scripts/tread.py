"""`haustra tread fem`: the finite-element reference of the tread, its tables and its figures."""

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, several, whole

Part = Literal["table", "two-tips", "passage", "convergence"]


@dataclass(frozen=True)
class TreadFem:
    """Solve a tread pressed on tissue and write forces, stresses and figures (needs the extra 'fem').

    All of it takes some 13 minutes on one core; a part that is done is kept, so a call that was cut short goes on.
    The default tread is the shipped tables' own; its unknown lengths are assumed (docs/theory/tracked.md).
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("tread-fem")
    """Folder for CSV tables and figures."""
    parts: tuple[Part, ...] = ("table", "two-tips", "passage", "convergence")
    """What to solve."""
    starts: int = whole(1, 16, default=2)
    """Worm starts; the pitch is the lead of 13 mm over it, the tooth half a pitch."""
    spacing: tuple[float, ...] = several("pitches", 0.5, 20.0, default=(3.0, 3.5), least=1)
    """Tip spacings of 'two-tips' [pitches]; 'passage' takes the first."""
    indentation_mm: float = number("mm", 1e-3, 5.0, default=0.465)
    """Indentation of the tips in 'two-tips', 'passage' and 'convergence' [mm]; calibrated to 1.875 N a track."""
    table_mm: tuple[float, ...] = several("mm", 1e-3, 5.0, default=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8), least=1)
    """Indentations of 'table'."""
    phases: int = whole(1, 1000, default=8)
    """Tooth phases within a pitch."""
    passage_steps: int = whole(1, 1000, default=4)
    """Positions of 'passage' a pitch; the shipped table has 8."""
    friction: float = number("1", 0.0, 2.0, default=0.4)
    """Coulomb's coefficient between teeth and tissue."""
    fresh: bool = False
    """Solve parts again that lie in the folder already, solved with the same settings."""
    figures: bool = True
    """Draw figures like the paper's 6 to 9 beside the tables."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Solve the parts asked for."""
        from haustra.files import prepare_folder, write_json
        from haustra.provenance import Provenance
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        geometry = self._geometry()
        written: list[str] = []
        result: dict[str, Any] = {"geometry_mm": {k: v * 1e3 for k, v in geometry.to_json().items()}}
        solvers: dict[Part, tuple[float, Callable[..., Iterable[dict]]]] = {
            "table": (self.phases * len(self.table_mm), self._table),
            "two-tips": (self.phases * len(self.spacing), self._two_tips),
            "passage": (5 * self.passage_steps + 1, self._passage),
            "convergence": (9, self._convergence),
        }
        began = time.process_time()
        for part in self.parts:
            total, solve = solvers[part]
            settings = self._settings(part, geometry)
            rows = None if self.fresh else _kept(folder, part, settings)
            reused = rows is not None
            if rows is None:
                with progress_bar(f"tread {part}", total, unit="states") as bar:
                    rows = list(solve(geometry, bar))
                _write_csv(folder / f"{part}.csv", rows)
                write_json(folder / f"{part}.json", {"settings": settings, "rows": rows})
            written.append(str(folder / f"{part}.csv"))
            result[part] = rows
            result.setdefault("reused", {})[part] = reused
        result["cpu_s"] = time.process_time() - began
        settings = {part: self._settings(part, geometry) for part in self.parts}
        write_json(folder / "provenance.json", Provenance({}, settings).to_json())
        if self.figures:
            from haustra.scripts.bench.pages.tread_figures import draw

            written += [str(path) for path in draw(folder, geometry, result, self.indentation_mm * 1e-3, self.friction)]
        return result | {"written": written}

    def _settings(self, part: Part, geometry) -> dict[str, Any]:
        """All that a part's rows depend on, as plain JSON values."""
        from haustra import __version__
        from haustra.models.devices.tracked.fem.strip import MeshOptions

        used = {
            "table": {"table_mm": list(self.table_mm), "phases": self.phases},
            "two-tips": {
                "spacing": list(self.spacing),
                "indentation_mm": self.indentation_mm,
                "phases": self.phases,
            },
            "passage": {"indentation_mm": self.indentation_mm, "passage_steps": self.passage_steps},
            "convergence": {"indentation_mm": self.indentation_mm},
        }[part]
        common = {"version": __version__, "friction": self.friction, "geometry": geometry.to_json()}
        return common | {"mesh": asdict(MeshOptions())} | used

    def _geometry(self):
        from haustra.models.devices.tracked.tread import TreadGeometry

        pitch = 13e-3 / self.starts
        return replace(TreadGeometry(), pitch=pitch, tooth_width=pitch / 2, tip_spacing=self.spacing[0] * pitch)

    def _table(self, geometry, bar):
        from haustra.models.devices.tracked.fem.study import force_table

        pressed = [value * 1e-3 for value in self.table_mm]
        return force_table(geometry, pressed, phases=self.phases, friction=self.friction, progress=bar)

    def _two_tips(self, geometry, bar):
        from haustra.models.devices.tracked.fem.study import two_tips

        for spacing in self.spacing:
            at = replace(geometry, tip_spacing=spacing * geometry.pitch)
            options = {"phases": self.phases, "friction": self.friction, "progress": bar}
            for row in two_tips(at, self.indentation_mm * 1e-3, **options):
                yield {"spacing_pitches": spacing} | row

    def _passage(self, geometry, bar):
        from haustra.models.devices.tracked.fem.study import Passage, passage

        course = Passage(steps_per_pitch=self.passage_steps)
        return passage(geometry, self.indentation_mm * 1e-3, course=course, friction=self.friction, progress=bar)

    def _convergence(self, geometry, bar):
        from haustra.models.devices.tracked.fem.study import convergence

        return convergence(geometry, self.indentation_mm * 1e-3, friction=self.friction, progress=bar)


def _kept(folder: Path, part: str, settings: dict[str, Any]) -> list[dict] | None:
    """Rows of a part that an earlier call solved with the same settings; None where there are none."""
    try:
        kept = json.loads((folder / f"{part}.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    same = isinstance(kept, dict) and kept.get("settings") == settings
    return kept["rows"] if same else None


def _write_csv(path: Path, rows: list[dict]) -> Path:
    """Rows of equal keys as CSV, five significant digits: the mesh's error is some percent."""
    from haustra.files import write_atomically

    def cell(value: object) -> str:
        return f"{value:.5g}" if isinstance(value, float) else str(value)

    lines = [",".join(rows[0]), *(",".join(map(cell, row.values())) for row in rows)]
    return write_atomically(path, lambda temporary: temporary.write_text("\n".join(lines) + "\n", encoding="utf-8"))
