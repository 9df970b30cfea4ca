"""`haustra colon check`."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from haustra.fields import number


@dataclass(frozen=True)
class ColonCheck:
    """Say what is good and what is not about a colon, and draw it."""

    folder: tyro.conf.Positional[Path]
    """Folder of a colon, from `haustra colon import` or `haustra colon grow`."""
    device_mm: float = number("mm", 0.1, 100.0, default=12.8)
    """Diameter of the device that is to pass [mm]; an adult colonoscope's when not given."""
    picture: Path | None = None
    """PNG file to draw the colon in; check.png in the colon's folder when not given."""
    json: bool = False
    """Print one JSON document on stdout."""

    def __call__(self) -> dict:
        """Check, draw, and return the verdicts."""
        from haustra.envs.view.picture.check_figure import write_check_figure
        from haustra.models.anatomy.check import check_colon
        from haustra.models.anatomy.store import load_colon

        colon = load_colon(self.folder)
        check = check_colon(colon, device_diameter=self.device_mm * 1e-3)
        picture = write_check_figure(colon, check, self.picture or self.folder / "check.png")
        found = check.to_json()
        if self.json:
            return {"name": colon.name, **found, "warnings": list(colon.warnings), "picture": str(picture)}
        table = {verdict.what: f"{verdict.state}: {verdict.finding}" for verdict in check.verdicts}
        return {
            "colon": colon.name,
            "verdict": check.state,
            **table,
            "warnings": list(colon.warnings),
            "picture": str(picture),
        }
