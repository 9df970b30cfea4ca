"""Where a result comes from: enough to make it again."""

import hashlib
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from haustra.errors import UnreadableFileError

_BACKENDS: Mapping[str, tuple[str, ...]] = {
    "native": (),
    "linear": ("llvmlite",),
    "linear-gpu": ("llvmlite",),
    "warp": ("jax", "jaxlib", "mujoco-mjx", "warp-lang"),
}
"""What each backend computes with besides MuJoCo."""
_ASK_JAX = "import jax; device = jax.devices()[0]; print(device.platform, device.device_kind)"
_LONGEST_ASK = 120.0
"""To begin with a device [s]."""
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
    backend: Mapping[str, str] = field(default_factory=dict)
    """What computed it (`backend_record`); empty where nothing was stepped."""
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


def file_hash(path: Path) -> str:
    """Hash of a file's content.

    Raises:
        UnreadableFileError: when it cannot be read.
    """
    try:
        return content_hash(path.read_bytes())
    except OSError as error:
        raise UnreadableFileError(f"Cannot read '{path}': {error.strerror or error}.") from error


def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that shape results here."""
    return {"python": platform.python_version(), **_versions(_PACKAGES)}


def backend_record(name: str) -> dict[str, str]:
    """Name of a backend, the kind of device it computes on, and versions of what it computes with.

    Args:
        name: native, linear, linear-gpu or warp.
    """
    devices = {"native": _processor, "linear": _processor, "linear-gpu": _nvidia_device, "warp": _jax_device}
    return {"backend": name, "device": devices[name](), **_versions(("mujoco", *_BACKENDS[name]))}


def _versions(packages: Iterable[str]) -> dict[str, str]:
    return {name: found for name in packages if (found := _version(name))}


@cache
def _version(package: str) -> str | None:
    """Version of a package; None where it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    return f"cpu {platform.machine()}"


def _nvidia_device() -> str:
    """Kind of the first NVIDIA GPU, as its driver says."""
    for file in sorted(Path("/proc/driver/nvidia/gpus").glob("*/information")):
        for line in file.read_text(encoding="utf-8").splitlines():
            if line.startswith("Model:"):
                return f"gpu {line.removeprefix('Model:').strip()}"
    return "gpu"


@cache
def _jax_device() -> str:
    """Platform and kind of JAX's first device; a process that has not loaded JAX asks another, and touches none."""
    if (jax := sys.modules.get("jax")) is not None:
        device = jax.devices()[0]
        return f"{device.platform} {device.device_kind}"
    asked = {**os.environ, "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
    try:
        done = subprocess.run(
            [sys.executable, "-c", _ASK_JAX],
            capture_output=True,
            text=True,
            timeout=_LONGEST_ASK,
            env=asked,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return done.stdout.strip()
