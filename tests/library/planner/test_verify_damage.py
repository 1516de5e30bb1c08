"""Good plans of all kinds, damaged in every way: `verify` refuses each one."""

import math
from collections import Counter

import numpy as np
import pytest

from skyway.planner.pad_book import OPEN_MS, PadBook
from skyway.planner.verify import verify
from tests.library.planner.damages import harmless, of_claims, of_fields, of_order, of_physics
from tests.library.planner.damages.good_plan import Damage, fitted
from tests.library.planner.damages.good_plans import good_plans
from tests.long_cases import sampled

DAMAGES = (*of_fields.DAMAGES, *of_order.DAMAGES, *of_physics.DAMAGES, *of_claims.DAMAGES)


def test_the_good_plans_are_accepted_and_of_all_kinds():
    kinds = Counter(step.kind for good in good_plans() for step in good.steps)

    assert len(good_plans()) >= 24
    assert min(kinds[kind] for kind in ("PICK_UP", "FLY", "WAIT", "RECHARGE", "DELIVER")) >= 10
    for good in good_plans():
        assert verify(good.problem, good.plan) == ()
        assert verify(good.problem, fitted(good.plan, good.steps)) == ()


@pytest.mark.parametrize("every", sampled([6, 1], every=2))
@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_every_damage_is_refused(damage: Damage, every: int):
    """The sample is every sixth damaged plan."""
    damaged = [(good, plan) for good in good_plans() for plan in damage(good)]
    tried = damaged[::every]

    unseen = [(good.name, plan) for good, plan in tried if not verify(good.problem, plan)]

    assert len(damaged) >= 10
    assert unseen == []


@pytest.mark.parametrize("change", harmless.CHANGES, ids=lambda change: change.__name__)
def test_a_change_that_breaks_no_rule_is_accepted(change: Damage):
    harmless = [(good, plan) for good in good_plans() for plan in change(good)]

    refused = [found for good, plan in harmless if (found := verify(good.problem, plan))]

    assert len(harmless) >= 10
    assert refused == []


def test_a_pad_booked_beside_the_problem_is_refused():
    sessions = [(good, *recharge) for good in good_plans() for recharge in good.recharges]

    assert len(sessions) >= 10
    for good, number, step in sessions:
        start_ms, end_ms = math.floor(step.start_s * 1000), math.ceil(step.end_s * 1000)
        for held_ms, is_refused in (
            ((start_ms - 5000, start_ms), False),
            ((start_ms - 5000, start_ms + 2), True),
            ((start_ms + 1, end_ms - 1), True),
            ((end_ms - 2, OPEN_MS), True),
            ((end_ms, OPEN_MS), False),
        ):
            row = good.problem.network.row_of[step.station_id]
            book = PadBook.of_arrays(
                station=np.array([row]),
                pad=np.array([step.pad]),
                start_ms=np.array([7_000_000 + held_ms[0]]),
                end_ms=np.array([min(7_000_000 + held_ms[1], OPEN_MS)]),
            ).seen_from(7_000_000)

            found = verify(good.problem, good.plan, booked=book)

            rules = [violation.rule for violation in found if violation.step == number]
            assert rules == (["pad"] if is_refused else [])
