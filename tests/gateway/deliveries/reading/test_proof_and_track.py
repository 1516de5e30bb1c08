"""The proof of each package, and the track as GeoJSON."""

from datetime import timedelta
from typing import Any

import pytest

from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.geo import Position
from tests.gateway.whole_gateway import Gateway

PICKUP, MIDDLE, END = Position(-97.9, 29.8), Position(-98.0, 29.7), Position(-98.1, 29.6)


async def read(gateway: Gateway, delivery_id: str, what: str) -> Any:
    path = f"/v1/deliveries/{delivery_id}/{what}"
    return await gateway.http.get(path, headers=gateway.customer)


async def test_a_hand_over_leaves_its_proof(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    delivery_id = await gateway.planned(packages=2)
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    gateway.clock.advance(timedelta(minutes=11))
    await gateway.report(
        delivery_id,
        "DELIVERED",
        seq=4,
        package_ids=["p1"],
        station_id="mcqueeney",
        soc=0.6,
        data={
            "mass_kg": {"p1": 0.52},
            "load_before_kg": 1.02,
            "load_after_kg": 0.5,
            "place": {"station_id": "mcqueeney", "position": [-98.0, 29.6]},
        },
    )
    proof = (await read(gateway, delivery_id, "proof")).json()
    delivered, on_its_way = proof["packages"]
    assert delivered == {
        "package_id": "p1",
        "state": "DELIVERED",
        "custodian": {"kind": "RECIPIENT", "id": "mcqueeney"},
        "station_id": "mcqueeney",
        "position": [-98.0, 29.6],
        "at": "2026-03-01T12:11:00Z",
        "mission_id": f"msn_{delivery_id[4:]}_1",
        "provider_id": "prv_1",
        "drone_id": "drn_1",
        "soc": 0.6,
        "mass_kg": 0.52,
        "load_before_kg": 1.02,
        "load_after_kg": 0.5,
    }
    assert (on_its_way["state"], on_its_way["at"]) == ("LOADED", None)


@pytest.mark.parametrize(
    "data",
    [{}, {"mass_kg": "heavy", "place": "here"}, {"place": {"position": "x"}, "mass_kg": {}}],
)
async def test_unreadable_evidence_does_not_hold_up_the_delivery(
    gateway: Gateway, data: dict[str, Any]
) -> None:
    delivery_id = await gateway.planned()
    for seq, kind in enumerate(("ACCEPTED", "LOADING", "LOADED"), start=1):
        await gateway.report(delivery_id, kind, seq=seq)
    answer = await gateway.report(delivery_id, "DELIVERED", seq=4, package_ids=["p1"], data=data)
    assert answer.status_code == 204
    [package] = (await read(gateway, delivery_id, "proof")).json()["packages"]
    assert package["mass_kg"] is None
    assert package["drone_id"] == "drn_1"


@pytest.mark.parametrize("what", ["proof", "track"])
async def test_only_the_customer_reads_proof_and_track(gateway: Gateway, what: str) -> None:
    delivery_id = await gateway.planned()
    path = f"/v1/deliveries/{delivery_id}/{what}"
    for headers, status in (
        ({}, 401),
        (gateway.other, 404),
        (gateway.provider, 403),
        (gateway.operator, 200),
    ):
        assert (await gateway.http.get(path, headers=headers)).status_code == status


def _step(gateway: Gateway, kind: str, status: str, *, number: int, way: tuple[Any, Any]) -> Any:
    start_at = gateway.clock.now() + timedelta(minutes=10 * number)
    return TrackedStep(
        kind=kind,
        status=status,
        from_position=way[0],
        to_position=way[1],
        station_id={PICKUP: "san-marcos", MIDDLE: "bulverde", END: "mcqueeney"}[way[1]],
        start_at=start_at,
        end_at=start_at + timedelta(minutes=10),
        package_ids=("p1",) if kind in ("PICK_UP", "DELIVER") else (),
    )


async def test_the_track_shows_flown_and_planned_lines_and_the_drone(
    gateway: Gateway,
) -> None:
    delivery_id = await gateway.planned()
    here = Position(-98.05, 29.65)
    steps = (
        _step(gateway, "PICK_UP", "ENDED", number=0, way=(PICKUP, PICKUP)),
        _step(gateway, "FLY", "ENDED", number=1, way=(PICKUP, MIDDLE)),
        _step(gateway, "FLY", "UNDER_WAY", number=2, way=(MIDDLE, END)),
        _step(gateway, "DELIVER", "PLANNED", number=3, way=(END, END)),
    )
    mission = TrackedMission(
        mission_id="msn_1",
        provider_id="prv_1",
        drone_id="drn_1",
        steps=steps,
        position=here,
        position_at=gateway.clock.now(),
        soc=0.7,
    )
    gateway.composition.tracks[delivery_id] = Track(missions=(mission,))
    answer = await read(gateway, delivery_id, "track")
    assert answer.headers["content-type"] == "application/geo+json"
    collection = answer.json()
    assert collection["type"] == "FeatureCollection"
    flown, planned, drone, *stations = collection["features"]
    assert flown["properties"]["kind"] == "FLOWN"
    assert flown["geometry"]["coordinates"] == [list(PICKUP), list(MIDDLE), list(here)]
    assert planned["geometry"]["coordinates"] == [list(here), list(END)]
    assert planned["properties"]["end_at"] == "2026-03-01T12:30:00.000Z"
    assert drone["geometry"] == {"type": "Point", "coordinates": list(here)}
    assert drone["properties"]["soc"] == 0.7
    assert [one["properties"]["station_id"] for one in stations] == [
        "san-marcos",
        "bulverde",
        "mcqueeney",
    ]
    assert [one["properties"]["is_pickup"] for one in stations] == [True, False, False]
    assert [stop["kind"] for stop in stations[2]["properties"]["stops"]] == ["DELIVER"]


async def test_the_flown_line_of_a_standing_drone_ends_at_its_station(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()
    steps = (
        _step(gateway, "FLY", "ENDED", number=0, way=(PICKUP, MIDDLE)),
        _step(gateway, "RECHARGE", "UNDER_WAY", number=1, way=(MIDDLE, MIDDLE)),
        _step(gateway, "FLY", "PLANNED", number=2, way=(MIDDLE, END)),
    )
    mission = TrackedMission(
        mission_id="msn_1",
        provider_id="prv_1",
        drone_id="drn_1",
        steps=steps,
        position=MIDDLE,
        position_at=gateway.clock.now(),
        soc=0.7,
    )
    gateway.composition.tracks[delivery_id] = Track(missions=(mission,))
    flown, planned, *_ = (await read(gateway, delivery_id, "track")).json()["features"]
    assert flown["geometry"]["coordinates"] == [list(PICKUP), list(MIDDLE)]
    assert planned["geometry"]["coordinates"] == [list(MIDDLE), list(END)]


async def test_the_track_is_empty_before_the_booking(gateway: Gateway) -> None:
    delivery_id = await gateway.accepted()
    gateway.composition.is_away = True
    track = (await read(gateway, delivery_id, "track")).json()
    assert track == {"type": "FeatureCollection", "features": []}
