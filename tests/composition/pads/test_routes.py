"""Pads over REST."""

from datetime import timedelta
from typing import Any

import pytest

from tests.composition.conftest import make_network

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def test_a_pad_is_taken_while_it_is_reserved(composition: Any) -> None:
    await composition.book()
    (first, *_) = [row for row in await composition.reservations() if row.station_id == "b"]
    before = await composition("customer:c", "GET", "/v1/stations/b/pads")
    start = timedelta(milliseconds=first.start_ms - 1772366400000)
    composition.clock.advance(start)

    during = await composition("operator:op", "GET", "/v1/stations/b/pads")

    assert before.json()["pads_taken"] == 0
    assert (during.json()["pads"], during.json()["pads_taken"]) == (2, 1)
    assert during.json()["items"][first.pad]["mission_id"] == first.mission_id


async def test_reservations_are_listed_and_only_operators_see_their_missions(
    composition: Any,
) -> None:
    booking = await composition.book()

    customer = await composition("customer:c", "GET", "/v1/stations/b/reservations?limit=1")
    rest = await composition(
        "operator:op",
        "GET",
        f"/v1/stations/b/reservations?cursor={customer.json()['next_cursor']}",
    )

    assert customer.json()["items"][0]["mission_id"] is None
    assert rest.json()["items"][0]["mission_id"] == booking.missions[0].mission_id


async def test_an_unknown_station_is_not_found(composition: Any) -> None:
    for below in ("pads", "reservations"):
        answer = await composition("operator:op", "GET", f"/v1/stations/none/{below}")
        assert answer.status_code == 404


async def test_a_pad_that_is_out_of_order_is_taken(composition: Any) -> None:
    until = composition.clock.now() + timedelta(hours=1)
    for pad, body in enumerate(({"until": until.isoformat()}, {"reason": "broken"})):
        await composition("operator:op", "POST", f"/v1/stations/b/pads/{pad}/outages", body)

    during = (await composition("customer:c", "GET", "/v1/stations/b/pads")).json()
    composition.clock.advance(timedelta(hours=1))
    after = (await composition("customer:c", "GET", "/v1/stations/b/pads")).json()

    assert (during["pads_taken"], after["pads_taken"]) == (2, 1)
    assert [each["is_out_of_order"] for each in during["items"]] == [True, True]
    assert during["items"][0]["works_again_at"] is not None
    assert during["items"][1]["works_again_at"] is None
    assert [each["is_out_of_order"] for each in after["items"]] == [False, True]


async def test_a_pad_that_a_newer_network_no_longer_has_is_not_counted(composition: Any) -> None:
    await composition("operator:op", "POST", "/v1/stations/b/pads/1/outages", {})
    await composition.publish(make_network(pads={"b": 1}))

    pads = (await composition("customer:c", "GET", "/v1/stations/b/pads")).json()

    assert (pads["pads"], pads["pads_taken"]) == (1, 0)
