"""`haustra evaluate`: how well somebody drives, by protocol."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import number, span, texts, whole


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Let drivers insert a scope, or drive another device, into held-out grown colons, or yours; compare them.

    All have the same episodes.
    """

    drivers: Annotated[tuple[str, ...], tyro.conf.Positional] = texts(least=1, most=100)
    """Folders of policies, or names: insertion, insertion-depth, insertion-colour, insertion-easy, withdrawal and, of
    other devices, inchworm and tracked, which ship, random, push, pull, inspect (the last two for withdrawals),
    follower, endoscopist, who in withdrawals turns the tip in circles. For other devices: policies trained for them,
    and own, the driver that each brings."""
    device: str | None = None
    """Device that is no scope, by name or TOML file: its episodes are those of haustra.envs.tasks.device_task. That of
    the first policy, where it drives one, when not given."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for the table, the episodes and pictures; nothing is written when not given."""
    colons: int = whole(1, 1_000_000, default=80)
    """Number of held-out colons, grown from seed 100000 on."""
    colon_folders: tuple[Path, ...] = ()
    """Folders that `haustra colon import` wrote, to drive in instead of grown colons."""
    episodes: int = whole(1, 1_000_000, default=5)
    """Number of episodes in each colon."""
    task: Literal["insertion", "withdrawal"] | None = None
    """What is to be done; as the first policy was trained, or insertion, when not given."""
    design: str | None = None
    """Name of a scope design; that of the first policy, or adult, when not given."""
    difficulty: Literal["any", "easy", "moderate", "difficult", "hard"] | None = None
    """Band of tortuosity of the colons; that of the first policy, or any, when not given."""
    friction: tuple[float, float] | None = span("1", 0.0, 2.0, default=None)
    """Range of Coulomb's coefficient that episodes draw from [1]; that of the first policy's task when not given."""
    mesentery: bool | None = None
    """Let colons move on their mesentery; as the first policy's when not given."""
    insufflate: str | None = None
    """Let gas in through the scope while the pressure at its tip is less than this ('25mmHg', '3.3kPa'); as the first
    policy's task when not given. On backend linear, with --no-video."""
    gas_flow: float | None = number("m^3/s", 0.0, 1e-4, default=None)
    """Flow of the gas that insufflation lets in [m^3/s]; 0.25 L/min when not given."""
    gas_start: float | None = number("Pa", 300.0, 8000.0, default=None)
    """Gas pressure that colons are filled to at the start of an episode [Pa]; 15 mmHg when not given."""
    seconds: float | None = number("s", 0.002, 3600.0, default=None)
    """Longest episode, in simulated time [s]; 300 in insertions and 600 in withdrawals when not given."""
    backend: Literal["native", "linear", "linear-gpu", "warp"] | None = None
    """What computes the physics: MuJoCo on threads (native), the linear-time model on threads (linear) or on an NVIDIA
    GPU (linear-gpu), or MuJoCo Warp on one (warp); linear when not given."""
    threads: int = whole(1, 4096, default=2)
    """Number of threads for physics on the CPU."""
    processes: int = whole(1, 4096, default=2)
    """Number of processes that grow those colons which are not in the cache."""
    sampled: bool | None = None
    """Draw the actions of policies as in training, from the same seed, instead of taking their means; so do policies
    that know how far their actions varied, when not given."""
    blind: bool = False
    """Show policies a lumen that is nowhere, whatever rays or pictures say: what sight is worth."""
    algorithm: Literal["ppo", "sac"] = "ppo"
    """Algorithm that trained a policy given as a Stable-Baselines3 file."""
    trust: bool = False
    """Load Stable-Baselines3's .zip files, which run code that they contain."""
    video: bool = True
    """Draw the best episode of each driver as animated WebP into the folder.
    Drawing takes about a minute for each minute driven, and several where the colon moves."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Evaluate all, write everything."""
        from haustra.envs.learning.evaluate import evaluate
        from haustra.envs.tasks.scope_task import require_task
        from haustra.files import prepare_folder
        from haustra.scripts.console import progress_bar

        device = self.device or self._first_driven()
        if device is not None:
            from haustra.scripts.evaluate_device import evaluate_any

            return evaluate_any(self, device)
        found = [self._driver(name) for name in self.drivers]
        config = self._config(next((task for _, task in found if task), None))
        if config.task == "withdrawal":
            found = [(_on_the_way_out(name, make), own) for name, (make, own) in zip(self.drivers, found, strict=True)]
        seen = [_seeing(config, own) if own else config for _, own in found]
        backend = self.backend or "linear"
        for seeing in seen:
            require_task(seeing, backend)
        folder = None if self.output is None else prepare_folder(self.output)
        bank = self._bank(config)
        done = []
        for name, (make, _), seeing in zip(self.drivers, found, seen, strict=True):
            with progress_bar(name, len(bank.cases) * self.episodes, unit="episodes") as advance:
                done.append(
                    evaluate(
                        make,
                        name,
                        seeing,
                        bank,
                        episodes=self.episodes,
                        threads=self.threads,
                        backend=backend,
                        record=self.video and folder is not None,
                        progress=lambda count, _, tell=advance: tell(count, ""),
                    )
                )
        if folder is not None:
            self._write(folder, done, config, bank, backend)
        own = bool(self.colon_folders)
        colons = [{"colons": one.by_colon()} if own else {} for one in done]
        rows = [_row(one.summary()) | _polyps(one, done) for one in done]
        return {one.driver: row | more for one, row, more in zip(done, rows, colons, strict=True)}

    def _first_driven(self) -> str | None:
        """Device of the first policy; None where that drives a scope, or is none."""
        from haustra.envs.learning.policy import ABOUT, load_any_policy, policy_folder

        for name in self.drivers:
            if (policy_folder(name) / ABOUT).is_file() and (own := load_any_policy(policy_folder(name)).drives):
                return own.device
        return None

    def _write(self, folder: Path, done: list[Any], config: Any, bank: Any, backend: str) -> None:
        from haustra.envs.learning.figures import draw_evaluations
        from haustra.files import write_json
        from haustra.provenance import Provenance, backend_record

        result = {
            "task": config.to_json(),
            "drivers": [one.summary() | {"by_colon": one.by_colon()} | _polyps(one, done) for one in done],
        }
        colons = [str(path) for path in self.colon_folders] or self.colons
        asked = {"task": config.to_json(), "colons": colons}
        provenance = Provenance(inputs={}, configuration=asked, backend=backend_record(backend))
        write_json(folder / "evaluation.json", result | {"provenance": provenance.to_json()})
        write_json(folder / "episodes.json", {one.driver: one.rows() for one in done})
        draw_evaluations(done, folder / "evaluation.png")
        if self.video:
            for number, one in enumerate(done, start=1):
                _draw_video(folder / f"video-{number}-{Path(one.driver).resolve().stem}.webp", one, bank, config)

    def _bank(self, config: Any) -> Any:
        """The colons to drive in."""
        from haustra.envs.tasks.bank import folder_bank, grown_bank
        from haustra.envs.tasks.config import HELD_OUT_SEEDS
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.console import progress_bar

        design = named_design(config.design)
        if self.colon_folders:
            with progress_bar("read", len(self.colon_folders), unit="colons") as advance:
                return folder_bank(self.colon_folders, design, progress=lambda done: advance(done, ""))
        seeds = range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + self.colons)
        with progress_bar("grow", self.colons, unit="colons") as advance:
            return grown_bank(
                seeds,
                design,
                difficulty=config.difficulty,
                processes=self.processes,
                progress=lambda done: advance(done, ""),
            )

    def _driver(self, name: str) -> tuple[Any, Any]:
        """How to make the driver, and the task that it was trained for."""
        from functools import partial

        from haustra.envs.control.laws import DRIVERS
        from haustra.envs.learning.drivers import PolicyDriver
        from haustra.envs.learning.policy import load_policy, policy_folder
        from haustra.envs.tasks.drivers import FollowerDriver, PullDriver, PushDriver, RandomDriver
        from haustra.envs.tasks.inspect_driver import InspectDriver

        simple = {"random": RandomDriver, "push": PushDriver, "pull": PullDriver, "inspect": InspectDriver}
        simple |= {law: partial(FollowerDriver, law=law) for law in DRIVERS}
        if name in simple:
            return simple[name], None
        path = policy_folder(name)
        if path.suffix == ".zip":
            from haustra.scripts.learning_extra import require_learning

            require_learning("stable_baselines3", "torch")
            from haustra.envs.learning.sb3_zip import load_zip
            from haustra.envs.learning.settings import Training

            policy = load_zip(path, Training(algorithm=self.algorithm), trust=self.trust)
        else:
            policy = load_policy(path)
        sampled = policy.deviation is not None if self.sampled is None else self.sampled
        return (lambda task: PolicyDriver(policy, sampled=sampled, blind=self.blind)), policy.config

    def _config(self, own: Any) -> Any:
        from haustra.envs.tasks.config import Limits, TaskConfig
        from haustra.errors import InvalidOptionError

        base = own or _unlearned(self.task or TaskConfig.task)
        names = ("task", "design", "difficulty", "mesentery", "gas_flow", "gas_start")
        named = {name: value for name in names if (value := getattr(self, name)) is not None}
        if self.insufflate is not None:
            from haustra.models.anatomy.insufflation import pressure_from

            named["gas"] = pressure_from(self.insufflate)
        elif base.gas is None and (self.gas_flow, self.gas_start) != (None, None):
            raise InvalidOptionError("A flow or pressure of gas needs gas: give --insufflate 25mmHg too.")
        ranges = replace(base.randomisation, friction=self.friction) if self.friction else base.randomisation
        longest = self.seconds or _LONGEST[named.get("task", base.task)]
        return replace(base, **named, randomisation=ranges, limits=Limits(seconds=longest))


def _unlearned(task: str) -> Any:
    """Rules where no policy says any; in withdrawals with the hand that policies learn with, who decides less often."""
    from haustra.envs.learning.settings import shipped
    from haustra.envs.tasks.config import TaskConfig

    if task == "insertion":
        return TaskConfig(design="adult", observation="state")
    return TaskConfig(design="adult", observation="dict", drive=shipped("withdrawal").task.drive)


def _on_the_way_out(name: str, make: Any) -> Any:
    """How to make the driver of that name for withdrawals."""
    from functools import partial

    from haustra.envs.tasks.inspect_driver import InspectDriver

    return partial(InspectDriver, routine=True) if name == "endoscopist" else make


_LONGEST = {"insertion": 300.0, "withdrawal": 600.0}
"""Longest episode of each task, when nothing else is asked for [s]."""
_OWN = ("observation", "privileged", "memory", "imager", "gas_action", "depth", "pictures", "picture_size", "drive")
"""What a policy brings: what it sees, and the hand that its actions move."""


def _seeing(config: Any, own: Any) -> Any:
    """The rules for all, with what this policy was trained to see, and its own hand.

    Stool and mucus are the colon's, but shown only to who sees colours.
    """
    from haustra.envs.tasks.observation import sizes

    found = replace(config, **{name: getattr(own, name) for name in _OWN}, stool=0.0, mucus=0.0)
    return replace(found, stool=config.stool, mucus=config.mucus) if "pixels" in sizes(found) else found


def _polyps(one: Any, done: list[Any]) -> dict[str, Any]:
    """How much more of the polyps a driver found than each other driver, in withdrawals."""
    others = [other for other in done if other is not one and one.episodes[0].polyps_found is not None]
    return {"polyps_more_than": [one.polyps_more_than(other) for other in others]} if others else {}


def _draw_video(path: Path, evaluation: Any, bank: Any, config: Any) -> None:
    from haustra.envs.learning.video import write_video
    from haustra.scripts.console import progress_bar

    recording = evaluation.recording
    if recording is None:
        return
    episode = evaluation.episodes[recording.number]
    with progress_bar(f"draw {path.name}", len(recording.time), unit="frames") as advance:
        write_video(
            path,
            recording,
            bank,
            title=f"{Path(evaluation.driver).resolve().stem} in {episode.colon}",
            ending="reached, and safe" if episode.safe else episode.reason,
            limits=config.limits,
            progress=lambda done, _: advance(done, ""),
        )


def _row(summary: dict[str, Any]) -> dict[str, Any]:
    names = (
        "episodes",
        "completion",
        "intubation",
        "safe_completion",
        "progress",
        "coverage",
        "coverage_median",
        "polyps",
        "polyps_found",
        "polyps_found_bootstrap",
        "seconds_when_reached",
        "peak_force_N",
        "p_perforation",
        "pain",
        "gas_pressure_peak_mmHg",
        "gas_volume_mL",
    )
    return {
        name: summary[name]
        for name in (
            *(name for name in names if name in summary),
            "mean_force_N",
            "share_over_2N",
            "share_over_safe",
            "tip_ahead_m",
            "reasons",
        )
    } | {
        "completion_95": summary["completion_bootstrap"],
        "progress_95": summary["progress_bootstrap"],
    }
