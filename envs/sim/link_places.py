"""Where along the colon links are: at the sphere in the middle of each."""

import numpy as np
from jaxtyping import Float, Int


def middle_spheres(link_of_sphere: Int[np.ndarray, " spheres"], links: int) -> Int[np.ndarray, " links"]:
    """The sphere in the middle of each link, of spheres in the links' order; of links without any the next one."""
    ends = np.searchsorted(link_of_sphere, np.arange(links + 1))
    return (ends[:-1] + ends[1:]) // 2


def link_arcs(
    arcs: Float[np.ndarray, "*worlds spheres"], middle: Int[np.ndarray, " links"]
) -> Float[np.ndarray, "*worlds links"]:
    """Arc lengths next to links [m], given those of the spheres and which is in the middle of each link."""
    return arcs[..., np.minimum(middle, arcs.shape[-1] - 1)]
