from collections import defaultdict
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from skyway_lab.experiments.instances import (
    Setting,
    city_problem,
    connected_to,
    taken_book,
    taken_pads,
    texas_problem,
)

from skyway.ids import StationId
from skyway.network.synthetic import synthetic_city
from skyway.planner.problem_parts import PadReservation


@pytest.mark.parametrize("make_problem", [city_problem, texas_problem])
def test_the_same_seed_makes_the_same_instance(make_problem):
    setting = Setting(stations=12, packages=3, taken=0.3)

    assert make_problem(setting, seed=5) == make_problem(setting, seed=5)
    assert make_problem(setting, seed=5) != make_problem(setting, seed=6)


def test_the_request_depends_neither_on_reservations_nor_on_the_policy():
    setting = Setting(stations=12)
    other = replace(setting, taken=0.5, recharge_policy="partial")

    one, two = city_problem(setting, seed=3), city_problem(other, seed=3)

    assert (one.network, one.source, one.packages) == (two.network, two.source, two.packages)


@pytest.mark.parametrize("packages", [1, 4, 12])
def test_no_instance_is_too_heavy(packages):
    problem = city_problem(Setting(stations=20, packages=packages), seed=1)

    load_kg = sum(package.mass_kg for package in problem.packages)
    assert 0 < load_kg <= problem.drone.model.max_payload_kg


def test_packages_stay_below_the_heaviest():
    problem = texas_problem(Setting(packages=4, heaviest_kg=0.2), seed=1)

    assert max(package.mass_kg for package in problem.packages) <= 0.2


def test_texan_requests_stay_where_san_marcos_can_reach():
    problem = texas_problem(Setting(packages=5), seed=2)

    reachable = set(connected_to(problem.network, StationId("san-marcos")))
    assert {problem.source, *(package.destination for package in problem.packages)} <= reachable


HORIZON_S = 400_000.0
CITY = synthetic_city(stations=8, seed=1)


def end_s(held: PadReservation) -> float:
    assert held.end_s is not None
    return held.end_s


@pytest.mark.parametrize("share", [0.3, 0.8, 0.95])
def test_the_share_of_the_pads_time_is_taken(share):
    reserved_s = sum(
        min(end_s(held), HORIZON_S) - max(held.start_s, 0.0)
        for held in taken_pads(CITY, share=share, seed=1, horizon_s=HORIZON_S)
    )

    assert reserved_s / (8 * 4 * HORIZON_S) == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("share", [0.3, 0.8, 0.95])
def test_the_share_is_taken_in_a_pad_book_too(share):
    book = taken_book(CITY, np.arange(8), share=share, seed=1, horizon_s=HORIZON_S)
    starts_s = np.maximum(book.start_ms / 1000, 0.0)
    ends_s = np.minimum(book.end_ms / 1000, HORIZON_S)

    taken_s = np.maximum(ends_s - starts_s, 0.0).sum()
    assert taken_s / (8 * 4 * HORIZON_S) == pytest.approx(share, abs=0.03)


def test_no_two_sessions_of_a_pad_overlap():
    by_pad = defaultdict(list)
    for held in taken_pads(CITY, share=0.9, seed=1):
        by_pad[held.station_id, held.pad].append((held.start_s, end_s(held)))

    assert len(by_pad) == 8 * 4
    for sessions in by_pad.values():
        assert all(start_s >= last_s for (_, last_s), (start_s, _) in pairwise(sessions))


def test_the_same_seed_takes_the_same_pads():
    assert taken_pads(CITY, share=0.5, seed=1) == taken_pads(CITY, share=0.5, seed=1)
    assert taken_pads(CITY, share=0.5, seed=1) != taken_pads(CITY, share=0.5, seed=2)


def test_at_share_0_no_pad_is_reserved():
    assert taken_pads(CITY, share=0.0, seed=1) == ()
