"""A composition serves only its own networks."""

from typing import Any

import pytest
from skyway_composition.own_cells import OwnCells
from skyway_composition.settings import CompositionSettings

from skyway.cells import NETWORK_HEADER
from skyway.contracts.mission import BookMissions
from skyway.contracts.shortlist import Shortlist
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.ids import DroneId, NetworkId, StationId
from skyway.runtime.errors import InvalidSettings

OPERATOR, GATEWAY = "operator:op", "service:gateway"
BOOKING_PATH = "/internal/deliveries/dlv_1/missions"
OURS, OTHERS = "http://ours", "http://others"
ROW = NetworkId("row")


async def move_away(composition: Any) -> OwnCells:
    """Let the settings give the published network to another composition."""
    own: OwnCells = composition.parts.own_cells
    own.cells = {ROW: OTHERS}
    await own.read_database(composition.db)
    return own


async def test_requests_for_the_network_of_another_composition_are_refused(
    composition: Any, make: Any
) -> None:
    await move_away(composition)
    network = make.network()

    refused = [
        await composition(OPERATOR, "GET", "/v1/networks/row"),
        await composition(OPERATOR, "PUT", "/v1/networks/row", network),
        await composition(None, "GET", "/internal/networks/row/stations", **gateway_secret()),
        await composition(OPERATOR, "GET", "/v1/missions", **{NETWORK_HEADER: "row"}),
    ]

    assert [each.status_code for each in refused] == [421] * 4
    for each in refused:
        assert "row is served by http://others, not by this" in each.json()["detail"]
    assert (await composition(OPERATOR, "GET", "/v1/missions")).status_code == 200


def gateway_secret() -> dict[str, str]:
    return {"Authorization": "Bearer secret of gateway"}


async def test_a_request_for_an_own_network_is_answered(composition: Any) -> None:
    own: OwnCells = composition.parts.own_cells
    own.cells, own.url = {ROW: OTHERS}, OTHERS

    found = await composition(OPERATOR, "GET", "/v1/networks/row", **{NETWORK_HEADER: "row"})
    other = await composition(OPERATOR, "GET", "/v1/missions", **{NETWORK_HEADER: "new"})

    assert (found.status_code, other.status_code) == (200, 421)


@pytest.mark.parametrize(("method", "path"), [("PUT", BOOKING_PATH), ("POST", "/internal/quotes")])
async def test_a_gateway_that_does_not_name_the_network_cannot_book_it_elsewhere(
    composition: Any, make: Any, method: str, path: str
) -> None:
    booking = BookMissions(
        attempt=1, request=make.request("c"), shortlist=Shortlist.of([make.candidate()])
    ).model_dump(mode="json")
    await move_away(composition)
    body = booking if method == "PUT" else {k: v for k, v in booking.items() if k != "attempt"}

    refused = await composition(GATEWAY, method, path, body)

    assert refused.status_code == 421, refused.text
    assert await composition.rows("SELECT mission_id FROM missions") == []


async def test_a_network_that_was_moved_away_is_neither_listed_nor_found(composition: Any) -> None:
    await move_away(composition)
    query = StationCheckQuery(station_ids=(StationId("b"),), reachable_from=StationId("a"))

    listed = await composition(OPERATOR, "GET", "/v1/networks")
    checked = await composition(
        GATEWAY, "POST", "/internal/station-checks", query.model_dump(mode="json")
    )

    assert listed.json()["items"] == []
    assert StationCheck.read(checked.content).unknown == ("b",)


async def test_a_composition_does_not_start_with_open_missions_of_another_network(
    composition: Any,
) -> None:
    await composition.book()

    with pytest.raises(
        InvalidSettings, match=r"SKYWAY_CELLS: row is at http://others.* 1 missions"
    ):
        await move_away(composition)


async def test_messages_of_drones_of_other_cells_are_dropped(composition: Any) -> None:
    own = await move_away(composition)
    for drone_id, network_id in (("drn_1", "row"), ("drn_2", "south"), ("drn_3", None)):
        own.note_home(DroneId(drone_id), NetworkId(network_id) if network_id else None)

    are_ours = [
        composition.parts.quarantine.is_ours(("prv_1", f"drn_{number}")) for number in range(1, 5)
    ]

    assert are_ours == [False, True, True, True]


def settings(monkeypatch: pytest.MonkeyPatch, **given: str) -> CompositionSettings:
    """The settings of an environment with these variables."""
    needed = {"DATABASE_URL": "sqlite:///a.db", "MQTT_URL": "mqtt://a", "SECRETS_DIR": "/s"}
    for name, value in (needed | given).items():
        monkeypatch.setenv(f"SKYWAY_{name}", value)
    return CompositionSettings.load()


def test_a_composition_without_an_address_serves_what_has_no_cell(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    own = OwnCells.of(settings(monkeypatch, CELLS="texas=http://texas:8002, ohio=http://o/c"))

    assert [own.serves(NetworkId(each)) for each in ("texas", "ohio", "row")] == [
        False,
        False,
        True,
    ]


def test_a_cell_serves_the_networks_that_the_settings_give_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = {"CELLS": "texas=http://texas:8002,ohio=http://o", "CELL_URL": "http://texas:8002"}
    own = OwnCells.of(settings(monkeypatch, **given))

    assert [own.serves(NetworkId(each)) for each in ("texas", "ohio", "row")] == [
        True,
        False,
        False,
    ]


def test_an_address_that_serves_no_network_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {"CELLS": "texas=http://texas:8002", "CELL_URL": "http://ohio:8002"}

    with pytest.raises(InvalidSettings, match=r"SKYWAY_CELL_URL: .*http://ohio:8002 serves no"):
        settings(monkeypatch, **given)
