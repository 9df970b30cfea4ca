"""`haustra tracked`: drive the tracked robot through a colon."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

_HELD = 3.0
"""How long it pulls at the string [s]: the pull is steady after some tenths."""


@dataclass(frozen=True)
class TrackedRun:
    """Stand the tracked robot in a colon, drive it, then hold it by a string to see what it could pull."""

    colon: Path
    """Folder of a colon, from `haustra colon import` or `haustra colon grow`."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the run."""
    arc: float = 0.3
    """Where the robot's centre starts [m from the anus]."""
    seconds: float = 20.0
    """Simulated time [s]; it ends earlier where the robot stands still."""
    rpm: float = 150.0
    """Worm speed [turns a minute]."""
    friction: float = 0.4
    """Coulomb coefficient between treads and wall; 0.4 is the paper's tissue phantom, a living bowel has far less."""
    scale: float = 1.0
    """Size of the robot over the device in practice; the published prototype is 4."""
    steer: bool = False
    """Let each tread run at its own speed towards the lumen ahead; the paper's device has one worm for all four."""
    wall: Literal["coacd", "prism"] = "prism"
    """Which wall to use; it is built first if the colon's folder does not have it."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run free and held; write scores.json and outside.png."""
        from haustra.envs.runs.measure.propulsion import SETTLING
        from haustra.envs.runs.tracked_drive import drive_in_colon
        from haustra.errors import InvalidOptionError
        from haustra.files import prepare_folder, write_json
        from haustra.models.anatomy.store import load_colon
        from haustra.models.devices.tracked.design import TrackedDesign
        from haustra.models.devices.tracked.standing import require_fit
        from haustra.models.wall.pieces.folder import wall_of
        from haustra.scripts.console import progress_bar
        from haustra.scripts.wall import wall_bar

        if not SETTLING < self.seconds <= 600:
            raise InvalidOptionError(f"--seconds is {self.seconds}; give a time between {SETTLING} and 600 s.")
        if not 0 <= self.rpm <= 1000:
            raise InvalidOptionError(f"--rpm is {self.rpm}; give a worm speed between 0 and 1000 turns a minute.")
        design = TrackedDesign().at_scale(self.scale)
        colon = load_colon(self.colon)
        require_fit(colon, design, self.arc)
        folder = prepare_folder(self.output)
        with wall_bar() as tell:
            wall = wall_of(self.colon, colon, self.wall, progress=tell)
        speed = design.tread_speed(self.rpm)
        with progress_bar("drive", self.seconds, unit="s") as bar:
            free, held = (
                drive_in_colon(
                    colon,
                    wall,
                    design,
                    arc=self.arc,
                    friction=self.friction,
                    speed=speed,
                    seconds=min(self.seconds, _HELD) if tied else self.seconds,
                    held=tied,
                    steered=self.steer,
                    progress=None if tied else lambda at, arc: bar(at, f"at {arc:.2f} m"),
                )
                for tied in (False, True)
            )
        scores = self._scores(colon, design, free, held)
        write_json(folder / "scores.json", scores)
        if free.outcome == "completed":
            _draw(folder / "outside.png", colon, design, free)
        return scores

    def _scores(self, colon, design, free, held) -> dict[str, Any]:
        from dataclasses import asdict

        import numpy as np

        from haustra.envs.runs.measure.propulsion import SETTLING
        from haustra.envs.runs.tracked_drive import CONTROL_INTERVAL
        from haustra.models.accuracy import NOT_MEASURED
        from haustra.models.anatomy.store import colon_hash
        from haustra.models.devices.tracked.standing import track_radii, where_it_fits
        from haustra.provenance import Provenance

        outcome = "diverged" if "diverged" in (free.outcome, held.outcome) else "completed"
        provenance = Provenance(
            inputs={"colon": colon_hash(colon), "colon_name": colon.name},
            configuration={
                "design": asdict(design),
                "arc": self.arc,
                "seconds": self.seconds,
                "rpm": self.rpm,
                "friction": self.friction,
                "steer": self.steer,
                "wall": self.wall,
            },
        )
        fit = where_it_fits(colon, design)
        scores: dict[str, Any] = {
            "outcome": outcome,
            "ended_by": free.ended_by,
            "advice": _ADVICE[free.ended_by],
            "lumen_under_tracks_mm": (2e3 * track_radii(colon, design, self.arc)).tolist(),
            "reach_mm": [1e3 * design.smallest_diameter, 1e3 * design.largest_diameter],
            "fits_share_of_colon": fit.share,
            "fits_longest_m": [fit.start, fit.end],
            "backend": "native",
            "wall_law": "pieces",
            "mesentery": False,
            "numerical_error": NOT_MEASURED.to_json(),
        }
        if outcome == "completed":
            furthest = int(np.argmax(free.arc))
            moving = max(furthest, 1) * CONTROL_INTERVAL
            treads = design.tread_speed(self.rpm) * moving
            driven = float(free.arc[furthest] - free.arc[0])
            after, tied = free.time >= SETTLING, held.time >= SETTLING
            normal, pressed = free.normal[after], held.normal[tied]
            pull = float(held.leash[tied].mean())
            total = float(pressed.sum(1).mean())
            scores |= {
                "driven_mm": 1e3 * driven,
                "furthest_arc_m": float(free.arc[furthest]),
                "moving_s": moving,
                "treads_ran_mm": 1e3 * treads,
                "driven_share": driven / treads if treads else 0.0,
                "speed_at_end_mm_s": 1e3 * _end_speed(free),
                "normal_per_track_N": normal.mean(0).tolist(),
                "normal_largest_N": float(normal.max()),
                "core_on_wall_N": float(free.core_force[after].mean()),
                "core_on_wall_largest_N": float(free.core_force[after].max()),
                "touching_share_per_track": (normal > 0).mean(0).tolist(),
                "pull_N": pull,
                "pull_over_mu_normal": pull / (self.friction * total) if self.friction * total > 0 else 0.0,
            }
        return scores | {"provenance": provenance.to_json()}


_ADVICE = {
    "time": "it was still on its way: give --seconds more",
    "end of colon": "it came to the caecum",
    "too narrow": "a strut is folded to its stop: give --scale less",
    "too wide": "half of the tracks do not reach the wall: give --scale more",
    "blocked": "the core's end stands against the wall: try --steer",
    "slips": "the treads slip: raise the friction or the bellows' force",
    "diverged": "the step was too long for these forces",
}
"""What stopped the robot, and what to do (`haustra.envs.runs.tracked_drive.EndedBy`)."""


def _end_speed(drive) -> float:
    """Of the core over the last half second [m/s]: next to nothing where something stops it."""
    import numpy as np

    last = int(np.searchsorted(drive.time, drive.time[-1] - 0.5))
    return float(np.linalg.norm(drive.core[-1] - drive.core[last]) / (drive.time[-1] - drive.time[last]))


def _draw(path: Path, colon, design, drive) -> None:
    """The robot's core, at the width its tracks nominally have, where it stands at the end."""
    import numpy as np

    from haustra.envs.view.picture.image import write_png
    from haustra.envs.view.picture.outside import default_rotation, outside_view

    along = np.linspace(-0.5, 0.5, 25)[:, None] * design.core_length * drive.axis
    rotation = default_rotation(colon.lumen, colon.centreline.points)
    points, radius = drive.core[-1] + along, design.smallest_diameter / 2
    write_png(path, outside_view(colon.lumen, points, radius, bending_length=0.0, rotation=rotation))
