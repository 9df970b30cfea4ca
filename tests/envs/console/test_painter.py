"""Pictures of the tip's camera, wherever the tip has pressed the wall away."""

import pytest

from haustra.envs.console.painter import Camera, Eye, Glance
from haustra.envs.console.vehicles import surroundings
from haustra.envs.view.picture.surface import ColonSurface


@pytest.mark.parametrize(("aside", "beyond"), [(0.05, 0.0), (0.0, 0.05)])
@pytest.mark.parametrize("makes_room", [True, False])
def test_a_tip_that_is_far_out_in_the_wall_sees_mucosa(colon_folder, scope, monkeypatch, aside, beyond, makes_room):
    """Aside, or beyond the colon's end; where sharp folds make no room, the lens is drawn from inside of them."""
    if not makes_room:
        monkeypatch.setattr(ColonSurface, "make_room", lambda *given: None)
    around = surroundings(colon_folder, scope)
    line = around.colon.centreline
    row = -1 if beyond else len(line.arc) // 2
    across, _, along = line.frames[row].T
    tip = line.points[row] + aside * across + beyond * along
    picture = Eye(Camera(around, 64)).draw(Glance(tip, line.frames[row], float(line.arc[row])))
    assert (picture.max(axis=2) > 20).mean() > 0.5
