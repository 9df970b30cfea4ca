"""Pictures by OpenGL are those of exact rays; without OpenGL, shaders are still written down from the laws."""

import numpy as np
import pytest

from haustra.envs.view.picture import mucosa
from haustra.envs.view.picture.appearance import Appearance, Residue
from haustra.envs.view.picture.backends import best_backend
from haustra.envs.view.picture.camera import looking
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.gl_endoscope import GlEndoscope
from haustra.envs.view.picture.gl_shaders import write_carry, write_shade
from haustra.envs.view.picture.glsl import Glsl
from haustra.envs.view.picture.lens import Lens, lens_of, named_lens
from haustra.envs.view.picture.light import Response
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import ColonSurface, MovingSurface
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import entry_of
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.models.wall.moving_colon import AT_REST
from tests.bent_colon import winding
from tests.models.wall.conftest import RADIUS, swept_colon

needs_opengl = pytest.mark.skipif(best_backend() is None, reason="OpenGL draws nothing here")
LENSES = named_lens("cf-hq190l").at(90, 72), lens_of(named_design("adult").tip, 65, 65)


@pytest.fixture(scope="module")
def bent() -> Colon:
    return swept_colon(winding([(0.08, 0.0), (0.08, 0.6), (0.08, 0.0)]), name="bent")


def alike(scope: Endoscope, drawn: GlEndoscope, pose: CameraPose) -> tuple[np.ndarray, np.ndarray]:
    """Differences of grey levels of all pixels, and of distances that both know [m]."""
    view, picture = scope.look(pose), drawn.picture(pose)
    exact, distance = scope.develop(scope.radiance(view)), drawn.distance()
    both = (view.own >= 0) & np.isfinite(distance)
    assert ((view.own >= 0) == np.isfinite(distance)).mean() > 0.9999
    return np.abs(exact.astype(int) - picture).max(axis=-1), np.abs(view.distance[both] - distance[both])


@needs_opengl
@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: lens.name)
def test_a_colon_that_moved_and_is_pressed_is_drawn_as_by_rays(bent: Colon, lens: Lens) -> None:
    """Taken along with its axis, pushed out by a tip, and with all that a wall may have on it."""
    table = lumen_table(bent, device_radius=0.0064, with_mesentery=True)
    tables, (origin, axes) = stack([table.seen_from(*entry_of(bent))]), entry_of(bent)
    assert tables.mesentery is not None
    surface = MovingSurface(bent, tables, origin, axes)
    pose = np.tile(np.asarray(AT_REST), (tables.mesentery.nodes.shape[1], 1))
    pose[:, 0] = 0.004 * np.sin(np.linspace(0, np.pi, len(pose)))
    surface.move(pose)
    looks, random = Appearance(bent, surface, residue=Residue(0.4, 0.4)), np.random.default_rng(0)
    near = np.abs(surface.arcs - 0.07) < 0.02
    looks.known[near] = random.uniform(0, 1, (near.sum(), 5)) * random.integers(0, 2, (near.sum(), 5))
    looks.landmarks = np.array([[mucosa.VALVE, *surface.rest[np.argmin(np.abs(surface.arcs - 0.08))], 0.011, 1, 0, 0]])
    scope = Endoscope(bent, lens, surface=surface, appearance=looks, threads=1)
    drawn = GlEndoscope(bent, lens, surface=surface, appearance=looks)
    for arc, aside in ((0.03, 0.0), (0.06, 0.95), (0.1, 0.5)):
        station = int(np.searchsorted(bent.centreline.arc, arc))
        here = surface.line[station] + aside * RADIUS * bent.centreline.frames[station][:, 0]
        towards = surface.line[station + 8] - surface.line[station]
        camera = CameraPose(here, looking(towards, bent.centreline.frames[station][:, 0]))
        surface.make_room(here, -camera.rotation[:, 2], arc, 0.0064)
        off, apart = alike(scope, drawn, camera)
        assert (off <= 1).mean() > 0.9995
        assert apart.max() < 1e-6
    drawn.device.close()


@needs_opengl
def test_gain_and_what_changes_between_pictures_are_honoured(bent: Colon) -> None:
    """A fixed gain, blood that comes later, and vertices that are placed elsewhere."""
    lens, response, surface = LENSES[0], Response(gain=1e-4), ColonSurface(bent)
    looks = Appearance(bent, surface)
    scope = Endoscope(bent, lens, surface=surface, appearance=looks, response=response, threads=1)
    drawn = GlEndoscope(bent, lens, surface=surface, appearance=looks, response=response)
    line = bent.centreline
    camera = CameraPose(line.points[20], looking(line.points[28] - line.points[20], line.frames[20][:, 0]))
    plain = drawn.picture(camera).astype(int)
    drawn.bleed(line.points[30] + RADIUS * line.frames[30][:, 0], 0.03)
    assert (np.abs(drawn.picture(camera) - plain).max(axis=-1) > 20).any()
    surface.place(bent.lumen.vertices + np.array([0.0, 0.0, 0.003]))
    off, apart = alike(scope, drawn, camera)
    assert (off <= 1).mean() > 0.9995 and apart.max() < 1e-6
    drawn.device.close()


@needs_opengl
def test_pictures_are_fetched_while_the_next_is_drawn(bent: Colon) -> None:
    """Each is that of its own pose; parts of a picture are timed one after the other."""
    lens, surface = LENSES[1], ColonSurface(bent)
    drawn, line = GlEndoscope(bent, lens, surface=surface, response=Response(gain=1e-4)), bent.centreline
    poses = [
        CameraPose(line.points[at], looking(line.points[at + 8] - line.points[at], line.frames[at][:, 0]))
        for at in (10, 20, 30)
    ]
    alone = [drawn.picture(pose) for pose in poses]
    assert (alone[0] != alone[1]).any() and (alone[1] != alone[2]).any()
    first = drawn.draw(poses[0])
    second = drawn.draw(poses[1])
    np.testing.assert_array_equal(drawn.fetch(first), alone[0])
    third = drawn.draw(poses[2])
    np.testing.assert_array_equal(drawn.fetch(second), alone[1])
    np.testing.assert_array_equal(drawn.fetch(third), alone[2])
    with pytest.raises(AssertionError, match="gone"):
        drawn.fetch(first)
    times = drawn.part_times(poses[0])
    assert list(times) == ["surface", "nearest", "shading", "exposure", "copy"] and min(times.values()) >= 0
    drawn.device.close()


@pytest.mark.parametrize("response", [Response(noise=0.02), Response(exposure=0.02)])
def test_what_opengl_does_not_draw_is_refused(bent: Colon, response: Response) -> None:
    with pytest.raises(InvalidOptionError, match="draw them by rays"):
        GlEndoscope(bent, LENSES[0], response=response)


def test_laws_are_written_down() -> None:
    """Real numbers win over whole ones, quotients are real, and what is given is not computed again."""
    own = Glsl()
    index = own.given("i", "int")
    own.xp.where(index + 1 < 3, 2.0 * index, 0.5)
    assert own.text.split("\n") == [
        "  int t1 = i + 1;",
        "  bool t2 = t1 < 3;",
        "  float t3 = float(i) * (2.0);",
        "  float t4 = t2 ? t3 : (0.5);",
    ]
    with pytest.raises(TypeError, match=r"xp\.where"):
        bool(index < 1)
    assert write_shade((0, 1), 3).count("lattice(") == 1 + 2 * 10 and "device[" in write_carry()
