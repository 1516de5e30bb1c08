from dataclasses import replace

import pytest

from skyway.experiments.instances import Setting, city_problem, connected_to, texas_problem
from skyway.ids import StationId


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
