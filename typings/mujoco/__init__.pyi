# MuJoCo's compiled modules come without type information: any name is taken as known.
from typing import Any

def __getattr__(name: str) -> Any: ...
