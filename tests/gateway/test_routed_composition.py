"""With cells, the calls of deliveries go to the servers of their networks."""

from collections.abc import AsyncIterator, Sequence
from csv import DictReader
from pathlib import Path

import pytest
from skyway_gateway.deliveries.records.delivery_rows import QueuedDelivery

from skyway.cells import NETWORK_HEADER
from skyway.contracts.forgotten_deliveries import ForgetDeliveries
from skyway.contracts.mission import CancelMissions
from skyway.contracts.station_check import NetworkStations
from skyway.geo import Position
from skyway.ids import DeliveryId, HoldId, NetworkId, StationId
from skyway.runtime.errors import ServiceUnavailable
from tests.gateway.fake_composition import STATIONS, FakeComposition
from tests.gateway.whole_gateway import Gateway, make_request, opened_gateway

CORRIDOR, CELL_HOST = NetworkId("corridor"), "corridor-cell"
CELLS = {CORRIDOR: f"http://{CELL_HOST}"}


@pytest.fixture
async def gateway(sqlite_url: str, tmp_path: Path) -> AsyncIterator[Gateway]:
    """A gateway with a cell for the network corridor."""
    async with opened_gateway(sqlite_url, tmp_path, cells=CELLS) as opened:
        announce(opened, CORRIDOR, STATIONS[:4])
        yield opened


@pytest.fixture
def cell(gateway: Gateway) -> FakeComposition:
    """The server of the network corridor, beside the server of all others."""
    gateway.peers.cells[CELL_HOST] = FakeComposition(gateway.clock)
    return gateway.peers.cells[CELL_HOST]


def announce(gateway: Gateway, network_id: str, station_ids: Sequence[str]) -> None:
    """Announce the stations of a network as composition does."""
    gateway.parts.networks.cached.put(
        NetworkStations(
            network_id=NetworkId(network_id),
            version=1,
            station_ids=tuple(map(StationId, station_ids)),
            positions=tuple(Position(-98.0, 29.0 + n) for n in range(len(station_ids))),
            parts=(0,) * len(station_ids),
        )
    )


async def test_a_delivery_lives_at_the_server_of_its_network(
    gateway: Gateway, cell: FakeComposition
) -> None:
    delivery_id = await gateway.planned()
    track = await gateway.http.get(f"/v1/deliveries/{delivery_id}/track", headers=gateway.customer)
    cancelled = await gateway.http.post(
        f"/v1/deliveries/{delivery_id}/cancel", json={}, headers=gateway.customer
    )

    assert track.status_code == cancelled.status_code == 200
    assert list(cell.booked) == [(delivery_id, 1)]
    assert len(cell.cancellations) == 1
    assert (gateway.composition.booked, gateway.composition.cancellations) == ({}, [])


async def test_quotes_of_a_cell_are_made_and_kept_there(
    gateway: Gateway, cell: FakeComposition
) -> None:
    made = await gateway.http.post(
        "/v1/quotes", json={**make_request(), "hold": True}, headers=gateway.customer
    )
    quote = made.json()
    chosen = {"quote_id": quote["quote_id"], "offer_id": quote["offers"][0]["offer_id"]}
    accepted = await gateway.post(chosen)

    assert (made.status_code, accepted.status_code) == (201, 202)
    assert (len(cell.quote_queries), len(cell.kept)) == (1, 1)
    assert gateway.composition.quote_queries == []


async def test_a_silent_cell_is_named(gateway: Gateway, cell: FakeComposition) -> None:
    cell.is_away = True

    answer = await gateway.http.post("/v1/quotes", json=make_request(), headers=gateway.customer)

    assert (answer.status_code, answer.headers["retry-after"]) == (503, "1")
    assert "the cell corridor" in answer.json()["detail"]


async def test_a_silent_cell_is_not_an_absent_delivery(
    gateway: Gateway, cell: FakeComposition
) -> None:
    delivery_id = await gateway.planned()
    routed, asked = gateway.parts.composition, cell.asked[0]
    cell.is_away = True
    cancel = CancelMissions(cancellation_id="c1", reason="changed my mind")
    calls = [
        routed.book(delivery_id, asked),
        routed.close(delivery_id),
        routed.cancel(delivery_id, cancel),
        routed.track(delivery_id),
        routed.release(HoldId("hld_1")),
        routed.forget(ForgetDeliveries(delivery_ids=(delivery_id,))),
    ]

    for each in calls:
        with pytest.raises(ServiceUnavailable, match="the cell corridor"):
            await each


async def test_a_delivery_without_a_stored_network_is_found_by_its_pickup(
    gateway: Gateway, cell: FakeComposition
) -> None:
    delivery_id = await gateway.planned()
    await gateway.execute("UPDATE deliveries SET network_id = NULL")

    closed = await gateway.parts.composition.close(delivery_id)

    assert [each.delivery_id for each in closed.missions] == [delivery_id]


async def test_deliveries_of_a_silent_cell_are_kept_when_others_are_forgotten(
    gateway: Gateway, cell: FakeComposition
) -> None:
    in_cell = await gateway.planned()
    elsewhere = await gateway.planned()
    await gateway.execute(
        f"UPDATE deliveries SET network_id = 'north' WHERE delivery_id = '{elsewhere}'"
    )
    cell.is_away = True

    answer = await gateway.parts.composition.forget(
        ForgetDeliveries(delivery_ids=(in_cell, elsewhere))
    )

    assert answer.kept == (in_cell,)
    assert gateway.composition.forgotten == [elsewhere]


async def test_a_station_of_an_outdated_network_still_names_its_cell(
    gateway: Gateway, cell: FakeComposition
) -> None:
    """A new version was announced and not read yet, and another server is silent."""
    gateway.parts.networks.cached.clear()
    gateway.composition.is_away = cell.is_away = True

    assert await gateway.parts.find.of_station(StationId(STATIONS[0])) == CORRIDOR


@pytest.mark.parametrize("cells", [CELLS, {}])
async def test_a_closed_network_gets_no_new_requests_and_waiting_ones_are_booked_later(
    sqlite_url: str, tmp_path: Path, cells: dict[NetworkId, str]
) -> None:
    closed = {"closed_networks": frozenset({CORRIDOR})}
    async with opened_gateway(sqlite_url, tmp_path, cells=cells) as gateway:
        waiting = await gateway.accepted()
    async with opened_gateway(sqlite_url, tmp_path, cells=cells, **closed) as gateway:
        announce(gateway, CORRIDOR, STATIONS[:4])
        refused = await gateway.post(make_request())
        quoted = await gateway.http.post(
            "/v1/quotes", json=make_request(), headers=gateway.customer
        )
        await gateway.book_next()
        state = (await gateway.get(waiting))["state"]
        other = await gateway.parts.find.of_station(StationId("nowhere"))
        gateway.parts.servers.open_for(other)
    async with opened_gateway(sqlite_url, tmp_path, cells=cells) as gateway:
        announce(gateway, CORRIDOR, STATIONS[:4])
        (due,) = await _due(gateway)
        await gateway.parts.booker.book_or_retry(due)
        planned = (await gateway.get(waiting))["state"]

    assert (refused.status_code, quoted.status_code) == (503, 503)
    assert "the network corridor is unavailable: it is closed" in refused.json()["detail"]
    assert (state, planned) == ("REQUESTED", "PLANNED")


async def test_a_closed_network_still_closes_its_deliveries(
    sqlite_url: str, tmp_path: Path
) -> None:
    closed = {"closed_networks": frozenset({CORRIDOR})}
    async with opened_gateway(sqlite_url, tmp_path, cells=CELLS) as gateway:
        delivery_id = await gateway.accepted()
    async with opened_gateway(sqlite_url, tmp_path, cells=CELLS, **closed) as gateway:
        announce(gateway, CORRIDOR, STATIONS[:4])
        path = f"/v1/deliveries/{delivery_id}/cancel"
        cancelled = await gateway.http.post(path, headers=gateway.customer)
        ended = await gateway.parts.booker.composition.close(DeliveryId(delivery_id))

    assert cancelled.status_code == 200, cancelled.text
    assert ended.is_closed


async def _due(gateway: Gateway) -> list[QueuedDelivery]:
    await gateway.execute("UPDATE deliveries SET next_try_wall_ms = 0")
    return [*await gateway.parts.booker.claim(limit=1)]


async def test_a_call_goes_to_the_server_of_the_network_or_station_in_its_path(
    gateway: Gateway, cell: FakeComposition
) -> None:
    for path in ("/v1/networks/corridor", "/v1/stations/bulverde/pads", "/v1/networks/north"):
        await gateway.http.get(path, headers=gateway.operator)

    seen = [(each.host, each.headers.get(NETWORK_HEADER.lower())) for each in gateway.forwarded]
    assert seen == [
        (CELL_HOST, "corridor"),
        (CELL_HOST, "corridor"),
        ("composition", "north"),
    ]


async def test_servers_are_asked_about_an_id_without_a_network_until_one_knows_it(
    gateway: Gateway, cell: FakeComposition
) -> None:
    gateway.peers.unknown_at = {"composition"}
    body = {"command": "HOLD"}

    found = await gateway.http.post(
        "/v1/missions/msn_1/commands", json=body, headers=gateway.operator
    )
    gateway.peers.unknown_at = {"composition", CELL_HOST}
    unknown = await gateway.http.get("/v1/missions/msn_2", headers=gateway.operator)
    gateway.peers.away = {CELL_HOST}
    perhaps = await gateway.http.get("/v1/missions/msn_2", headers=gateway.operator)

    assert (found.status_code, unknown.status_code, perhaps.status_code) == (200, 404, 503)
    asked = [(each.host, each.body) for each in gateway.forwarded if each.method == "POST"]
    assert sorted(asked) == [(host, b'{"command":"HOLD"}') for host in ("composition", CELL_HOST)]


async def test_a_call_does_not_wait_for_a_server_that_hangs_and_is_not_concerned(
    gateway: Gateway, cell: FakeComposition
) -> None:
    gateway.peers.hanging = {"composition"}

    found = await gateway.http.post(
        "/v1/missions/msn_1/commands", json={"command": "HOLD"}, headers=gateway.operator
    )

    assert found.status_code == 200
    assert [each.host for each in gateway.forwarded] == [CELL_HOST]


async def test_a_server_that_fails_does_not_hide_the_server_that_knows_an_id(
    gateway: Gateway, cell: FakeComposition
) -> None:
    gateway.peers.failing = {"composition"}
    found = await gateway.http.get("/v1/missions/msn_1", headers=gateway.operator)
    gateway.peers.unknown_at = {CELL_HOST}
    perhaps = await gateway.http.get("/v1/missions/msn_1", headers=gateway.operator)

    assert (found.status_code, perhaps.status_code) == (200, 503)


async def test_a_problem_of_unknown_length_is_not_held_in_memory(
    gateway: Gateway, cell: FakeComposition
) -> None:
    async def parts() -> AsyncIterator[bytes]:
        yield b'{"network": {"network_id": "corridor"}}'

    named = {"network": {"network_id": "corridor"}}
    await gateway.http.post("/v1/compositions", json=named, headers=gateway.customer)
    await gateway.http.post("/v1/compositions", content=parts(), headers=gateway.customer)

    assert [each.host for each in gateway.forwarded] == [CELL_HOST, "composition"]


async def test_a_list_names_the_cells_whose_part_is_missing(
    gateway: Gateway, cell: FakeComposition
) -> None:
    gateway.peers.pages = {
        "composition": {"items": [{"alarm_id": "alm_1"}, {"alarm_id": "alm_3"}]},
        CELL_HOST: {"items": [{"alarm_id": "alm_2"}]},
    }
    whole = await gateway.http.get("/v1/alarms?limit=50.0", headers=gateway.operator)
    gateway.peers.away = {CELL_HOST}
    part = await gateway.http.get("/v1/alarms", headers=gateway.operator)

    ids = [[each["alarm_id"] for each in answer.json()["items"]] for answer in (whole, part)]
    assert ids == [["alm_3", "alm_2", "alm_1"], ["alm_3", "alm_1"]]
    assert "skyway-silent-cells" not in whole.headers
    assert part.headers["skyway-silent-cells"] == "the cell corridor"


async def test_a_ground_stop_names_its_network(gateway: Gateway, cell: FakeComposition) -> None:
    refused = await gateway.http.post(
        "/v1/ground-stops", json={"reason": "storm"}, headers=gateway.operator
    )
    accepted = await gateway.http.post(
        "/v1/ground-stops",
        json={"reason": "storm", "network_id": "corridor"},
        headers=gateway.operator,
    )

    assert (refused.status_code, accepted.status_code) == (422, 200)
    assert "corridor" in refused.json()["detail"]
    assert [each.host for each in gateway.forwarded] == [CELL_HOST]


async def test_with_a_hundred_cells_a_silent_cell_fails_only_its_own_calls(
    sqlite_url: str, tmp_path: Path
) -> None:
    names = [f"region-{number:03}" for number in range(100)]
    cells = {NetworkId(name): f"http://{name}" for name in names}
    async with opened_gateway(sqlite_url, tmp_path, cells=cells) as gateway:
        gateway.peers.cells = {name: FakeComposition(gateway.clock) for name in names}
        gateway.peers.pages = {name: {"items": [{"alarm_id": f"alm_{name}"}]} for name in names}
        gateway.peers.pages["composition"] = {"items": []}
        for name in names:
            announce(gateway, name, [f"{name}-s1"])

        async def ask_each() -> list[tuple[int, str]]:
            """The answer of each cell, and the host that answered the last call."""
            found = []
            for name in names:
                path = f"/v1/stations/{name}-s1/pads"
                answer = await gateway.http.get(path, headers=gateway.operator)
                found.append((answer.status_code, gateway.forwarded[-1].host))
            return found

        assert await ask_each() == [(200, name) for name in names]
        whole = await gateway.http.get("/v1/alarms?limit=100", headers=gateway.operator)
        gateway.peers.away = {names[42]}
        part = await gateway.http.get("/v1/alarms?limit=100", headers=gateway.operator)
        as_csv = {**gateway.operator, "Accept": "text/csv"}
        rows = await gateway.http.get("/v1/alarms?limit=90", headers=as_csv)
        refused = [
            name for name, (status, _) in zip(names, await ask_each(), strict=True) if status == 503
        ]
        gateway.peers.away, gateway.peers.hanging = set(), {"composition", *names[:-1]}
        known = await gateway.http.get("/v1/missions/msn_1", headers=gateway.operator)

    ids = [[each["alarm_id"] for each in answer.json()["items"]] for answer in (whole, part)]
    assert ids[0] == [f"alm_{name}" for name in reversed(names)]
    assert ids[1] == [each for each in ids[0] if each != "alm_region-042"]
    assert part.headers["skyway-silent-cells"] == "the cell region-042"
    assert rows.headers["skyway-silent-cells"] == "the cell region-042"
    assert [row["alarm_id"] for row in DictReader(rows.text.splitlines())] == ids[1][:90]
    assert rows.links["next"]["url"].startswith("/v1/alarms?limit=90&cursor=")
    assert refused == ["region-042"]
    assert (known.status_code, gateway.forwarded[-1].host) == (200, names[-1])
