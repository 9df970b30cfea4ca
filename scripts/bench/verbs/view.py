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
    opengl: bool = True
    """Draw by OpenGL too, where it is there."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure; OpenGL is found out about before MuJoCo is loaded, which asks for it once."""
        from haustra.envs.view.picture.backends import best_backend

        backend = best_backend() if self.opengl else None
        if backend is not None:
            os.environ["MUJOCO_GL"] = backend

        from haustra.models.anatomy.grown import grow_colon
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.accuracy.refined_mesh import with_triangles
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.bench.verbs.rods import joint_counts
        from haustra.scripts.bench.view import bench_rays, bench_shader, bench_view, looked_into
        from haustra.scripts.console import progress_bar

        counts, design = joint_counts(self.joints), named_design("adult")
        colon = with_triangles(grow_colon(seed=0), self.triangles)
        picture = {"width": self.width, "height": self.height}
        looked, rows = looked_into(colon, design, **picture), []
        with progress_bar("view", len(counts) * (3 if backend else 1), unit="sizes") as advance:
            for bench in (bench_rays, bench_shader) if backend else (bench_rays,):
                rows += bench(looked, counts, progress=advance)
            if backend:
                rows += bench_view(colon, design, counts, **picture, progress=advance)
        return {"rows": rows, "opengl": backend, "pixels": f"{self.width} x {self.height}", "machine": machine()}
