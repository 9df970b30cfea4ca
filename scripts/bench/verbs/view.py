"""`haustra bench view`: pictures a second from the tip's camera while the scope moves."""

import os
from dataclasses import dataclass, field
from typing import Any

from haustra.fields import whole


@dataclass(frozen=True)
class BenchView:
    """Move a scope through a finely meshed colon and draw what its camera sees, by OpenGL and without."""

    joints: str = "40,60,80,100,120,140"
    """Numbers of joints, separated by commas."""
    triangles: int = whole(1000, 10**8, default=623_805)
    """Number of the lumen's triangles; by default that of the published scene."""
    width: int = whole(16, 8192, default=640)
    """Columns of a picture [pixels]."""
    height: int = whole(16, 8192, default=480)
    """Rows of a picture [pixels]."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure; OpenGL is found out about before MuJoCo is loaded, which asks for it once."""
        from haustra.envs.view.picture.backends import best_backend, probe_backends
        from haustra.errors import MissingDependencyError

        backend = best_backend()
        if backend is None:
            reasons = "; ".join(f"{name}: {verdict}" for name, verdict in probe_backends().items())
            raise MissingDependencyError(f"MuJoCo's renderer works with no OpenGL back-end here ({reasons}).")
        os.environ["MUJOCO_GL"] = backend

        from haustra.envs.sim.jax_setup import describe_device, use_jax

        device = describe_device(use_jax())
        from haustra.models.anatomy.grown import grow_colon
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.accuracy.refined_mesh import with_triangles
        from haustra.scripts.bench.verbs.rods import joint_counts
        from haustra.scripts.bench.view import bench_view, software_rate
        from haustra.scripts.console import progress_bar

        counts = joint_counts(self.joints)
        grown = grow_colon(seed=0)
        colon = with_triangles(grown, self.triangles)
        with progress_bar("view", len(counts), unit="sizes") as advance:
            rows = bench_view(
                colon, named_design("adult"), counts, width=self.width, height=self.height, progress=advance
            )
        return {
            "rows": rows,
            "software_frames_per_s": software_rate(grown),
            "opengl": backend,
            "pixels": f"{self.width} x {self.height}",
            "device": device,
        }
