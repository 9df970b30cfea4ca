"""An everting endoscope's tip as built, for pictures: the lip where its film turns inside out, mouth, lens, lamps.

Nothing here touches or weighs: shapes go with the last link.
"""

import mujoco
import numpy as np

FILM = [0.85, 0.9, 0.95, 0.9]
"""Colour of the film."""
_INSIDE, _GLASS, _LAMP = [0.28, 0.31, 0.36, 1.0], [0.10, 0.16, 0.30, 1.0], [1.0, 0.98, 0.85, 1.0]
_LIP, _MOUTH, _LENS, _LAMPS = 0.84, 0.60, 0.26, 0.12
"""Radii over the body's; engineering choice."""


def draw_tip(spec: mujoco.MjSpec, tip: str, radius: float) -> None:
    """Add what is seen at the tip: a lip around the mouth that the tail is drawn through, the camera within.

    Args:
        spec: the scene.
        tip: site at the nose, its z axis forwards.
        radius: of the body [m].
    """
    site = spec.site(tip)
    for name, wide, behind, ahead, colour in (
        ("lip", _LIP, 0.62, 0.02, FILM),
        ("mouth", _MOUTH, 0.5, 0.05, _INSIDE),
    ):
        site.parent.add_geom(
            name=f"vine/{name}",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            fromto=[0, 0, site.pos[2] - behind * radius, 0, 0, site.pos[2] + ahead * radius],
            size=[wide * radius, 0, 0],
            rgba=colour,
            **_drawn(),
        )
    places = {"lens": ([0.0, 0.0], _LENS, _GLASS)}
    places |= {f"lamp{side:+d}": ([0.4 * side, 0.0], _LAMPS, _LAMP) for side in (-1, 1)}
    for name, (beside, wide, colour) in places.items():
        site.parent.add_geom(
            name=f"vine/{name}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=[*(radius * np.array(beside)), site.pos[2] + 0.05 * radius],
            size=[wide * radius, 0, 0],
            rgba=colour,
            **_drawn(),
        )


def _drawn() -> dict[str, float]:
    """What makes a geom a picture and nothing else."""
    return {"mass": 0.0, "contype": 0, "conaffinity": 0}
