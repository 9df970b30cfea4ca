"""What tests of imported colons share."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import pytest

from haustra.models.anatomy import check, mesh_colon
from haustra.models.anatomy.lumen_grid import lumen_graph


@contextmanager
def short_ones_allowed() -> Iterator[None]:
    """Tubes of a third of a metre are taken for colons: what is asked of them does not hang on their length.

    They are filled with points about 2 mm apart, as colons of three litres are.
    """
    with pytest.MonkeyPatch.context() as patch:
        for module in (check, mesh_colon):
            patch.setattr(module, "SHORTEST", 0.2)
        patch.setattr(mesh_colon, "lumen_graph", partial(lumen_graph, inside_points=80_000))
        yield
