"""What the contact law's page says of MuJoCo's friction: how near to Coulomb's law pieces and planes come."""

import pytest

from haustra.models.wall.law import IMPEDANCE_RATIO, SLIP_RELAXATION
from haustra.scripts.bench.accuracy.friction_law import coulomb


@pytest.mark.parametrize("relaxation", [1.0, SLIP_RELAXATION])
@pytest.mark.parametrize(("load", "friction"), [(1.0, 0.1), (10.0, 0.1), (5.0, 0.3)])
def test_up_to_a_friction_of_one_and_a_half_newtons_contacts_creep_at_less_than_the_slip_speed(
    load: float, friction: float, relaxation: float
) -> None:
    found = coulomb(load, friction, impratio=IMPEDANCE_RATIO / relaxation, relaxation=relaxation)
    assert 0 <= found.creep <= 1.02
    assert 0 <= found.inflation < 0.23 * relaxation
    assert found.late < 0.001


def test_pairs_press_less_while_they_slide() -> None:
    pieces, planes = (coulomb(1.0, 0.1, impratio=IMPEDANCE_RATIO / s, relaxation=s) for s in (1.0, SLIP_RELAXATION))
    assert planes.inflation == pytest.approx(SLIP_RELAXATION * pieces.inflation, rel=0.1)
