# Warp's kernels are a language of their own, which a type checker of Python cannot follow.
from typing import Any

def __getattr__(name: str) -> Any: ...
