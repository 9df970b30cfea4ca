"""A tethered capsule that a magnetic wrench moves."""
