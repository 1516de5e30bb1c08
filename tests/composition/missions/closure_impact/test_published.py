"""A new version of a network: missions that use what it removes or closes need other plans."""

import copy
from typing import Any

import pytest
from skyway_composition.missions.mission import store

OPERATOR, PATH = "operator:op", "/v1/networks/row"


async def troubles(composition: Any) -> list[tuple[str, str] | None]:
    async with composition.db.read() as connection:
        records = await store.page(connection, store.MissionFilter(), before=None, limit=100)
    found = [each.trouble for each in records]
    return [None if each is None else (each.code, each.detail) for each in found]


async def publish(composition: Any, network: dict[str, Any]) -> None:
    answer = await composition(OPERATOR, "PUT", PATH, network)
    assert answer.status_code == 200, answer.text


def one_way_only(network: dict[str, Any], from_id: str, to_id: str) -> dict[str, Any]:
    """The network with only this direction of a segment."""
    changed = copy.deepcopy(network)
    for feature in changed["features"]:
        properties, line = feature["properties"], feature["geometry"]["coordinates"]
        if {properties.get("from"), properties.get("to")} == {from_id, to_id}:
            if properties["from"] != from_id:
                line.reverse()
            properties |= {"from": from_id, "to": to_id, "one_way": True}
    return changed


def with_zone(network: dict[str, Any], west: float, east: float, **times: str) -> dict[str, Any]:
    ring = [[west, -0.1], [east, -0.1], [east, 0.1], [west, 0.1], [west, -0.1]]
    zone = {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"kind": "zone", "zone_id": "fair", **times},
    }
    return {**network, "features": [*network["features"], zone]}


async def test_a_new_zone_affects_the_missions_that_would_fly_there(
    composition: Any, make: Any
) -> None:
    await composition.book()

    await publish(composition, with_zone(make.network(), 0.15, 0.2))

    (expected,) = await troubles(composition)
    assert expected is not None
    assert expected[0] == "ZONE_AHEAD"
    assert "zone 'fair' is closed to flight" in expected[1]
    assert (await composition.reports())[-1].kind == "REPLANNING"


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize(
    ("west", "east", "times"),
    [(0.6, 0.8, {}), (0.15, 0.2, {"active_until": "2026-03-01T12:00:00Z"})],
)
async def test_a_zone_elsewhere_or_at_another_time_affects_no_mission(
    composition: Any, make: Any, west: float, east: float, times: dict[str, str]
) -> None:
    await composition.book()

    await publish(composition, with_zone(make.network(), west, east, **times))

    assert await troubles(composition) == [None]


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_an_unchanged_zone_affects_no_mission_again(composition: Any, make: Any) -> None:
    zoned = with_zone(make.network(), 0.15, 0.2, active_from="2026-03-09T12:00:00Z")
    await publish(composition, zoned)
    await composition.book()

    await publish(composition, {**zoned, "settings": {**zoned["settings"], "loading_s": 61}})

    assert await troubles(composition) == [None]


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize(
    ("kept", "expected"),
    [
        (("b", "a"), ("SEGMENT_CLOSED", "no longer in the network: a to b")),
        (("c", "b"), ("SEGMENT_CLOSED", "no longer in the network: b to c")),
        (("c", "d"), None),
    ],
)
async def test_a_removed_segment_affects_the_missions_that_would_fly_it(
    composition: Any, make: Any, kept: tuple[str, str], expected: tuple[str, str] | None
) -> None:
    await composition.book()

    await publish(composition, one_way_only(make.network(), *kept))

    (trouble,) = await troubles(composition)
    assert (trouble and (trouble[0], trouble[1].split(" from ")[0])) == expected


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_a_removed_station_affects_the_missions_that_would_land_there(
    composition: Any, make: Any
) -> None:
    """With twice the battery the drone does not charge there, so it has no pad there."""
    candidate = make.candidate()
    model = candidate.model.model_copy(update={"battery_j": 1_800_000.0})
    await composition.book(candidate.model_copy(update={"model": model}), request=make.request("b"))

    await publish(composition, make.network(stations="acde"))

    (trouble,) = await troubles(composition)
    assert trouble is not None
    assert trouble[1].startswith("no longer in the network: ")


def with_connectors(network: dict[str, Any], station_id: str, *connectors: str) -> dict[str, Any]:
    changed = copy.deepcopy(network)
    for feature in changed["features"]:
        if feature["properties"].get("station_id") == station_id:
            feature["properties"]["pad_connectors"] = connectors
    return changed


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
@pytest.mark.parametrize(
    ("connector", "now", "is_hit"),
    [("pin", ["blade"], True), ("pin", ["blade", "pin"], False), (None, ["blade"], False)],
)
async def test_pads_that_no_longer_fit_affect_the_missions_that_would_charge_there(
    composition: Any, make: Any, connector: str | None, now: list[str], is_hit: bool
) -> None:
    candidate = make.candidate()
    model = candidate.model.model_copy(update={"connector": connector})
    await composition.book(candidate.model_copy(update={"model": model}))

    await publish(composition, with_connectors(make.network(), "b", *now))

    (trouble,) = await troubles(composition)
    assert (trouble and (trouble[0], trouble[1].split(" from ")[0])) == (
        ("PAD_OUT_OF_ORDER", "the pads have other connectors now: b") if is_hit else None
    )


@pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)
async def test_the_next_plan_uses_the_new_version(composition: Any, drone: Any, make: Any) -> None:
    await composition.book()
    (first,) = await composition.sent()
    await composition.receive(drone.ack(first))

    await publish(composition, with_zone(make.network(), 0.15, 0.2))
    await composition.replanner.step()
    (call_off,) = await composition.sent()
    await composition.receive(drone.ack(call_off))

    assert call_off.kind == "CANCEL"
    report = (await composition.reports())[-1]
    assert (report.kind, report.mission_state) == ("ENDED", "CANCELLED")
    assert await composition.broken() == []
