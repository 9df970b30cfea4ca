"""What the virtual bench tells of one kind of device alone: a file a kind, found by the kind's name."""

from typing import Any


def row(quantity: str, value: float | str | None, unit: str, published: str = "") -> dict[str, Any]:
    """A figure of a design, as JSON values."""
    return {"quantity": quantity, "value": value, "unit": unit, "published": published}
