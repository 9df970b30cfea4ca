"""What the inner wall looks like: one shader over place at rest, normal, distance and view, for every renderer.

Colour is that of blood in a scattering tissue: white light comes back as exp(-c k) in each band, with c how much blood
lies under the place and k the share that haemoglobin takes of red, green and blue. More blood makes it redder and then
darker: pale taeniae, pink mucosa, vessels and blood itself are one family. A film of water gives highlights. Patterns
are noise at the place at rest, so that they go along with the wall, and are made from a seed.

Appearance only: nothing here is a measurement. Light falls by the formula of `haustra.envs.view.picture.light`.

Nothing here imports haustra, since its tests put type checks on what they import, which numba cannot compile.
"""

import numpy as np
from numba import njit

PERIOD = 16
"""Cells after which noise repeats: so few that all stay in the processor's nearest cache."""
TAENIA, POLYP, DIVERTICULUM, BLOOD, STOOL = range(5)
"""Columns of what is known of each vertex, each from 0 to 1."""
ORIFICE, VALVE = range(2)
"""Kinds of landmarks that are drawn pixel by pixel."""
_RED, _GREEN, _BLUE = 0.16, 1.05, 1.25
"""How strongly blood takes red, green and blue [1 per unit of blood]; oxygenated haemoglobin takes far more of green
and blue than of red (Prahl, molar extinction), of which broad filters and scattering leave less; engineering choice."""
_FINE = 1.6e-4
"""Fine vessels and ripples are drawn where a pixel sees less of the wall than this [m]."""
_DEEP = 0.12
"""Distance over which light that other wall has sent on turns red [m]; engineering choice."""
_PALE = 0.94, 0.86, 0.74
"""What comes back of tissue without blood; engineering choice."""


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)
def noise(lattice, x, y, z):
    """Smooth noise from 0 to 1 and its gradient, over a lattice of random numbers that repeats."""
    fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
    u, v, w = x - fx, y - fy, z - fz
    i, j, k = int(fx) & 15, int(fy) & 15, int(fz) & 15
    i1, j1, k1 = (i + 1) & 15, (j + 1) & 15, (k + 1) & 15
    su, sv, sw = u * u * (3 - 2 * u), v * v * (3 - 2 * v), w * w * (3 - 2 * w)
    du, dv, dw = 6 * u * (1 - u), 6 * v * (1 - v), 6 * w * (1 - w)
    a, b = lattice[i, j, k], lattice[i1, j, k]
    c, d = lattice[i, j1, k], lattice[i1, j1, k]
    e, f = lattice[i, j, k1], lattice[i1, j, k1]
    g, h = lattice[i, j1, k1], lattice[i1, j1, k1]
    near0, near1 = a + su * (b - a), c + su * (d - c)
    far0, far1 = e + su * (f - e), g + su * (h - g)
    near, far = near0 + sv * (near1 - near0), far0 + sv * (far1 - far0)
    gx0 = (b - a) + sv * ((d - c) - (b - a))
    gx1 = (f - e) + sv * ((h - g) - (f - e))
    gy = (near1 - near0) + sw * ((far1 - far0) - (near1 - near0))
    return near + sw * (far - near), du * (gx0 + sw * (gx1 - gx0)), dv * gy, dw * (far - near)


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)
def shade(
    first_row,
    last_row,
    faces,
    rest,
    arcs,
    known,
    lattice,
    landmarks,
    wet,
    rays,
    axes,
    distance,
    own,
    weights,
    normal,
    vignetting,
    guides,
    spread,
    pixel,
    radiance,
):
    """Light that comes back to the camera from what the rays of some rows met, before exposure.

    Args:
        first_row: of the rows.
        last_row: after the last of them.
        faces: corners of the triangles.
        rest: places of the vertices at rest [m].
        arcs: arc length of each vertex [m].
        known: of each vertex, columns as named above.
        lattice: random numbers from 0 to 1 (16, 16, 16).
        landmarks: kind, place at rest [m], half-width [m] and the direction of its long axis, each.
        wet: brightness of the film's highlights.
        rays: of all pixels, in the camera's axes.
        axes: columns are the camera's axes in the world.
        distance: along the rays [m].
        own: which of `faces` they met.
        weights: barycentric coordinates.
        normal: unit normals in the camera's axes.
        vignetting: power of the cosine by which the lens loses light.
        guides: places of the light guides in the camera's axes [m].
        spread: mu of their light's fall with the angle.
        pixel: angle that a pixel sees [rad].
        radiance: (rows, columns, 3), into which it is written.
    """
    share = 1.0 / len(guides)
    for row in range(first_row, last_row):
        for column in range(rays.shape[1]):
            face = own[row, column]
            if face < 0:
                radiance[row, column, 0] = radiance[row, column, 1] = radiance[row, column, 2] = 0.0
                continue
            i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
            p, q, r = weights[row, column, 0], weights[row, column, 1], weights[row, column, 2]
            x = p * rest[i, 0] + q * rest[j, 0] + r * rest[k, 0]
            y = p * rest[i, 1] + q * rest[j, 1] + r * rest[k, 1]
            z = p * rest[i, 2] + q * rest[j, 2] + r * rest[k, 2]
            arc = p * arcs[i] + q * arcs[j] + r * arcs[k]
            taenia = p * known[i, 0] + q * known[j, 0] + r * known[k, 0]
            polyp = p * known[i, 1] + q * known[j, 1] + r * known[k, 1]
            sac = p * known[i, 2] + q * known[j, 2] + r * known[k, 2]
            bleeding = p * known[i, 3] + q * known[j, 3] + r * known[k, 3]
            stool = p * known[i, 4] + q * known[j, 4] + r * known[k, 4]
            away = distance[row, column]
            size = away * pixel
            nx, ny, nz = normal[row, column, 0], normal[row, column, 1], normal[row, column, 2]
            dx, dy, dz = rays[row, column, 0], rays[row, column, 1], rays[row, column, 2]

            # Patches of more and less blood, a wandering of the vessels, and the wall's own unevenness.
            patch, _, _, _ = noise(lattice, x * 45.0, y * 45.0, z * 45.0)
            bend, bx, by, bz = noise(lattice, x * 130.0 + 7.3, y * 130.0 + 1.9, z * 130.0 + 4.1)
            wx, wy, wz = x + 0.0022 * by, y + 0.0022 * bz, z + 0.0022 * bx
            blood = 0.88 + 0.36 * (patch - 0.5) + 0.20 * (bend - 0.5)
            blood -= 0.30 * taenia * (1 - polyp)
            wide, _, _, _ = noise(lattice, wx * 75.0 + 3.7, wy * 75.0 + 8.8, wz * 75.0 + 2.2)
            blurred = size * 75.0 * 0.7
            thick = 0.020 * (0.25 + 1.5 * patch) + blurred
            trunk = np.exp(-(((wide - 0.5) / thick) ** 2)) * (0.022 / (0.022 + blurred))
            presence = min(max(2.6 * bend - 0.55, 0.0), 1.0)
            vessels = 1.0 * trunk * presence
            gx, gy, gz = 0.0, 0.0, 0.0
            if size < _FINE:  # what is finer than a pixel is not drawn
                clear = 1 - size / _FINE
                fine, _, _, _ = noise(lattice, wx * 210.0 + 5.5, wy * 210.0 + 0.6, wz * 210.0 + 9.4)
                blurred = size * 210.0 * 0.7
                vessels += 0.6 * clear * np.exp(-(((fine - 0.5) / (0.045 + blurred)) ** 2)) * min(2 * presence, 1.0)
                _, gx, gy, gz = noise(lattice, x * 620.0 + 2.5, y * 620.0 + 6.6, z * 620.0 + 3.4)
                gx, gy, gz = 0.10 * clear * gx, 0.10 * clear * gy, 0.10 * clear * gz
            blood += vessels * (1 - 0.9 * polyp) * (1 - 0.5 * taenia)
            gx, gy, gz = gx + 0.07 * bx, gy + 0.07 * by, gz + 0.07 * bz

            # Polyps are redder, with pits; the mouth of a diverticulum is dark; beyond the dentate line there is skin.
            if polyp > 0.01:
                pits, hx, hy, hz = noise(lattice, x * 900.0, y * 900.0, z * 900.0)
                blood += polyp * (0.30 + 0.55 * (pits - 0.5))
                gx, gy, gz = gx + 0.25 * polyp * hx, gy + 0.25 * polyp * hy, gz + 0.25 * polyp * hz
            dark = 1.0 - 0.55 * sac
            skin = min(max((0.022 + 0.012 * (bend - 0.5) + 0.006 * (wide - 0.5) - arc) / 0.002, 0.0), 1.0)
            verge = min(max((0.008 - arc) / 0.006, 0.0), 1.0)
            blood = blood * (1 - 0.45 * skin) + 0.30 * verge
            red, green, blue = _PALE[0], _PALE[1], _PALE[2]
            red, green, blue = red * (1 - 0.25 * verge), green * (1 - 0.32 * verge), blue * (1 - 0.40 * verge)

            for n in range(len(landmarks)):
                ox, oy, oz = x - landmarks[n, 1], y - landmarks[n, 2], z - landmarks[n, 3]
                wide_by = landmarks[n, 4]
                if ox * ox + oy * oy + oz * oz > 9 * wide_by * wide_by:
                    continue
                along = ox * landmarks[n, 5] + oy * landmarks[n, 6] + oz * landmarks[n, 7]
                off = np.sqrt(max(ox * ox + oy * oy + oz * oz - along * along, 0.0))
                if landmarks[n, 0] == ORIFICE:  # a dark slit, bent, within a ring of mucosa
                    bent = off + 0.35 * along * along / wide_by
                    reach = np.sqrt((along / wide_by) ** 2 + (2.6 * bent / wide_by) ** 2)
                    dark *= 1 - 0.93 / (1 + np.exp(10 * (reach - 0.9)))
                    ring = np.exp(-(((np.sqrt(off * off + along * along) / wide_by - 1.5) / 0.28) ** 2))
                    blood -= 0.16 * ring
                    slope = 0.9 * np.exp(-(((np.sqrt(off * off + along * along) / wide_by - 1.25) / 0.35) ** 2))
                    scale = slope / max(np.sqrt(off * off + along * along), 1e-5)
                    gx, gy, gz = gx + scale * ox, gy + scale * oy, gz + scale * oz
                else:  # two lips of fat under the mucosa, and the slit between them
                    reach = np.sqrt((along / wide_by) ** 2 + (1.7 * off / wide_by) ** 2)
                    lips = 1 / (1 + np.exp(9 * (reach - 1.0)))
                    slit = np.exp(-((off / (0.09 * wide_by)) ** 2)) / (1 + np.exp(14 * (abs(along) / wide_by - 0.62)))
                    blood -= lips * (0.30 - 0.25 * bend)
                    blue *= 1 - 0.38 * lips
                    green *= 1 - 0.08 * lips
                    dark *= 1 - 0.85 * slit
                    scale = (1.3 * np.exp(-(((reach - 1.0) / 0.30) ** 2)) - 0.9 * lips * (1 - slit)) / wide_by
                    ox, oy, oz = (
                        ox - along * landmarks[n, 5],
                        oy - along * landmarks[n, 6],
                        oz - along * landmarks[n, 7],
                    )
                    gx, gy, gz = gx - scale * ox, gy - scale * oy, gz - scale * oz

            if bleeding > 0.0:
                edge = bleeding + 0.5 * (bend - 0.5) + 0.25 * (wide - 0.5)
                soaked = min(max((edge - 0.35) / 0.12, 0.0), 1.0)
                blood += 2.6 * soaked
                gx, gy, gz = gx * (1 - 0.8 * soaked), gy * (1 - 0.8 * soaked), gz * (1 - 0.8 * soaked)
            red *= np.exp(-_RED * blood)
            green *= np.exp(-_GREEN * blood)
            blue *= np.exp(-_BLUE * blood)
            gloss = 1.0
            if stool > 0.0:
                edge = stool + 0.9 * (bend - 0.5) + 0.5 * (patch - 0.5)
                thickness = min(max((edge - 0.45) / 0.25, 0.0), 1.0)
                cover = 0.85 * thickness
                red += cover * (0.62 - red)
                green += cover * (0.46 - green)
                blue += cover * (0.16 - blue)
                gloss = 1 - 0.4 * thickness
            red, green, blue = dark * red, dark * green, dark * blue
            gloss *= dark

            # The film of water is smoother than the wall; both lean as the noise does, turned into the camera's axes.
            tx = gx * axes[0, 0] + gy * axes[1, 0] + gz * axes[2, 0]
            ty = gx * axes[0, 1] + gy * axes[1, 1] + gz * axes[2, 1]
            tz = gx * axes[0, 2] + gy * axes[1, 2] + gz * axes[2, 2]
            up = tx * nx + ty * ny + tz * nz
            mx, my, mz = nx - (tx - up * nx), ny - (ty - up * ny), nz - (tz - up * nz)
            scale = 1 / np.sqrt(mx * mx + my * my + mz * mz)
            mx, my, mz = mx * scale, my * scale, mz * scale
            diffuse, glint = 0.0, 0.0
            for n in range(len(guides)):
                lx, ly, lz = guides[n, 0] - away * dx, guides[n, 1] - away * dy, guides[n, 2] - away * dz
                square = max(lx * lx + ly * ly + lz * lz, 1e-7)
                scale = 1 / np.sqrt(square)
                lx, ly, lz = lx * scale, ly * scale, lz * scale
                power = share * np.exp(-spread * (1 - lz)) / square
                facing = mx * lx + my * ly + mz * lz
                diffuse += power * max((facing + 0.15) / 1.15, 0.03)
                hx, hy, hz = lx - dx, ly - dy, lz - dz
                scale = 1 / np.sqrt(hx * hx + hy * hy + hz * hz)
                shine = max((mx * hx + my * hy + mz * hz) * scale, 0.0)
                shine *= shine
                shine *= shine
                shine *= shine
                shine *= shine
                shine *= shine  # to the power of 32
                glint += power * (0.35 * shine * shine + 2.2 * shine**12)
            glint *= gloss * 0.35 * wet

            # A lens that presses the wall sees light that has gone through it: red, without shape.
            pressed = min(max((0.0035 - away) / 0.0028, 0.0), 1.0)
            dim = 1.0
            if vignetting == 1.0:
                dim = max(-dz, 0.0)
            elif vignetting > 0:
                dim = max(-dz, 0.0) ** vignetting
            # Light that comes from the depth has been sent on by other wall before, and is redder.
            deep = min(away / _DEEP, 1.5)
            green, blue = green * (1 - 0.30 * deep), blue * (1 - 0.38 * deep)
            through = 6e3 * pressed
            diffuse, glint = (1 - pressed) * diffuse, (1 - pressed) * glint
            radiance[row, column, 0] = dim * (red * diffuse + glint + 0.60 * through)
            radiance[row, column, 1] = dim * (green * diffuse + glint + 0.07 * through)
            radiance[row, column, 2] = dim * (blue * diffuse + 0.95 * glint + 0.035 * through)


@njit(nogil=True, cache=True, error_model="numpy")
def develop(first_row, last_row, radiance, gain, curve, picture):
    """Exposure and the camera's curve: light to bytes, by a table over light from 0 to 1."""
    top = len(curve) - 1
    for row in range(first_row, last_row):
        for column in range(radiance.shape[1]):
            for band in range(3):
                picture[row, column, band] = curve[int(min(gain * radiance[row, column, band], 1.0) * top)]
