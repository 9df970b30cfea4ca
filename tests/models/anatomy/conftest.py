"""What tests of imported colons share."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from haustra.models.anatomy import check, mesh_colon


@contextmanager
def short_ones_allowed() -> Iterator[None]:
    """Tubes of half a metre are taken for colons: what is asked of them does not hang on their length."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (check, mesh_colon):
            patch.setattr(module, "SHORTEST", 0.3)
        yield
