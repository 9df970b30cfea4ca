"""What every test may use. Importing haustra here, and nowhere earlier, puts the runtime type checks on it."""

import gc
import os
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

# Read when JAX begins: it compiles what most tests run once, and takes a third longer to make that fast.
os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=0")

from jaxtyping import install_import_hook
from runtime_types import check_anew, spare_what_is_unchecked, unchecked

# Compiled from their sources, which the checks would change.
import haustra.envs.view.picture.cover
import haustra.envs.view.picture.kernels

with suppress(ImportError):  # so is this, for the GPU
    import haustra.envs.runs.warp_kernels  # noqa: F401

spare_what_is_unchecked()
install_import_hook("haustra", "runtime_types.check")


def _written_without_checks() -> None:
    """Write programs of linear time without checks: laws call each other a hundred thousand times a program, and the
    same laws are checked wherever they compute with arrays."""
    from haustra.envs.sim.linear import compile as programs

    written = programs._step

    def step(*arguments: Any) -> None:
        with unchecked():
            written(*arguments)

    programs._step = step


_written_without_checks()


def _compiled_quickly() -> None:
    """Compile programs of linear time as they are written: to better them takes LLVM three times as long as that, and
    most tests run one for a second. What it changes, rounding, is a test (tests/envs/sim/linear/test_compile.py)."""
    from haustra.envs.sim.linear import compile as programs

    programs._PASSES = 0


_compiled_quickly()


_FOR_JAX = pytest.StashKey[TemporaryDirectory[str]]()

_ALLOCATIONS = 100_000, 10, 10
"""How rarely garbage is looked for: each time, Python walks through a million objects, which took a quarter of some
tests' time at its own 700 allocations; engineering choice."""


def pytest_configure(config: pytest.Config) -> None:
    """Look for garbage rarely, and bring compiled code before workers start: once a run."""
    gc.set_threshold(*_ALLOCATIONS)
    from tests import kept_code

    if not hasattr(config, "workerinput"):
        kept_code.bring()
    config.stash[_FOR_JAX] = TemporaryDirectory(prefix="compiled-by-jax-")
    kept_code.lend_to_jax(Path(config.stash[_FOR_JAX].name))


def pytest_collection_finish() -> None:
    """Let what was imported be, which no test throws away: garbage is looked for in the rest."""
    gc.collect()
    gc.freeze()


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep it for the next checkout."""
    from tests import kept_code

    if not hasattr(session.config, "workerinput"):
        kept_code.keep()
    with session.config.stash[_FOR_JAX] as folder:
        kept_code.take_from_jax(Path(folder))


@pytest.fixture(autouse=True)
def _first_calls_are_checked() -> None:
    check_anew()


_SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real colons and measured rods beside the checkout. Where they are missing, tests skip; in CI they fail."""
    if not _SHARED_DATA.is_dir():
        message = f"no shared data at {_SHARED_DATA}"
        if os.environ.get("CI"):
            pytest.fail(message)
        pytest.skip(message)
    return _SHARED_DATA
