"""Dry runs of commands and closures, in plain lines."""

from typing import Any

import pytest

from skyway.cli.outlook_text import delay_text, outlook_lines

PACKAGE: dict[str, Any] = {
    "package_id": "p1",
    "fate": "DELIVERED",
    "station_id": "kyle",
    "eta_at": "2026-03-01T12:30:00Z",
    "new_eta_at": "2026-03-01T12:31:35Z",
    "later_by_s": 95.0,
    "returns_at": None,
}

OUTLOOK: dict[str, Any] = {
    "plan": "NEW_PLAN",
    "code": None,
    "detail": None,
    "ends_mission": False,
    "next_landing": {"station_id": "buda", "at": "2026-03-01T12:20:00Z"},
    "packages": [PACKAGE],
}


def lines(**members: Any) -> list[str]:
    preview = {"mission_id": "mis_1", "command": "RESUME", "outlook": {**OUTLOOK, **members}}
    return list(outlook_lines(preview))


def test_a_new_plan_shows_where_the_drone_lands_and_when_packages_come() -> None:
    assert lines() == [
        "mis_1: RESUME would give the drone a new plan",
        "  the drone lands next at buda, 12:20:00",
        "  p1  expected 12:30:00, then 12:31:35 at kyle, 1 min 35 s later",
    ]


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ({"fate": "DELIVERED", "later_by_s": None}, "is delivered at kyle, 12:31:35"),
        ({"fate": "RETURNED", "returns_at": PACKAGE["eta_at"]}, "comes back to kyle, 12:30:00"),
        ({"fate": "NOT_PICKED_UP"}, "is not picked up at kyle"),
        ({"fate": "LEFT_BEHIND"}, "is left at kyle"),
        ({"fate": "LEFT_BEHIND", "station_id": None}, "is left at a station that is not known yet"),
        ({"fate": "WAITS"}, "waits at kyle"),
        ({"fate": "UNKNOWN"}, "nobody knows before a plan is found"),
    ],
)
def test_each_package_has_its_line(members: dict[str, Any], said: str) -> None:
    assert lines(packages=[{**PACKAGE, **members}])[-1] == f"  p1  {said}"


@pytest.mark.parametrize(
    ("members", "said"),
    [
        (
            {"plan": "NO_PLAN", "code": "OUT_OF_RANGE", "detail": "too far"},
            "finds no plan: OUT_OF_RANGE: too far",
        ),
        (
            {"plan": "NO_PLAN_YET", "code": "HELD", "detail": "held"},
            "could not be planned yet: HELD: held",
        ),
        ({"plan": "TIME_UP"}, "has found no plan in time"),
        ({"plan": "NOT_NEEDED"}, "needs no new plan"),
        ({"plan": "NOT_NEEDED", "ends_mission": True}, "would end the mission"),
        (
            {"plan": "NOT_NEEDED", "ends_mission": True, "detail": "when its drone agrees"},
            "would end the mission: when its drone agrees",
        ),
    ],
)
def test_the_first_line_says_what_becomes_of_the_plan(members: dict[str, Any], said: str) -> None:
    assert lines(**members)[0] == f"mis_1: RESUME {said}"


@pytest.mark.parametrize(
    ("plan", "later_by_s", "said"),
    [
        ("NEW_PLAN", 0.2, "last package no later"),
        ("NEW_PLAN", -61.0, "last package 1 min 1 s earlier"),
        ("NEW_PLAN", None, "not every package is delivered"),
        ("NO_PLAN", None, "no plan is found (C)"),
        ("NO_PLAN_YET", None, "no plan can be made yet (C)"),
        ("NOT_NEEDED", None, "needs no other plan"),
        ("TIME_UP", None, "no plan was found in time"),
    ],
)
def test_a_delay_is_short(plan: str, later_by_s: float | None, said: str) -> None:
    delay = {"plan": plan, "later_by_s": later_by_s, "code": "C", "detail": None}
    assert delay_text(delay) == said
