"""The runtime type checker that tests put on every function and dataclass of haustra."""

from collections.abc import Iterator
from contextlib import contextmanager

from beartype import BeartypeConf, beartype
from jaxtyping import config

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
"""Holds arguments and results to their annotations, array shapes included; an int may stand for a float."""


@contextmanager
def unchecked() -> Iterator[None]:
    """Leave the checks out where functions are called many thousand times that are checked elsewhere."""
    config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", False)
