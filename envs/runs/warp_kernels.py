# pyright: reportInvalidTypeForm=false
"""What runs on the GPU beside MuJoCo Warp: the rigs' controls, the reading of their forces, and of depth pictures."""

import warp as wp

HARMONICS = 3
"""Multiples of the tooth-passing frequency that are read."""
MEANS = 5
"""Sums kept for each world: steps read, normal force, friction, string, roll rate."""
WAVES = 6
"""Sums kept for each harmonic: friction x (cosine, sine), tension of the string x (cosine, sine), cosine, sine."""
SUMS = MEANS + WAVES * HARMONICS
"""Numbers that are summed of each world: its means, then its waves."""


@wp.func
def _passages(now: wp.array(dtype=int), step: float, frequency: float) -> float:
    """Teeth that have passed since the start [1]."""
    return float(now[0]) * step * frequency


@wp.kernel
def steer(
    now: wp.array(dtype=int),
    step: float,
    frequency: wp.array(dtype=float),
    which: wp.array(dtype=int),
    table: wp.array3d(dtype=float),
    columns: wp.array(dtype=int),
    ctrl: wp.array2d(dtype=float),
):
    """Scale the pads' springs by their tooth phases, as the table of the world's own rig says."""
    world, pad = wp.tid()
    passed = _passages(now, step, frequency[world])
    place = (passed - wp.floor(passed)) * float(table.shape[1] - 1)
    low = wp.min(int(place), table.shape[1] - 2)
    share = place - float(low)
    rig = which[world]
    ctrl[world, columns[pad]] = (1.0 - share) * table[rig, low, pad] + share * table[rig, low + 1, pad]


@wp.kernel
def read_forces(
    now: wp.array(dtype=int),
    step: float,
    frequency: wp.array(dtype=float),
    window: wp.array(dtype=wp.vec2i),
    sensors: wp.array2d(dtype=float),
    speeds: wp.array2d(dtype=float),
    pads: wp.array(dtype=int),
    string: int,
    stiffness: float,
    slack: float,
    rows: wp.array(dtype=int),
    most_rows: int,
    contacts: wp.array(dtype=int),
    most_contacts: int,
    sums: wp.array2d(dtype=float),
    touching: wp.array2d(dtype=float),
    broken: wp.array(dtype=int),
):
    """Add this step's forces to what a world has summed."""
    world = wp.tid()
    if rows[world] > most_rows or contacts[0] > most_contacts:
        broken[world] = 1
    normal = wp.float32(0.0)  # Warp takes plain numbers for constants
    force = wp.float32(0.0)
    inside = now[0] >= window[world][0] and now[0] < window[world][1]
    for pad in range(pads.shape[0]):
        pressed = wp.float32(0.0)
        for contact in range(2):
            at = pads[pad] + 3 * contact
            pressed += sensors[world, at]
            force += wp.sqrt(sensors[world, at + 1] ** 2.0 + sensors[world, at + 2] ** 2.0)
        normal += pressed
        if inside and pressed > 0.0:
            touching[world, pad] += 1.0
    if not wp.isfinite(normal) or not wp.isfinite(force):
        broken[world] = 1
    if not inside:
        return
    sums[world, 0] += 1.0
    sums[world, 1] += normal
    sums[world, 2] += force
    tension = wp.float32(0.0)
    if string >= 0:
        tension = stiffness * wp.max(sensors[world, string] - slack, 0.0)
        sums[world, 3] += tension
        sums[world, 4] += speeds[world, 3]  # a free core's turning about its axis comes after its three ways
    passed = _passages(now, step, frequency[world])
    for harmonic in range(wp.static(HARMONICS)):
        angle = 2.0 * wp.pi * float(harmonic + 1) * (passed - wp.floor(passed))
        cosine, sine = wp.cos(angle), wp.sin(angle)
        place = wp.static(MEANS) + wp.static(WAVES) * harmonic
        sums[world, place] += force * cosine
        sums[world, place + 1] += force * sine
        sums[world, place + 2] += tension * cosine
        sums[world, place + 3] += tension * sine
        sums[world, place + 4] += cosine
        sums[world, place + 5] += sine


@wp.kernel
def count_step(now: wp.array(dtype=int)):
    """One time step is over."""
    now[0] = now[0] + 1


@wp.kernel
def along_rays(
    depth: wp.array2d(dtype=float),
    rays: wp.array(dtype=wp.vec3),
    within: wp.array(dtype=wp.uint8),
    beyond: wp.array(dtype=wp.vec3),
    reach: float,
    bytes_out: wp.array2d(dtype=wp.uint8),
):
    """From depth along a camera's axis [m] to distances along its rays, 255 for the reach and for what was not hit.

    Outside the lens pictures are zero; and so is what a camera that is `beyond` the wall sees in that direction.
    """
    world, pixel = wp.tid()
    share = wp.float32(0.0)
    if within[pixel] > wp.uint8(0) and wp.dot(rays[pixel], beyond[world]) <= 0.0:
        share = wp.float32(1.0)
        if depth[world, pixel] > 0.0:
            share = wp.min(depth[world, pixel] / (-rays[pixel][2] * reach), 1.0)
    bytes_out[world, pixel] = wp.uint8(wp.rint(255.0 * share))
