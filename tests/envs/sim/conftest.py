"""The comparisons of tests/physics, here too."""

from tests.physics.conftest import compare

__all__ = ["compare"]
