"""Where a result comes from: enough to make it again."""

import hashlib
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

_PACKAGES = ("haustra", "mujoco", "numpy", "scipy", "trimesh", "manifold3d", "coacd")


@dataclass(frozen=True)
class Provenance:
    """Input, configuration and versions behind a value."""

    inputs: Mapping[str, str]
    """Name of each input and its content hash (`content_hash`)."""
    configuration: Mapping[str, object]
    """Every option that shaped the result; JSON values only."""
    versions: Mapping[str, str] = field(default_factory=lambda: package_versions())
    """Versions of Python and of the packages that took part."""
    created: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    """UTC time, ISO 8601."""

    def to_json(self) -> dict:
        """As plain JSON values."""
        return asdict(self)


def content_hash(*parts: bytes) -> str:
    """First 16 hex digits of the SHA-256 of the parts, each preceded by its length."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()[:16]


def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that shape results here."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
