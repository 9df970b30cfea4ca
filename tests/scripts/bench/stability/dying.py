"""Rows of which one ends its process; a module of its own, since every child process imports it."""

import os
from collections.abc import Callable
from typing import Any


def dying(fatal: int) -> Callable[[int], dict[str, Any]]:
    """Answer every row but one."""

    def answer(number: int) -> dict[str, Any]:
        if number == fatal:
            os._exit(7)
        return {"number": number, "outcome": "fine"}

    return answer
