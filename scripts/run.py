"""`haustra run`: drive a device through a colon and score it."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import Number, number, texts, vector, whole

AROUND = ("posture", "mobile", "adhesions", "pressed", "envelope", "rooted", "breathing", "loops_touch", "torsion")
"""Options of the patient around a colon that moves, by their names in `Abdomen`."""


@dataclass(frozen=True)
class Run:
    """Drive a device through a colon; leave scores, trajectory, pictures and a report."""

    colon: Path
    """Folder of a colon, from `haustra colon import` or `haustra colon grow`."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the run's results."""
    device: str | None = None
    """Name of a shipped device (adult, paediatric, adult-worn, adult-variable, those in assets/devices) or a TOML file.
    Adult, or the scope that a policy was trained with, when not given.
    Options that a device does not honour are refused by name."""
    start: float | None = number("m", 1e-3, 5.0, default=None)
    """Distance of the tip from the anus at the start, for a device that begins inside the colon [m]."""
    wall: Literal["coacd", "prism"] = "coacd"
    """Convex pieces to use, by CoACD or by direct cuts; made first if the colon's folder does not have them."""
    preset: Literal["fast", "balanced", "accurate"] = "balanced"
    """How finely the scene is modelled; docs/validation/accuracy.md has the errors and the speed of each."""
    wall_law: Literal["pieces", "planes", "table"] | None = None
    """How the wall is modelled: by a table of the lumen (the default), fast and within 2 % of the surface's forces;
    by convex pieces, which are in scene.xml for any MuJoCo;
    or by tangent planes of the surface itself, at several times the cost of a step."""
    seconds: float = number("s", 0.02, 36_000.0, default=60.0)
    """Longest run, in simulated time [s]."""
    fixed: bool = False
    """Let the colon stand fixed in space instead of swinging, stretching and pleating on its mesentery."""
    posture: Literal["supine", "prone", "left", "right"] = "supine"
    """How the patient lies; colons were imaged supine, and sag when the patient lies otherwise."""
    mobile: tuple[str, ...] = texts(most=2, default=())
    """Segments that hang on a mesentery of their own in this patient: descending, ascending."""
    adhesions: tuple[str, ...] = texts(most=2, default=())
    """Segments that have grown to what is beside them: sigmoid, transverse."""
    pressed: Literal["none", "sigmoid", "transverse"] = "none"
    """Segment on which an assistant's hand presses through the belly."""
    envelope: bool = False
    """Let the abdominal wall and the organs around hold the colon in."""
    rooted: bool = False
    """Let mesenteries hang from their roots, so that loops may be straightened onto them."""
    breathing: bool = False
    """Let quiet breath move what the colon hangs on."""
    loops_touch: bool = False
    """Let loops of the colon press on each other where they meet."""
    torsion: bool = True
    """Let the colon's tube resist that it is twisted about its axis."""
    backend: Literal["native", "linear"] | None = None
    """What steps the scene: MuJoCo's CPU engine (native), or a chain in linear time (linear), many times as fast,
    which knows the table of the lumen only. Linear where that honours what is asked, when not given."""
    friction: float | None = number("1", 0.0, 10.0, default=None)
    """Coulomb's coefficient between device and wall [1]; the sourced default when not given."""
    wall_stiffness: float | None = number("N/m", 1.0, 1e6, default=None)
    """Normal stiffness of a contact with the wall [N/m]; the sourced default when not given."""
    elasticity: str | None = None
    """How the wall's force grows with depth: by a constant stiffness (linear, the default), or by one that grows with
    the force as that of soft tissue (exponential; assumed numbers, docs/numbers.md); the table of the lumen only."""
    friction_rise: float | None = number("s/m", 0.0, 100.0, default=None)
    """Rise of Coulomb's coefficient with sliding speed, as under a film of mucus [s/m]; none when not given."""
    segment_stiffness: bool = False
    """Let the wall's stiffness depend on the segment, by assumed numbers (docs/numbers.md); tangent planes only."""
    push_limit: float | None = number("N", 0.01, 1e3, default=None)
    """Largest force that the hand pushes with [N]; the sourced default when not given."""
    timestep: float | None = number("s", 1e-5, 0.02, default=None)
    """Integration step [s]; that of the preset when not given."""
    driver: str = "follower"
    """Name of who drives a scope: the lumen follower, which knows wall forces (follower), one that works as
    endoscopists do, from what they sense (endoscopist), either by a TOML file of settings, or a policy, by the name of
    one that ships or by its folder. Other devices bring a driver of their own, or are driven by the folder of a policy
    that was trained for them.
    What an endoscopist asks of an assistant is left undone here: --posture and --pressed set it."""
    seed: int = whole(0, 2**31 - 1, default=0)
    """Seed of the actions that a policy draws, as it did in training."""
    steer: Literal["pulls", "wheels"] = "pulls"
    """What bends the tip: pulls as asked for, or the hand wheels, whose wires have slack, stretch and friction."""
    largest_bend_deg: float | None = number("degrees", 0.5, 180.0, default=None)
    """Largest bend of a shaft joint [degrees], from which joints are spaced for this colon; evenly when not given."""
    gravity: tuple[float, float, float] | None = vector(*[Number("m/s^2", -100.0, 100.0)] * 3, default=None)
    """Gravity in the colon's frame [m/s^2]; none when not given."""
    insufflate: str | None = None
    """Let gas in through the scope while the pressure at its tip is less than this ('25mmHg', '3.3kPa').
    Gas sets how wide the lumen is and how taut its wall; without it the lumen is as wide as in the colon's folder."""
    gas_flow: float | None = number("m^3/s", 0.0, 1e-4, default=None)
    """Flow of the gas that insufflation lets in [m^3/s]; 0.25 L/min when not given."""
    gas_start: float | None = number("Pa", 300.0, 8000.0, default=None)
    """Gas pressure that the colon is filled to at the start [Pa]; 15 mmHg when not given."""
    water: str | None = None
    """Water in rectum and sigmoid at the start ('300mL', '0.3L'), in the place of gas; with --insufflate."""
    whole_shaft: bool = False
    """Model all of the shaft from the start, as scene.xml does.
    Otherwise shaft outside the patient is added when needed: faster, and nearly the same until a scope jams."""
    inspect: bool = False
    """Withdraw the scope afterwards at a constant pull-back, and score what its camera has seen of mucosa, polyps and
    landmarks: in `inspection` of the scores, and on a map of the colon. Backend linear."""
    pull_rate: float | None = number("m/s", 5e-4, 0.1, default=None)
    """Speed of the pull-back of --inspect [m/s]; 4 mm/s when not given."""
    treat: Literal["none", "snare", "forceps"] = "none"
    """Stop at each polyp on the way out of --inspect, steer for it, and cut it off or bite into it where the instrument
    reaches it; the colon that is left is written into the folder `after`."""
    error: bool = False
    """Repeat the run at half the time step and with finer joints, some six times as long, to say how far scores differ.
    Without it scores state what was measured on other colons."""
    film: bool = False
    """Draw the run as film.webp, too: what the tip sees beside the colon from outside; some 20 seconds of one core."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Build the scene, run it, write everything."""
        from haustra.envs.learning.find import find_policy
        from haustra.envs.runs.error import own_error, refinements
        from haustra.envs.runs.insertion import Insertion, run_insertion
        from haustra.envs.runs.treatment import Treatment
        from haustra.envs.runs.withdrawal import insert_and_withdraw
        from haustra.envs.simulate import settings_of, simulate
        from haustra.envs.view.run_folder import write_run
        from haustra.errors import InvalidOptionError
        from haustra.files import prepare_folder
        from haustra.models.anatomy.store import load_colon
        from haustra.models.devices.base import load_device
        from haustra.models.devices.scope.interface import Scope
        from haustra.models.presets import find_preset
        from haustra.models.scene import Scene, SceneOptions, build_scene
        from haustra.models.wall.pieces.folder import wall_folder, wall_of
        from haustra.models.wall.pieces.store import METADATA
        from haustra.scripts.console import progress_bar
        from haustra.scripts.wall import wall_bar

        policy = find_policy(self.driver)
        driven = None if policy is None else (policy.drives.device if policy.drives else policy.config.design)
        device = load_device(self.device or driven or "adult")
        if not isinstance(device, Scope):
            from haustra.scripts.run_device import run_any

            return run_any(self, device, policy)
        if policy is not None and policy.drives is not None:
            raise InvalidOptionError(f"The policy '{self.driver}' drives '{policy.drives.device}', not a scope.")
        if self.start is not None:
            raise InvalidOptionError("A scope starts at the anus: leave --start out.")
        design = device.design
        chosen = self._options()
        options = replace(find_preset(self.preset).apply(law=chosen["wall_law"]), **chosen)
        backend = self._chosen_backend(options)
        if not self.inspect and (self.pull_rate is not None or self.treat != "none"):
            raise InvalidOptionError(
                "A pull-back, and treatment on the way out, need a withdrawal: give --inspect too."
            )
        if policy is not None and (backend != "linear" or self.inspect):
            raise InvalidOptionError(
                "A policy inserts on the backend linear: leave --backend, --wall-law, --whole-shaft and --inspect out."
            )
        if self.inspect and (backend != "linear" or options.gas is not None):
            raise InvalidOptionError("A withdrawal is inspected on backend linear, without gas: change the options.")
        settings = settings_of(self.driver, policy, moves=options.mesentery, steer=self.steer, seed=self.seed)
        colon = load_colon(self.colon)
        folder = prepare_folder(self.output)
        wall = None
        if options.wall_law == "pieces":
            with wall_bar() as tell:
                wall = wall_of(self.colon, colon, self.wall, progress=tell)
        elif options.mesentery and (wall_folder(self.colon, self.wall) / METADATA).is_file():
            wall = wall_of(self.colon, colon, self.wall)  # as a picture in scene.xml
        deepest = options.start_depth + settings.advance_rate * self.seconds

        withdrawals: list[tuple[Insertion, Treatment | None]] = []

        def drive(what: str, options: SceneOptions) -> tuple[Scene, Insertion]:
            scene = build_scene(colon, wall, design, options, deepest=deepest)
            with progress_bar(what, self.seconds, unit="s") as advance:
                own: dict[str, Any] = {"seconds": self.seconds}
                own["progress"] = lambda time, arc: advance(time, f"tip at {arc:.2f} m")
                law = {"settings": settings, **own}
                if self.inspect and not withdrawals:
                    tool = None if self.treat == "none" else Treatment(scene, self.treat)
                    run, out = insert_and_withdraw(scene, rate=self.pull_rate, treatment=tool, **law)
                    withdrawals.append((out, tool))
                    return scene, run
                if backend == "native":
                    return scene, run_insertion(scene, backend=self._native(wall, deepest), **law)
                return scene, simulate(scene, driver=self.driver, steer=self.steer, seed=self.seed, **own)

        scene, run = drive("simulate", options)
        error = None
        if self.error:
            error = own_error(run, {name: drive(name, finer)[1] for name, finer in refinements(options).items()})
        touched = wall if options.wall_law == "pieces" else None
        out, tool = withdrawals[0] if withdrawals else (None, None)
        own = {"scene": scene, "wall": touched, "run": run, "seconds": self.seconds, "error": error}
        if not self.film:
            return write_run(folder, withdrawal=out, treatment=tool, **own)
        with progress_bar("film", 1, unit="films") as advance:
            tell = lambda done, total: advance(done / total, f"{done} of {total} pictures")  # noqa: E731
            return write_run(folder, withdrawal=out, treatment=tool, film=tell, **own)

    def _native(self, wall, deepest: float):
        """MuJoCo's CPU engine, with all of the shaft or with what is needed."""
        from haustra.envs.sim.growing import growing
        from haustra.envs.sim.native import NativeEngine

        return NativeEngine if self.whole_shaft else growing(wall, deepest=deepest)

    def _chosen_backend(self, options) -> str:
        """The one asked for, or the fastest that honours the scene."""
        from haustra.errors import UnsupportedSceneError

        if self.backend == "linear" and options.wall_law != "table":
            asked = f"wall law '{options.wall_law}'"
            raise UnsupportedSceneError(f"The backend linear has no {asked}: leave out --backend, or --wall-law.")
        fast = options.wall_law == "table" and not self.whole_shaft
        return self.backend or ("linear" if fast else "native")

    def patient_options(self) -> dict[str, Any]:
        """Scene options of the patient around the device: gas, and what the colon lies in."""
        from haustra.errors import InvalidOptionError
        from haustra.models.wall.abdomen import Abdomen

        flow = ("gas_flow", "gas_start")
        chosen: dict[str, Any] = {name: value for name in flow if (value := getattr(self, name)) is not None}
        if self.insufflate is not None:
            from haustra.models.anatomy.insufflation import pressure_from

            chosen["gas"] = pressure_from(self.insufflate)
        elif chosen or self.water is not None:
            raise InvalidOptionError("Water, or a flow or pressure of gas, needs gas: give --insufflate 25mmHg too.")
        if self.water is not None:
            from haustra.models.gas.water import volume_from

            chosen["water"] = volume_from(self.water)
        around = Abdomen(**{name: getattr(self, name) for name in AROUND})
        return chosen if around == Abdomen() else {**chosen, "abdomen": around}

    def _options(self) -> dict[str, Any]:
        names = ("wall_law", "friction", "wall_stiffness", "push_limit", "timestep", "largest_bend_deg", "gravity")
        names = (*names, "elasticity", "friction_rise")
        chosen = {name: value for name in names if (value := getattr(self, name)) is not None}
        chosen |= self.patient_options()
        chosen.setdefault("wall_law", "planes" if self.segment_stiffness else "table")
        chosen["mesentery"] = not self.fixed and not self.segment_stiffness
        if self.segment_stiffness:
            from haustra.models.scene import usual_segment_stiffness

            chosen["segment_stiffness"] = usual_segment_stiffness()
        return chosen
