"""A bank of two short tubes with a bend, for tests of episodes: an insertion takes seconds."""

from dataclasses import replace
from functools import cache

from haustra.envs.tasks.bank import TASK_OPTIONS, Bank, make_bank
from haustra.envs.tasks.case import case_of
from haustra.models.scope.library import named_design
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

DESIGN = "paediatric"


@cache
def short_bank() -> Bank:
    design = named_design(DESIGN)
    colons = [
        swept_colon(winding([(0.08, 0.0), (0.08, turn), (0.12, 0.0)]), name=f"bend {turn}") for turn in (0.6, -0.6)
    ]
    cases = [case_of(colon, device_radius=design.diameter / 2) for colon in colons]
    return make_bank(cases, design, replace(TASK_OPTIONS, insertion_limit=0.32))
