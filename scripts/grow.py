"""`haustra colon grow`: one colon from a seed, or as many as wanted."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from haustra.fields import whole

if TYPE_CHECKING:
    from haustra.models.anatomy.colon import Colon
    from haustra.models.anatomy.lesion import LesionOrder


@dataclass(frozen=True)
class ColonGrow:
    """Grow an anatomical colon from a seed.

    Lesions are ordered as SEGMENT[@SHARE]:SIZE[:TYPE][*COUNT]: sigmoid:small, transverse@0.3:12mm:pedunculated,
    sigmoid:medium*8. Segments: rectum, sigmoid, descending, transverse, ascending, caecum. Without a SHARE of the
    segment, from its anal end, chance decides where.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the colon; with several cases, one folder for each is made in it."""
    seed: int = whole(0, 2**63 - 1, default=0)
    """Seed of all random draws; the same seed and options grow the same colon on any machine."""
    cases: int = whole(1, 1_000_000, default=1)
    """Number of colons to grow, from this seed on; those already there are kept."""
    cohort: Literal["japan-ctc", "us-ctc"] = "japan-ctc"
    """People whose lengths are taken: 1.50 m on average (japan-ctc, Utano 2021) or 1.90 m (us-ctc, Khashab 2009)."""
    sex: Literal["any", "female", "male"] = "any"
    """Sex of the person; drawn by the cohort's share when any."""
    difficulty: Literal["any", "easy", "moderate", "difficult", "hard"] = "any"
    """Band of tortuosity and redundancy of the colon; any draws from all people."""
    strictures: tuple[str, ...] = ()
    """Strictures to add; sizes mild, moderate, severe, or the throat's diameter like 11mm."""
    diverticula: tuple[str, ...] = ()
    """Diverticula to add; sizes small, medium, large, or the sac's diameter like 6mm."""
    polyps: tuple[str, ...] = ()
    """Polyps to add; sizes diminutive, small, large, or a width like 8mm; types sessile, pedunculated, flat."""
    insufflate: str | None = None
    """Gas pressure that opens the colon ('20mmHg', '2.7kPa'); that of CT colonography, 25 mmHg, when not given."""
    json: bool = False
    """Print one JSON document on stdout."""

    def __call__(self) -> dict[str, Any]:
        """Grow, save, and return the measures."""
        from haustra.files import prepare_folder
        from haustra.models.anatomy.lesion import read_orders

        lesions = (
            *read_orders("stricture", self.strictures),
            *read_orders("diverticulum", self.diverticula),
            *read_orders("polyp", self.polyps),
        )
        prepare_folder(self.output)
        return self._one(lesions) if self.cases == 1 else self._many(lesions)

    def _one(self, lesions: "tuple[LesionOrder, ...]") -> dict[str, Any]:
        from haustra.models.anatomy.properties import describe
        from haustra.models.anatomy.store import save_colon

        began = time.perf_counter()
        with _stages() as progress:
            colon = self._grow(self.seed, lesions, progress)
        measures = describe(colon)
        save_colon(colon, self.output)
        return {**measures, "folder": str(self.output), "seconds": time.perf_counter() - began}

    def _many(self, lesions: "tuple[LesionOrder, ...]") -> dict[str, Any]:
        from haustra.errors import HaustraError
        from haustra.models.anatomy.store import save_colon
        from haustra.scripts.console import progress_bar

        began, grown, failed = time.perf_counter(), 0, {}
        with progress_bar("growing", self.cases, unit="colons") as advance:
            for done in range(self.cases):
                seed = self.seed + done
                folder = self.output / f"seed-{seed:06d}"
                advance(done, folder.name)
                if self._is_there(folder, seed, lesions):
                    continue
                try:
                    save_colon(self._grow(seed, lesions), folder)
                    grown += 1
                except HaustraError as error:
                    failed[str(seed)] = str(error)
            advance(self.cases, "")
        return {
            "folder": str(self.output),
            "cases": self.cases,
            "grown": grown,
            "kept": self.cases - grown - len(failed),
            "failed": failed,
            "seconds": time.perf_counter() - began,
        }

    def _grow(
        self, seed: int, lesions: "tuple[LesionOrder, ...]", progress: Callable[[str], None] = lambda stage: None
    ) -> "Colon":
        from haustra.models.anatomy.grown import grow_colon

        return grow_colon(
            seed=seed,
            cohort=self.cohort,
            sex=self.sex,
            difficulty=self.difficulty,
            lesions=lesions,
            pressure=self._pressure(),
            progress=progress,
        )

    def _pressure(self) -> float | None:
        from haustra.models.anatomy.insufflation import pressure_from

        return None if self.insufflate is None else pressure_from(self.insufflate)

    def _is_there(self, folder: Path, seed: int, lesions: "tuple[LesionOrder, ...]") -> bool:
        """Whether the folder holds the colon that these options and this version would grow."""
        from dataclasses import asdict

        from haustra.errors import UnreadableFileError
        from haustra.models.anatomy.store import load_colon
        from haustra.provenance import package_versions

        try:
            made = load_colon(folder).provenance
        except UnreadableFileError:
            return False
        asked = {
            "method": "grown",
            "seed": seed,
            "cohort": self.cohort,
            "sex": self.sex,
            "difficulty": self.difficulty,
            "lesions": [asdict(order) for order in lesions],
            "pressure": self._pressure(),
        }
        same = all(made.configuration.get(name) == value for name, value in asked.items())
        return same and made.versions == package_versions()


@contextmanager
def _stages() -> Iterator[Callable[[str], None]]:
    """A spinner on stderr that names the stage at work."""
    from rich.console import Console

    with Console(stderr=True).status("starting") as status:
        yield lambda stage: status.update(stage)
