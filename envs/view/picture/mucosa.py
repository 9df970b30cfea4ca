"""What the inner wall looks like: one law over place at rest, normal, distance and view, for every renderer.

Colour is that of blood in a scattering tissue: white light comes back as exp(-c k) in each band, with c how much blood
lies under the place and k the share that haemoglobin takes of red, green and blue. More blood makes it redder and then
darker: pale taeniae, pink mucosa, vessels and blood itself are one family. A film of water gives highlights. Patterns
are noise at the place at rest, so that they go along with the wall, and are made from a seed.

Appearance only: nothing here is a measurement. Light falls by the formula of `haustra.envs.view.picture.light`.

Numbers are numpy's arrays, or the values from which `haustra.envs.view.picture.shader` makes a program.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.models.wall.vectors import Vector, add, dot, minus, times

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
_FROTH = 6e-4
"""Bubbles are drawn where a pixel sees less of the wall than this [m]; engineering choice: a third of one."""
_DEEP = 0.12
"""Distance over which light that other wall has sent on turns red [m]; engineering choice."""
_PALE = 0.94, 0.86, 0.74
"""What comes back of tissue without blood; engineering choice."""


Lattice = Callable[[Any], Any]
"""Gives rows of `corners`: for their numbers, four random numbers each."""


class WallPlace(NamedTuple):
    """A place of the wall, and what is known of it."""

    rest: Vector
    """Where it is in the colon at rest [m]."""
    arc: Any
    """Arc length beside it [m]."""
    taenia: Any
    polyp: Any
    sac: Any
    bleeding: Any
    stool: Any


class Sight(NamedTuple):
    """How a pixel sees a place, in the camera's axes."""

    away: Any
    """Distance along the ray [m]."""
    ray: Vector
    """Unit vector towards the place."""
    normal: Vector
    """Unit normal of the wall there, towards the camera."""
    dim: Any
    """Share of the light that the lens lets through there."""


class Landmark(NamedTuple):
    """A named place that is drawn pixel by pixel."""

    kind: int
    place: Vector
    """At rest [m]."""
    width: Any
    """Half of its breadth [m]."""
    along: Vector
    """Direction of its long axis."""


class Scene(NamedTuple):
    """What all pixels of a picture share."""

    lattice: Lattice
    """Random numbers of all patterns."""
    landmarks: Sequence[Landmark]
    axes: tuple[Vector, Vector, Vector]
    """The camera's: right, up and backwards in the world."""
    guides: Sequence[Vector]
    """Places of the light guides in the camera's axes [m]."""
    spread: Any
    """mu of their light's fall with the angle."""
    pixel: Any
    """Angle that a pixel sees [rad]."""
    wet: Any
    """Brightness of the film's highlights."""
    mucus: Any
    """Share of the wall under mucus [1]."""


class Looks(NamedTuple):
    """What a place looks like."""

    blood: Any
    """How much lies under it."""
    lean: Vector
    """How the film of water leans there, over the wall under it."""
    pale: Vector
    """What comes back of it without blood, in red, green and blue."""
    dark: Any
    """Share of light that comes back of what would."""
    gloss: Any
    """Share of the film that is there."""

    @property
    def numbers(self) -> tuple[Any, ...]:
        """All of them."""
        return self.blood, *self.lean, *self.pale, self.dark, self.gloss

    @classmethod
    def of(cls, numbers: Sequence[Any]) -> "Looks":
        """What such numbers say."""
        blood, x, y, z, red, green, blue, dark, gloss = numbers
        return cls(blood, (x, y, z), (red, green, blue), dark, gloss)


Change = Callable[[Looks], Looks]
Only = Callable[[Any, Change, Looks], Looks]
"""Changes looks where a condition holds, and saves the work where it holds nowhere: condition, change, looks before."""


def masked(xp: Any, condition: Any, change: Change, looks: Looks) -> Looks:
    """Looks changed where a condition holds."""
    pairs = zip(change(looks).numbers, looks.numbers, strict=True)
    return Looks.of([xp.where(condition, new, old) for new, old in pairs])


def corners(lattice: Float[np.ndarray, "16 16 16"]) -> Float[np.ndarray, "4096 4"]:
    """Random numbers by rows of four, for `noise`: each, and those beyond it along the second axis and the third."""
    beyond = np.roll(lattice, -1, axis=1)
    four = [lattice, beyond, np.roll(lattice, -1, axis=2), np.roll(beyond, -1, axis=2)]
    return np.stack(four, axis=-1).reshape(-1, 4)


def noise(xp: Any, lattice: Lattice, place: Vector, fine: float, shift: Vector = (0.0, 0.0, 0.0)) -> tuple[Any, Vector]:
    """Smooth noise from 0 to 1 with `fine` cells a unit of length, and its gradient over cells."""
    at = tuple(fine * each + more for each, more in zip(place, shift, strict=True))
    cell = tuple(xp.floor(each) for each in at)
    u, v, w = (each - whole for each, whole in zip(at, cell, strict=True))
    i, j, k = (xp.int32(whole) & (PERIOD - 1) for whole in cell)
    row, behind = j * PERIOD + k, PERIOD * PERIOD
    (a, c, e, g), (b, d, f, h) = (lattice(first * behind + row) for first in (i, (i + 1) & (PERIOD - 1)))
    su, sv, sw = (each * each * (3 - 2 * each) for each in (u, v, w))
    du, dv, dw = (6 * each * (1 - each) for each in (u, v, w))
    near0, near1, far0, far1 = a + su * (b - a), c + su * (d - c), e + su * (f - e), g + su * (h - g)
    near, far = near0 + sv * (near1 - near0), far0 + sv * (far1 - far0)
    gx0, gx1 = (b - a) + sv * ((d - c) - (b - a)), (f - e) + sv * ((h - g) - (f - e))
    gy = (near1 - near0) + sw * ((far1 - far0) - (near1 - near0))
    return near + sw * (far - near), (du * (gx0 + sw * (gx1 - gx0)), dv * gy, dw * (far - near))


def shade(xp: Any, place: WallPlace, sight: Sight, scene: Scene, only: Only) -> Vector:
    """Light that comes back to the camera in red, green and blue, before exposure.

    Args:
        xp: numpy, or what writes a program.
        place: of the wall.
        sight: how it is seen.
        scene: what all pixels share.
        only: changes what a place looks like where a condition holds.
    """
    return _lit(xp, wall_looks(xp, place, sight.away * scene.pixel, scene, only), sight, scene)


def wall_looks(xp: Any, place: WallPlace, size: Any, scene: Scene, only: Only) -> Looks:
    """What a place of the wall looks like: `pale` and `dark` together are what a matt wall sends back.

    Args:
        xp: numpy, or what writes a program.
        place: of the wall.
        size: how much of the wall a pixel sees [m]; what is finer is left out.
        scene: what all pixels share.
        only: changes what a place looks like where a condition holds.
    """
    x, y, z = place.rest

    def ripple(at: Vector, fine: float, shift: Vector = (0.0, 0.0, 0.0)) -> tuple[Any, Vector]:
        return noise(xp, scene.lattice, at, fine, shift)

    # Patches of more and less blood, a wandering of the vessels, and the wall's own unevenness.
    patch, _ = ripple(place.rest, 45.0)
    bend, (bx, by, bz) = ripple(place.rest, 130.0, (7.3, 1.9, 4.1))
    wandered = x + 0.0022 * by, y + 0.0022 * bz, z + 0.0022 * bx
    wide, _ = ripple(wandered, 75.0, (3.7, 8.8, 2.2))
    blurred = 52.5 * size
    thick = 0.020 * (0.25 + 1.5 * patch) + blurred
    trunk = xp.exp(-(((wide - 0.5) / thick) ** 2)) * (0.022 / (0.022 + blurred))
    presence = xp.clip(2.6 * bend - 0.55, 0.0, 1.0)
    drawn = (1 - 0.9 * place.polyp) * (1 - 0.5 * place.taenia)
    blood = 0.88 + 0.36 * (patch - 0.5) + 0.20 * (bend - 0.5) - 0.30 * place.taenia * (1 - place.polyp)
    blood = blood + trunk * presence * drawn
    looks = Looks(blood, (0.07 * bx, 0.07 * by, 0.07 * bz), _PALE, 1.0 - 0.55 * place.sac, 1.0)

    def refine(looks: Looks) -> Looks:
        clear = 1 - size / _FINE
        fine, _ = ripple(wandered, 210.0, (5.5, 0.6, 9.4))
        vessels = 0.6 * clear * xp.exp(-(((fine - 0.5) / (0.045 + 147.0 * size)) ** 2)) * xp.minimum(2 * presence, 1.0)
        _, uneven = ripple(place.rest, 620.0, (2.5, 6.6, 3.4))
        return looks._replace(blood=looks.blood + vessels * drawn, lean=add(looks.lean, times(0.10 * clear, uneven)))

    def redden(looks: Looks) -> Looks:
        pits, slope = ripple(place.rest, 900.0)
        more, lean = place.polyp * (0.30 + 0.55 * (pits - 0.5)), times(0.25 * place.polyp, slope)
        return looks._replace(blood=looks.blood + more, lean=add(looks.lean, lean))

    def soak(looks: Looks) -> Looks:
        edge = place.bleeding + 0.5 * (bend - 0.5) + 0.25 * (wide - 0.5)
        soaked = xp.clip((edge - 0.35) / 0.12, 0.0, 1.0)
        return looks._replace(blood=looks.blood + 2.6 * soaked, lean=times(1 - 0.8 * soaked, looks.lean))

    def cover(looks: Looks) -> Looks:
        edge = place.stool + 0.9 * (bend - 0.5) + 0.5 * (patch - 0.5)
        thickness = xp.clip((edge - 0.45) / 0.25, 0.0, 1.0)
        laid = tuple(own + 0.85 * thickness * (o - own) for own, o in zip(looks.pale, (0.62, 0.46, 0.16), strict=True))
        return looks._replace(pale=laid, gloss=1 - 0.4 * thickness)

    def slime(looks: Looks) -> Looks:
        # Strands that wander, and a veil between them; what lies thick is smooth, pale and wet.
        strand, slope = ripple(wandered, 105.0, (9.1, 4.7, 6.3))
        veil, _ = ripple(place.rest, 33.0, (1.3, 7.9, 5.2))
        ridge = xp.exp(-(((strand - 0.5) / (0.10 + blurred)) ** 2))
        thickness = xp.clip((0.55 * ridge + 0.9 * veil + 1.1 * scene.mucus - 1.1) / 0.35, 0.0, 1.0)
        laid = tuple(own + 0.55 * thickness * (o - own) for own, o in zip(looks.pale, (0.86, 0.78, 0.52), strict=True))
        lean = add(times(1 - 0.6 * thickness, looks.lean), times(0.30 * thickness * (0.5 - strand), slope))
        return looks._replace(pale=laid, lean=lean, gloss=looks.gloss * (1 + 1.2 * thickness))

    def froth(looks: Looks) -> Looks:
        # Bubbles in the mucus, in clusters: clear domes with a dark rim, each with a highlight of its own.
        high, slope = ripple(place.rest, 560.0, (4.9, 2.8, 8.1))
        veil, _ = ripple(place.rest, 90.0, (6.2, 3.5, 1.7))
        least = 0.95 - 0.24 * xp.clip((veil + 0.7 * scene.mucus - 0.72) / 0.12, 0.0, 1.0)
        clear = 1 - size / _FROTH
        inside = clear * xp.clip((high - least) / 0.03, 0.0, 1.0)
        rim = inside * xp.exp(-(((high - least) / 0.05) ** 2))
        pale = tuple(own * (1 - 0.45 * rim) + 0.12 * inside * (1 - rim) for own in looks.pale)
        lean = add(times(1 - inside, looks.lean), times(1.6 * inside, slope))
        return looks._replace(pale=pale, lean=lean, gloss=looks.gloss * (1 + 1.5 * inside))

    looks = only(size < _FINE, refine, looks)  # what is finer than a pixel is not drawn
    looks = only(place.polyp > 0.01, redden, looks)  # polyps are redder, with pits
    # Beyond the dentate line there is skin.
    skin = xp.clip((0.022 + 0.012 * (bend - 0.5) + 0.006 * (wide - 0.5) - place.arc) / 0.002, 0.0, 1.0)
    verge = xp.clip((0.008 - place.arc) / 0.006, 0.0, 1.0)
    pale = tuple(own * (1 - share * verge) for own, share in zip(_PALE, (0.25, 0.32, 0.40), strict=True))
    looks = looks._replace(blood=looks.blood * (1 - 0.45 * skin) + 0.30 * verge, pale=pale)
    for landmark in scene.landmarks:
        off = minus(place.rest, landmark.place)
        draw = _orifice if landmark.kind == ORIFICE else _valve
        near = dot(off, off) <= 9 * landmark.width * landmark.width
        looks = only(near, lambda now, by=draw, off=off, of=landmark: by(xp, now, of, off, bend), looks)
    looks = only(place.bleeding > 0.0, soak, looks)
    taken = (xp.exp(-share * looks.blood) for share in (_RED, _GREEN, _BLUE))
    looks = looks._replace(pale=tuple(own * left for own, left in zip(looks.pale, taken, strict=True)))
    looks = only(place.stool > 0.0, cover, looks)
    looks = only(scene.mucus > 0.0, slime, looks)
    return only((scene.mucus > 0.0) & (size < _FROTH), froth, looks)


def _orifice(xp: Any, looks: Looks, landmark: Landmark, off: Vector, bend: Any) -> Looks:
    """A dark slit, bent, within a ring of mucosa."""
    width, along = landmark.width, dot(off, landmark.along)
    square = dot(off, off)
    bent = xp.sqrt(xp.maximum(square - along * along, 0.0)) + 0.35 * along * along / width
    reach = xp.sqrt((along / width) ** 2 + (2.6 * bent / width) ** 2)
    dark = looks.dark * (1 - 0.93 / (1 + xp.exp(10 * (reach - 0.9))))
    round_it = xp.sqrt(square)
    blood = looks.blood - 0.16 * xp.exp(-(((round_it / width - 1.5) / 0.28) ** 2))
    slope = 0.9 * xp.exp(-(((round_it / width - 1.25) / 0.35) ** 2)) / xp.maximum(round_it, 1e-5)
    return looks._replace(blood=blood, dark=dark, lean=add(looks.lean, times(slope, off)))


def _valve(xp: Any, looks: Looks, landmark: Landmark, off: Vector, bend: Any) -> Looks:
    """Two lips of fat under the mucosa, and the slit between them."""
    width, along = landmark.width, dot(off, landmark.along)
    aside = xp.sqrt(xp.maximum(dot(off, off) - along * along, 0.0))
    reach = xp.sqrt((along / width) ** 2 + (1.7 * aside / width) ** 2)
    lips = 1 / (1 + xp.exp(9 * (reach - 1.0)))
    slit = xp.exp(-((aside / (0.09 * width)) ** 2)) / (1 + xp.exp(14 * (xp.abs(along) / width - 0.62)))
    red, green, blue = looks.pale
    slope = (1.3 * xp.exp(-(((reach - 1.0) / 0.30) ** 2)) - 0.9 * lips * (1 - slit)) / width
    lean = minus(looks.lean, times(slope, minus(off, times(along, landmark.along))))
    return looks._replace(
        blood=looks.blood - lips * (0.30 - 0.25 * bend),
        pale=(red, green * (1 - 0.08 * lips), blue * (1 - 0.38 * lips)),
        dark=looks.dark * (1 - 0.85 * slit),
        lean=lean,
    )


def _lit(xp: Any, looks: Looks, sight: Sight, scene: Scene) -> Vector:
    """What comes back of the guides' light, of the wall and of the film of water on it."""
    # The film is smoother than the wall; both lean as the noise does, turned into the camera's axes.
    lean = tuple(dot(looks.lean, axis) for axis in scene.axes)
    aside = minus(lean, times(dot(lean, sight.normal), sight.normal))
    film = _unit(xp, minus(sight.normal, aside))
    diffuse, glint = 0.0, 0.0
    for guide in scene.guides:
        way = minus(guide, times(sight.away, sight.ray))
        square = xp.maximum(dot(way, way), 1e-7)
        way = times(1 / xp.sqrt(square), way)
        power = xp.exp(-scene.spread * (1 - way[2])) / square
        diffuse = diffuse + power * xp.maximum((dot(film, way) + 0.15) / 1.15, 0.03)
        shine = xp.maximum(dot(film, _unit(xp, minus(way, sight.ray))), 0.0) ** 32
        glint = glint + power * (0.35 * shine * shine + 2.2 * shine**12)
    share = 1.0 / len(scene.guides)
    glint = glint * (0.35 * share * scene.wet * looks.gloss * looks.dark)
    # A lens that presses the wall sees light that has gone through it: red, without shape.
    pressed = xp.clip((0.0035 - sight.away) / 0.0028, 0.0, 1.0)
    diffuse, glint, through = (1 - pressed) * share * looks.dark * diffuse, (1 - pressed) * glint, 6e3 * pressed
    # Light that comes from the depth has been sent on by other wall before, and is redder.
    deep = xp.minimum(sight.away / _DEEP, 1.5)
    red, green, blue = looks.pale
    green, blue = green * (1 - 0.30 * deep), blue * (1 - 0.38 * deep)
    return (
        sight.dim * (red * diffuse + glint + 0.60 * through),
        sight.dim * (green * diffuse + glint + 0.07 * through),
        sight.dim * (blue * diffuse + 0.95 * glint + 0.035 * through),
    )


def _unit(xp: Any, vector: Vector) -> Vector:
    return times(1 / xp.sqrt(dot(vector, vector)), vector)
