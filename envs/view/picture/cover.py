"""Compiled loops of the rasteriser: which pixel centres triangles cover, and how layers of a thin wall add up.

Nothing here imports haustra, since its tests put type checks on what they import, which numba cannot compile.
"""

import numpy as np
from numba import njit


@njit(nogil=True, cache=True, error_model="numpy")
def cover(corners, chosen, first, size, width, candidates):
    """Pixels, triangles and barycentric coordinates where triangles cover pixel centres.

    Args:
        corners: columns and rows of every triangle's corners.
        chosen: which triangles.
        first: column and row of the first pixel of each one's bounding box.
        size: columns and rows of the box.
        width: columns of the picture.
        candidates: pixels of all boxes.
    """
    pixel, triangle = np.empty(candidates, np.int64), np.empty(candidates, np.int64)
    weights = np.empty((candidates, 3))
    found = 0
    for k in range(len(chosen)):
        t = chosen[k]
        ax, ay = corners[t, 0, 0], corners[t, 0, 1]
        bx, by = corners[t, 1, 0] - ax, corners[t, 1, 1] - ay
        cx, cy = corners[t, 2, 0] - ax, corners[t, 2, 1] - ay
        scale = 1.0 / (bx * cy - by * cx)
        for row in range(first[k, 1], first[k, 1] + size[k, 1]):
            y = row + 0.5 - ay
            for column in range(first[k, 0], first[k, 0] + size[k, 0]):
                x = column + 0.5 - ax
                at_b, at_c = scale * (x * cy - y * cx), scale * (y * bx - x * by)
                at_a = 1.0 - at_b - at_c
                if at_a >= 0.0 and at_b >= 0.0 and at_c >= 0.0:
                    pixel[found], triangle[found] = row * width + column, t
                    weights[found, 0], weights[found, 1], weights[found, 2] = at_a, at_b, at_c
                    found += 1
    return pixel[:found].copy(), triangle[:found].copy(), weights[:found].copy()


@njit(nogil=True, cache=True)
def keep_nearest(depth, triangle, weights, pixel, own_depth, own_triangle, own_weights):
    """Put fragments into a depth buffer where they are nearer than what it holds."""
    for k in range(len(pixel)):
        at = pixel[k]
        if own_depth[k] <= depth[at]:
            depth[at], triangle[at] = own_depth[k], own_triangle[k]
            weights[at, 0], weights[at, 1], weights[at, 2] = own_weights[k, 0], own_weights[k, 1], own_weights[k, 2]


@njit(nogil=True, cache=True)
def thin_wall(faces, values, triangle, weights, light, shade, flesh, depth, colour, opacity, weight):
    """Layers of a thin wall at fragments: denser where the line of sight grazes it.

    Args:
        faces: corners of every triangle.
        values: at every corner: depth, cosine to the viewer, normal in the camera's frame (3), nearness.
        triangle: of each fragment.
        weights: barycentric coordinates of each.
        light: direction towards the light in the camera's frame.
        shade: colour away from the light.
        flesh: colour towards it.
        depth: filled with each layer's depth.
        colour: and its colour.
        opacity: and its opacity.
        weight: and the weight of its colour in its pixel, more for near layers.
    """
    at = np.empty(6)
    for k in range(len(triangle)):
        a, b, c = faces[triangle[k]]
        for v in range(6):
            at[v] = weights[k, 0] * values[a, v] + weights[k, 1] * values[b, v] + weights[k, 2] * values[c, v]
        grazing = 1.0 - min(abs(at[1]), 1.0)
        towards = at[2] * light[0] + at[3] * light[1] + at[4] * light[2]
        lit = min(max(0.55 + 0.5 * (towards if at[1] >= 0.0 else -towards), 0.0), 1.0)
        edge = grazing**1.5
        for channel in range(3):
            own = shade[channel] + (flesh[channel] - shade[channel]) * lit
            colour[k, channel] = min(max(own * (1.0 - 0.35 * edge) + 0.12 * lit, 0.0), 1.0)
        depth[k], opacity[k] = at[0], 0.10 + 0.55 * grazing**2.2
        weight[k] = opacity[k] * np.exp(2.5 * at[5])


@njit(nogil=True, cache=True)
def add_layers(pixel, depth, colour, opacity, weight, limit, total, through, sums):
    """Add up each pixel's layers that are nearer than its limit: weights, logarithms of what goes through, colours."""
    for k in range(len(pixel)):
        at = pixel[k]
        if depth[k] < limit[at]:
            total[at] += weight[k]
            through[at] += np.log1p(-opacity[k])
            for channel in range(3):
                sums[at, channel] += colour[k, channel] * weight[k]
