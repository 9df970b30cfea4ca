"""Compiled loops of the renderer: exact rays to a surface's triangles, found by where these fall in the picture.

All rays of a picture begin at one point. Of a triangle (a, b, c) seen from there, a ray d passes inside where
d . (b x c), d . (c x a) and d . (a x b) are not negative, and meets it after a . n / d . n with n the normal: three
products a pixel, for any lens. Neighbours share an edge's product up to its sign, so that no ray slips through between
them. Which pixels to ask is told by the corners' places in the picture, with a margin for how a lens bends the edges
between them. Nothing is built before: triangles may move from picture to picture.

Nothing here imports haustra, since its tests put type checks on what they import, which numba cannot compile.
"""

import numpy as np
from numba import njit

WIDE = 0.6
"""Edges seen under larger angles than this are followed through the lens instead of taken for straight [rad]."""
BEND = 0.3
"""A lens bends a short edge aside by less than this share of its length times its angle [1]: an eighth of both for
radii in proportion to angles, twice that near the rim."""
SAMPLES = 12
"""Places on a wide edge that are followed."""
MARGIN = 0.02
"""Rounding of places in the picture [pixels]."""


@njit(nogil=True, cache=True, error_model="numpy")
def _project(x, y, z, lens, radii, most):
    """Column and row at which a point in the camera's axes is seen.

    Args:
        x: rightwards [m].
        y: upwards [m].
        z: backwards [m].
        lens: column and row of the axis, and the four numbers of the lens's stretch.
        radii: radius for tan(angle / 2) from 0 to `most`, evenly spaced, beyond what the lens sees going on in line.
        most: see there.
    """
    off = np.sqrt(x * x + y * y)
    half = off / max(np.sqrt(off * off + z * z) - z, 1e-12)
    way = min(half / most, 1.0) * (len(radii) - 1)
    at = min(int(way), len(radii) - 2)
    radius = (radii[at] + (way - at) * (radii[at + 1] - radii[at])) / max(off, 1e-12)
    u, v = radius * x, -radius * y
    return lens[0] + lens[2] * u + lens[3] * v, lens[1] + lens[4] * u + lens[5] * v, half


@njit(nogil=True, cache=True, error_model="numpy")
def see_vertices(vertices, first, last, eye, axes, lens, radii, most, local, image):
    """Take vertices into the camera's axes (`local`) and its picture (`image`: column, row, tan(angle / 2))."""
    for i in range(first, last):
        dx, dy, dz = vertices[i, 0] - eye[0], vertices[i, 1] - eye[1], vertices[i, 2] - eye[2]
        x = dx * axes[0, 0] + dy * axes[1, 0] + dz * axes[2, 0]
        y = dx * axes[0, 1] + dy * axes[1, 1] + dz * axes[2, 1]
        z = dx * axes[0, 2] + dy * axes[1, 2] + dz * axes[2, 2]
        local[i, 0], local[i, 1], local[i, 2] = x, y, z
        image[i, 0], image[i, 1], image[i, 2] = _project(x, y, z, lens, radii, most)


@njit(nogil=True, cache=True, error_model="numpy")
def _follow(a, b, lens, radii, most, box):
    """Widen a box by an edge as the lens bends it."""
    for k in range(SAMPLES + 1):
        s = k / SAMPLES
        x, y, z = a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])
        column, row, _ = _project(x, y, z, lens, radii, most)
        box[0], box[1] = min(box[0], column), max(box[1], column)
        box[2], box[3] = min(box[2], row), max(box[3], row)


@njit(nogil=True, cache=True, error_model="numpy")
def find_boxes(faces, first, last, local, image, lens, radii, most, widest, width, height, boxes, planes, kept):
    """Which triangles face the camera, and the pixels that each may be seen at.

    Args:
        faces: corners of the triangles, counter-clockwise seen from the far side.
        first: of the triangles that are looked at.
        last: after the last of them.
        local: of the vertices.
        image: of the vertices.
        lens: as in `_project`.
        radii: see there.
        most: see there.
        widest: tan(angle / 2) beyond which the lens sees nothing.
        width: columns of the picture.
        height: rows.
        boxes: first and last column, first and last row of each triangle kept, into which they are written.
        planes: of each triangle kept, b x c, c x a, a x b, its normal n, and a . n, into which they are written.
        kept: those triangles.

    Returns:
        How many were kept, written from place `first` on.
    """
    count, box = first, np.empty(4)
    for face in range(first, last):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        if min(image[i, 2], image[j, 2], image[k, 2]) > 4 * widest:
            continue
        a, b, c = local[i], local[j], local[k]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        facing = a[0] * (uy * vz - uz * vy) + a[1] * (uz * vx - ux * vz) + a[2] * (ux * vy - uy * vx)
        if facing <= 0:
            continue
        wx, wy, wz = vx - ux, vy - uy, vz - uz
        edge = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
        near = min(
            a[0] * a[0] + a[1] * a[1] + a[2] * a[2],
            b[0] * b[0] + b[1] * b[1] + b[2] * b[2],
            c[0] * c[0] + c[1] * c[1] + c[2] * c[2],
        )
        angle = np.sqrt(edge / max(near, 1e-12))
        if angle > WIDE:
            box[0], box[1], box[2], box[3] = 1e9, -1e9, 1e9, -1e9
            _follow(a, b, lens, radii, most, box)
            _follow(b, c, lens, radii, most, box)
            _follow(c, a, lens, radii, most, box)
            left, right, top, bottom = box[0], box[1], box[2], box[3]
            angle = angle / SAMPLES
        elif min(image[i, 2], image[j, 2], image[k, 2]) > widest + angle:
            continue
        else:
            left = min(image[i, 0], image[j, 0], image[k, 0])
            right = max(image[i, 0], image[j, 0], image[k, 0])
            top = min(image[i, 1], image[j, 1], image[k, 1])
            bottom = max(image[i, 1], image[j, 1], image[k, 1])
        margin = MARGIN + BEND * angle * max(right - left, bottom - top)
        left, right = max(np.ceil(left - margin), 0.0), min(np.floor(right + margin), width - 1.0)
        top, bottom = max(np.ceil(top - margin), 0.0), min(np.floor(bottom + margin), height - 1.0)
        if left > right or top > bottom:
            continue
        boxes[count, 0], boxes[count, 1], boxes[count, 2], boxes[count, 3] = left, right, top, bottom
        planes[count, 0], planes[count, 1], planes[count, 2] = _cross(b, c)
        planes[count, 3], planes[count, 4], planes[count, 5] = _cross(c, a)
        planes[count, 6], planes[count, 7], planes[count, 8] = _cross(a, b)
        planes[count, 9], planes[count, 10] = uy * vz - uz * vy, uz * vx - ux * vz
        planes[count, 11], planes[count, 12] = ux * vy - uy * vx, facing
        kept[count] = face
        count += 1
    return count


@njit(nogil=True, cache=True, error_model="numpy")
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(nogil=True, cache=True, error_model="numpy")
def _vertex_normal(vertex, faces, local, starts, around, normals):
    """Mean normal of the triangles around a vertex, weighted by area, towards the near side."""
    x, y, z = 0.0, 0.0, 0.0
    for n in range(starts[vertex], starts[vertex + 1]):
        face = around[n]
        a, b, c = local[faces[face, 0]], local[faces[face, 1]], local[faces[face, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        x -= uy * vz - uz * vy
        y -= uz * vx - ux * vz
        z -= ux * vy - uy * vx
    size = max(np.sqrt(x * x + y * y + z * z), 1e-30)
    normals[vertex, 0], normals[vertex, 1], normals[vertex, 2] = x / size, y / size, z / size


@njit(nogil=True, cache=True, error_model="numpy")
def resolve(first_row, last_row, faces, local, rays, planes, kept, starts, around, stamps, now, normals, own, found):
    """Triangles, barycentric coordinates and smooth unit normals, in the camera's axes, that the rays of some rows met.

    Args:
        first_row: of the rows.
        last_row: after the last of them.
        faces: as in `find_boxes`.
        local: of the vertices.
        rays: of all pixels, plane after plane.
        planes: as `find_boxes` left them.
        kept: see there.
        starts: of each vertex in `around`.
        around: triangles around the vertices.
        stamps: picture for which each vertex's normal was worked out.
        now: this picture.
        normals: of the vertices, worked out where they are needed.
        own: which of those kept each pixel met, -1 for none; which triangle that is, is written there.
        found: coordinates and normals of the pixels, plane after plane, into which they are written.
    """
    last, i, j, k = -1, 0, 0, 0
    for row in range(first_row, last_row):
        for column in range(own.shape[1]):
            met = own[row, column]
            if met < 0:
                continue
            own[row, column] = kept[met]
            if met != last:  # neighbours often meet the same one
                last, face = met, kept[met]
                i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
                for vertex in (i, j, k):
                    if stamps[vertex] != now:
                        _vertex_normal(vertex, faces, local, starts, around, normals)
                        stamps[vertex] = now
            x, y, z = rays[0, row, column], rays[1, row, column], rays[2, row, column]
            none = np.float32(0.0)
            p = max(x * planes[met, 0] + y * planes[met, 1] + z * planes[met, 2], none)
            q = max(x * planes[met, 3] + y * planes[met, 4] + z * planes[met, 5], none)
            r = max(x * planes[met, 6] + y * planes[met, 7] + z * planes[met, 8], none)
            scale = np.float32(1.0) / max(p + q + r, np.float32(1e-30))
            p, q, r = p * scale, q * scale, r * scale
            nx = p * normals[i, 0] + q * normals[j, 0] + r * normals[k, 0]
            ny = p * normals[i, 1] + q * normals[j, 1] + r * normals[k, 1]
            nz = p * normals[i, 2] + q * normals[j, 2] + r * normals[k, 2]
            scale = np.float32(1.0) / np.sqrt(max(nx * nx + ny * ny + nz * nz, np.float32(1e-30)))
            found[0, row, column], found[1, row, column], found[2, row, column] = p, q, r
            found[3, row, column], found[4, row, column], found[5, row, column] = nx * scale, ny * scale, nz * scale


@njit(nogil=True, cache=True, error_model="numpy")
def develop(first_row, last_row, light, gain, curve, picture):
    """Exposure and the camera's curve: light, plane after plane, to bytes, by a table over light from 0 to 1."""
    top = len(curve) - 1
    for row in range(first_row, last_row):
        for column in range(light.shape[2]):
            for band in range(3):
                picture[row, column, band] = curve[int(min(gain * light[band, row, column], 1.0) * top)]


@njit(nogil=True, cache=True, error_model="numpy")
def widest_balls(middles, reaches, last):
    """Radii of balls about stretches that hold those of the stretches up to a last one."""
    found = np.empty(len(reaches))
    for s in range(len(reaches)):
        end = last[s]
        x, y, z = middles[end, 0] - middles[s, 0], middles[end, 1] - middles[s, 1], middles[end, 2] - middles[s, 2]
        found[s] = max(reaches[s], np.sqrt(x * x + y * y + z * z) + reaches[end])
    return found


@njit(nogil=True, cache=True, error_model="numpy")
def holding(stretches, last):
    """Stretches that hold the corners of some stretches' triangles and of those beside these, up to a last one each."""
    count = len(last)
    held, found, many = np.zeros(count, np.bool_), np.empty(count, np.int64), 0
    for stretch in stretches:
        for s in range(max(stretch - 1, 0), min(last[stretch] + 2, count)):
            held[s] = True
    for s in range(count):
        if held[s]:
            found[many] = s
            many += 1
    return found[:many]


@njit(nogil=True, cache=True, error_model="numpy")
def in_sight(middles, reaches, eye, axes, beyond, widest, near):
    """Stretches that a camera may see.

    Args:
        middles: of balls about the stretches [m].
        reaches: their radii [m].
        eye: the camera [m].
        axes: its right, up and backward directions, as columns.
        beyond: the balls count as so much wider [m].
        widest: angle off the axis to which the lens sees [rad].
        near: stretches at most so far from the one beside the camera.
    """
    away, ahead, beside = np.empty(len(reaches)), np.empty(len(reaches)), 0
    for s in range(len(reaches)):
        x, y, z = middles[s, 0] - eye[0], middles[s, 1] - eye[1], middles[s, 2] - eye[2]
        away[s] = np.sqrt(x * x + y * y + z * z)
        ahead[s] = -(x * axes[0, 2] + y * axes[1, 2] + z * axes[2, 2])
        if away[s] - reaches[s] < away[beside] - reaches[beside]:
            beside = s
    shown, count = np.empty(len(reaches), np.int64), 0
    for s in range(len(reaches)):
        reach, off = reaches[s] + beyond, max(away[s], 1e-9)
        wide = np.arcsin(min(reach / off, 1.0)) if away[s] > reach else np.pi
        if np.arccos(min(max(ahead[s] / off, -1.0), 1.0)) <= wide + widest and abs(s - beside) <= near:
            shown[count] = s
            count += 1
    return shown[:count]


@njit(nogil=True, cache=True, error_model="numpy")
def runs(stretches, ends):
    """Ranges of things, of which each stretch ends there, that stretches next to each other make together."""
    found, count = np.empty((len(stretches), 2), np.int64), 0
    for n in range(len(stretches)):
        if n and stretches[n] == stretches[n - 1] + 1:
            found[count - 1, 1] = ends[stretches[n] + 1]
        else:
            found[count, 0], found[count, 1] = ends[stretches[n]], ends[stretches[n] + 1]
            count += 1
    return found[:count]


@njit(nogil=True, cache=True, error_model="numpy")
def near_places(places, arcs, tops, radius, low, high, fall, rows):
    """Places of a device whose tents reach stretches of a colon: where, arc length, top, radius.

    Args:
        places: [m].
        arcs: beside them [m].
        tops: of the tents over them [m].
        radius: of the device [m].
        low: least arc length of the stretches [m].
        high: greatest [m].
        fall: how steeply tents fall along the colon [1].
        rows: into which they are written.

    Returns:
        How many.
    """
    count = 0
    for p in range(len(arcs)):
        if low - tops[p] / fall < arcs[p] < high + tops[p] / fall:
            rows[count, 0], rows[count, 1], rows[count, 2] = places[p, 0], places[p, 1], places[p, 2]
            rows[count, 3], rows[count, 4], rows[count, 5] = arcs[p], tops[p], radius
            count += 1
    return count
