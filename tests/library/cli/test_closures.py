"""`skyway close`: makes closures, shows whom they affect, and closes nothing in a dry run."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

POLYGON = {"type": "Polygon", "coordinates": [[[0, 0], [0, 1], [1, 1], [0, 0]]]}

MADE: dict[str, Any] = {
    "closure_id": "clo_1",
    "kind": "STATION",
    "network_id": "texas",
    "station_id": "kyle",
    "pad": None,
    "from_id": None,
    "to_id": None,
    "provider_id": None,
    "drone_model_id": None,
    "reason": "roof works",
    "from_at": "2026-03-01T12:00:00Z",
    "until": None,
    "affected_missions": [
        {
            "mission_id": "mis_1",
            "drone_id": "drn_1",
            "station_id": "kyle",
            "at": "2026-03-01T12:30:00Z",
            "is_flying": True,
            "delay": None,
        }
    ],
    "missions_without_delay": 1,
}

PATHS = {
    "station": "/v1/stations/kyle/closures",
    "pad": "/v1/stations/kyle/pads/2/outages",
    "segment": "/v1/segments/kyle/buda/closures",
    "zone": "/v1/zones",
    "ground-stop": "/v1/ground-stops",
}


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    answering_gateway.answers |= {("POST", path): (201, MADE) for path in PATHS.values()}
    answering_gateway.answers["GET", "/v1/clock"] = (200, {"now": "2026-03-01T12:00:00Z"})
    return answering_gateway


@pytest.fixture
def area(tmp_path: Path) -> Path:
    file = tmp_path / "area.json"
    file.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": POLYGON}))
    return file


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), ["close", *arguments])


def test_a_closed_station_names_the_missions_that_need_another_plan(gateway: Gateway) -> None:
    result = run("station", "kyle", "--reason", "roof works", "--until", "+2h")

    assert result.exit_code == 0, result.output
    assert gateway.calls[-1] == (
        "POST",
        PATHS["station"],
        {"reason": "roof works", "until": "2026-03-01T14:00:00+00:00"},
    )
    assert result.stdout == (
        "clo_1  station kyle  since 2026-03-01T12:00:00Z  roof works\n"
        "  mis_1  drn_1  kyle  2026-03-01T12:30:00Z  flying\n"
        "1 mission needs another plan\n"
    )


def test_a_dry_run_closes_nothing(gateway: Gateway) -> None:
    preview = {**MADE, "closure_id": None, "affected_missions": [], "missions_without_delay": 0}
    gateway.answers["POST", PATHS["station"]] = (200, preview)

    result = run("station", "kyle", "--dry-run")

    assert gateway.queries == ["dry_run=true"]
    assert result.stdout.splitlines() == [
        "would close  station kyle  since 2026-03-01T12:00:00Z  roof works",
        "no missions would need another plan",
    ]


def test_a_dry_run_says_how_much_later_missions_deliver(gateway: Gateway) -> None:
    mission = MADE["affected_missions"][0]
    later = {"plan": "NEW_PLAN", "later_by_s": 95.0, "code": None, "detail": None}
    affected = [{**mission, "delay": later}, {**mission, "mission_id": "mis_2"}]
    preview = {**MADE, "closure_id": None, "affected_missions": affected}
    gateway.answers["POST", PATHS["station"]] = (200, preview)

    result = run("station", "kyle", "--dry-run")

    assert result.stdout.splitlines()[1:] == [
        "  mis_1  drn_1  kyle  2026-03-01T12:30:00Z  flying  last package 1 min 35 s later",
        "  mis_2  drn_1  kyle  2026-03-01T12:30:00Z  flying",
        "2 missions would need another plan",
        "delays were planned for the first 1 only",
    ]


@pytest.mark.parametrize(
    ("arguments", "body"),
    [
        (("pad", "kyle", "2"), {}),
        (
            ("segment", "kyle", "buda", "--from", "2026-03-01T15:00:00Z"),
            {"from_at": "2026-03-01T15:00:00+00:00"},
        ),
        (
            ("ground-stop", "--reason", "storm", "--provider", "prv_1"),
            {"reason": "storm", "provider_id": "prv_1"},
        ),
    ],
)
def test_each_kind_has_its_call(gateway: Gateway, arguments: tuple[str, ...], body: Any) -> None:
    assert run(*arguments).exit_code == 0
    assert gateway.calls == [("POST", PATHS[arguments[0]], body)]


def test_a_zone_is_read_from_a_file(gateway: Gateway, area: Path) -> None:
    assert run("zone", "texas", str(area)).exit_code == 0
    assert gateway.calls[-1][2] == {"network_id": "texas", "area": POLYGON}


@pytest.mark.parametrize("content", ["{", "[]", '{"type": "Point", "coordinates": [0, 0]}'])
def test_a_file_without_a_polygon_is_refused(gateway: Gateway, area: Path, content: str) -> None:
    area.write_text(content)

    result = run("zone", "texas", str(area))

    assert result.exit_code == 1
    assert str(area) in result.stderr
    assert gateway.calls == []


def test_programs_get_the_answer_as_it_is(gateway: Gateway) -> None:
    assert json.loads(run("station", "kyle", "--json").stdout) == MADE


def test_a_refusal_says_why(gateway: Gateway) -> None:
    gateway.answers["POST", PATHS["station"]] = (404, {"detail": "no station is called kyle"})

    result = run("station", "kyle")

    assert result.exit_code == 1
    assert "no station is called kyle" in result.stderr
