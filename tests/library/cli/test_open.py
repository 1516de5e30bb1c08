"""`skyway open` lifts closures, and `skyway closures` lists them."""

import json
from typing import Any

import pytest
from typer.testing import CliRunner

from skyway.cli.main import make_app
from tests.library.cli.conftest import Gateway

STATION: dict[str, Any] = {
    "kind": "STATION",
    "from_at": "2026-03-01T12:00:00Z",
    "until": "2026-03-01T14:00:00Z",
    "network_id": "texas",
    "station_id": "kyle",
    "reason": "roof works",
}
STOP: dict[str, Any] = {
    "kind": "GROUND_STOP",
    "from_at": "2026-03-01T11:00:00Z",
    "provider_id": "prv_1",
    "reason": "storm",
}
SEGMENT: dict[str, Any] = {
    "kind": "SEGMENT",
    "from_at": "2026-03-01T13:00:00Z",
    "station_id": "kyle",
    "to_station_id": "buda",
}


def run(*arguments: str) -> Any:
    return CliRunner().invoke(make_app(), [*arguments])


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    return answering_gateway


def show(gateway: Gateway, closures: dict[str, Any]) -> None:
    data = json.dumps({"closures": closures})
    snapshot = f"id: a-1\nevent: snapshot\ndata: {data}\n\n"
    gateway.answers["GET", "/v1/live"] = (200, snapshot.encode())


@pytest.mark.parametrize(
    ("arguments", "path"),
    [
        (("station", "kyle"), "/v1/stations/kyle/closures"),
        (("pad", "kyle", "2"), "/v1/stations/kyle/pads/2/outages"),
        (("segment", "kyle", "buda"), "/v1/segments/kyle/buda/closures"),
    ],
)
def test_all_closures_of_a_place_are_lifted(
    gateway: Gateway, arguments: tuple[str, ...], path: str
) -> None:
    items = [{"closure_id": "clo_1"}, {"closure_id": "clo_2"}]
    gateway.answers |= {
        ("GET", path): (200, {"items": items, "next_cursor": None}),
        ("DELETE", f"{path}/clo_1"): (204, None),
        ("DELETE", f"{path}/clo_2"): (204, None),
    }

    result = run("open", *arguments)

    assert result.stdout == "clo_1 is lifted\nclo_2 is lifted\n"
    assert gateway.called[1:] == [("DELETE", f"{path}/clo_1"), ("DELETE", f"{path}/clo_2")]


def test_a_place_that_is_open_is_named(gateway: Gateway) -> None:
    path = "/v1/stations/kyle/closures"
    gateway.answers["GET", path] = (200, {"items": [], "next_cursor": None})

    result = run("open", "station", "kyle")

    assert (result.exit_code, result.stderr) == (1, "station kyle is not closed\n")


@pytest.mark.parametrize("kind", ["zone", "ground-stop"])
def test_zones_and_ground_stops_are_lifted_by_their_ids(gateway: Gateway, kind: str) -> None:
    gateway.answers["DELETE", f"/v1/{kind}s/clo_1"] = (204, None)

    assert run("open", kind, "clo_1").stdout == "clo_1 is lifted\n"


def test_everything_that_is_closed_has_a_line(gateway: Gateway) -> None:
    show(gateway, {"clo_1": STATION, "clo_2": STOP, "clo_3": SEGMENT})

    assert run("closures").stdout.splitlines() == [
        "clo_2  ground stop of prv_1  since 2026-03-01T11:00:00Z  storm",
        "clo_1  station kyle  2026-03-01T12:00:00Z to 2026-03-01T14:00:00Z  roof works",
        "clo_3  segment kyle to buda  since 2026-03-01T13:00:00Z",
    ]


def test_closures_as_json_have_their_ids(gateway: Gateway) -> None:
    show(gateway, {"clo_2": STOP})

    assert json.loads(run("closures", "--json").stdout) == [{"closure_id": "clo_2", **STOP}]


def test_nothing_closed_says_so(gateway: Gateway) -> None:
    show(gateway, {})

    assert run("closures").stdout == "nothing is closed\n"


def test_closures_without_a_gateway_say_so(gateway: Gateway) -> None:
    result = run("closures")

    assert result.exit_code == 1
    assert "404" in result.stderr
