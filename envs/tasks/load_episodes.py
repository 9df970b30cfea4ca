"""Who works episodes out: the program of a backend in linear time, or numpy."""

from haustra.envs.sim.conditions import Snapshot
from haustra.envs.sim.load import load_backend
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.coverage import Coverage
from haustra.envs.tasks.episode import EpisodeRules
from haustra.envs.tasks.episodes import Episodes, HostEpisodes
from haustra.envs.tasks.sight import Sight


def load_episodes(
    rules: EpisodeRules,
    bank: ColonSet,
    sight: Sight,
    backend: str,
    *,
    worlds: int,
    threads: int,
    steps: int,
    on_host: bool,
    starts: tuple[Snapshot, ...] | None = None,
) -> Episodes:
    """Episodes of many worlds on a backend.

    Args:
        rules: of all episodes.
        bank: the colons.
        sight: rays into them.
        backend: of `haustra.envs.sim.load.NAMES`.
        worlds: how many.
        threads: of the CPU.
        steps: time steps of a control step.
        on_host: work all out by numpy, also where a program can.
        starts: where episodes begin, one a colon of the bank; at the anus when None.

    Raises:
        InvalidOptionError: when there is no backend of that name.
        MissingDependencyError: when what it computes with is not installed.
        UnsupportedSceneError: when the scene has what the backend cannot honour.
    """
    if backend.startswith("linear") and not on_host:
        from haustra.envs.tasks.linear_episodes import LinearEpisodes

        about = {"worlds": worlds, "threads": threads, "steps": steps, "starts": starts}
        return LinearEpisodes(rules, bank, sight, backend, **about)
    own = load_backend(backend, bank.scene, bank.tables, worlds=worlds, threads=threads)
    view = bank.design.tip.field_of_view_deg
    coverage = Coverage(bank.cases, sight, worlds, field_of_view_deg=view) if rules.covers else None
    return HostEpisodes(rules, own, bank, steps=steps, coverage=coverage, starts=starts)
