"""Alarms over REST: operators acknowledge them, a provider sees only its own."""

from typing import Any

from skyway_composition import alarm_store

from skyway.units import moment_to_ms


async def raise_alarm(composition: Any, **members: Any) -> str:
    values = {
        "level": "WARNING",
        "code": "WIND",
        "detail": "the wind is strong",
        "at_ms": moment_to_ms(composition.clock.now()),
        "provider_id": "prv_1",
        "mint": composition.parts.mint,
        **members,
    }
    async with composition.db.write() as tx:
        return str(await alarm_store.add(tx, **values))


def ids(answer: Any) -> list[str]:
    return [item["alarm_id"] for item in answer.json()["items"]]


async def test_an_alarm_shows_what_happened_and_what_it_concerns(composition: Any) -> None:
    alarm_id = await raise_alarm(
        composition, level="CRITICAL", drone_id="drn_1", station_id="b", data={"need_j": 7.5}
    )

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]

    assert alarm["alarm_id"] == alarm_id
    assert (alarm["level"], alarm["code"], alarm["state"]) == ("CRITICAL", "WIND", "OPEN")
    assert (alarm["drone_id"], alarm["station_id"], alarm["mission_id"]) == ("drn_1", "b", None)
    assert alarm["data"] == {"need_j": 7.5}
    assert alarm["at"] == "2026-03-01T12:00:00Z"


async def test_operators_see_all_alarms_newest_first_and_can_filter_them(
    composition: Any,
) -> None:
    first = await raise_alarm(composition)
    second = await raise_alarm(composition, level="URGENT", provider_id="prv_2")
    third = await raise_alarm(composition, provider_id=None)

    everything = await composition("operator:op", "GET", "/v1/alarms")
    urgent = await composition("operator:op", "GET", "/v1/alarms?level=URGENT")
    of_one = await composition("operator:op", "GET", "/v1/alarms?provider_id=prv_1")

    assert ids(everything) == [third, second, first]
    assert (ids(urgent), ids(of_one)) == ([second], [first])


async def test_the_alarms_of_a_span_are_listed_in_pages_newest_first(composition: Any) -> None:
    start_ms = moment_to_ms(composition.clock.now())
    minutes = [
        await raise_alarm(composition, at_ms=start_ms + minute * 60_000) for minute in range(5)
    ]
    span = "from=2026-03-01T12:01:00Z&to=2026-03-01T12:04:00Z"

    first = await composition("operator:op", "GET", f"/v1/alarms?limit=2&{span}")
    cursor = first.json()["next_cursor"]
    second = await composition("operator:op", "GET", f"/v1/alarms?limit=2&{span}&cursor={cursor}")

    assert (ids(first), ids(second)) == ([minutes[3], minutes[2]], [minutes[1]])
    assert second.json()["next_cursor"] is None


async def test_a_span_of_alarms_may_be_open_on_either_side(composition: Any) -> None:
    start_ms = moment_to_ms(composition.clock.now())
    early = await raise_alarm(composition, at_ms=start_ms)
    late = await raise_alarm(composition, at_ms=start_ms + 60_000)

    later = await composition("operator:op", "GET", "/v1/alarms?from=2026-03-01T12:00:30Z")
    earlier = await composition("operator:op", "GET", "/v1/alarms?to=2026-03-01T12:00:30Z")

    assert (ids(later), ids(earlier)) == ([late], [early])


async def test_a_span_of_alarms_that_ends_before_it_begins_is_refused(composition: Any) -> None:
    span = "from=2026-03-01T12:00:00Z&to=2026-03-01T12:00:00Z"

    answer = await composition("operator:op", "GET", f"/v1/alarms?{span}")

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "from"


async def test_a_provider_sees_only_its_own_alarms(composition: Any) -> None:
    own = await raise_alarm(composition)
    await raise_alarm(composition, provider_id="prv_2")
    await raise_alarm(composition, provider_id=None)

    listed = await composition("provider:prv_1", "GET", "/v1/alarms")
    foreign = await composition("provider:prv_1", "GET", "/v1/alarms?provider_id=prv_2")

    assert ids(listed) == [own]
    assert foreign.status_code == 404


async def test_customers_may_not_list_alarms(composition: Any) -> None:
    answer = await composition("customer:c", "GET", "/v1/alarms")

    assert answer.status_code == 403


async def test_alarms_are_listed_in_pages(composition: Any) -> None:
    first, second = await raise_alarm(composition), await raise_alarm(composition)

    page = await composition("operator:op", "GET", "/v1/alarms?limit=1")
    rest = await composition(
        "operator:op", "GET", f"/v1/alarms?limit=1&cursor={page.json()['next_cursor']}"
    )

    assert (ids(page), ids(rest)) == ([second], [first])
    assert rest.json()["next_cursor"] is None


async def test_an_acknowledged_alarm_is_no_longer_open(composition: Any) -> None:
    open_one, seen = await raise_alarm(composition), await raise_alarm(composition)

    answer = await composition(
        "operator:op", "POST", f"/v1/alarms/{seen}/acknowledgements", {"note": "looked"}
    )

    assert answer.status_code == 200
    assert (answer.json()["state"], answer.json()["note"]) == ("ACKNOWLEDGED", "looked")
    still_open = await composition("operator:op", "GET", "/v1/alarms?state=OPEN")
    done = await composition("operator:op", "GET", "/v1/alarms?state=ACKNOWLEDGED")
    assert (ids(still_open), ids(done)) == ([open_one], [seen])


async def test_the_first_of_two_acknowledgements_is_kept(composition: Any) -> None:
    alarm_id = await raise_alarm(composition)
    path = f"/v1/alarms/{alarm_id}/acknowledgements"

    await composition("operator:first", "POST", path, {"note": "mine"})
    second = await composition("operator:second", "POST", path, {"note": "no, mine"})

    assert second.status_code == 200
    assert (second.json()["acknowledged_by"], second.json()["note"]) == ("operator:first", "mine")


async def test_only_operators_acknowledge(composition: Any) -> None:
    alarm_id = await raise_alarm(composition)

    answer = await composition(
        "provider:prv_1", "POST", f"/v1/alarms/{alarm_id}/acknowledgements", {}
    )

    assert answer.status_code == 403
    assert ids(await composition("operator:op", "GET", "/v1/alarms?state=OPEN")) == [alarm_id]


async def test_an_unknown_alarm_cannot_be_acknowledged(composition: Any) -> None:
    answer = await composition("operator:op", "POST", "/v1/alarms/alm_0/acknowledgements", {})

    assert answer.status_code == 404


async def test_the_registry_raises_an_alarm_about_a_drone_once(composition: Any) -> None:
    body = {
        "provider_id": "prv_1",
        "drone_id": "drn_1",
        "level": "URGENT",
        "code": "DRONE_JUMPED",
        "detail": "it was elsewhere",
        "at": "2026-03-01T12:00:00Z",
        "data": {"soc": 0.5},
    }
    for _ in range(2):
        registry = {"Authorization": "Bearer secret of registry"}
        answer = await composition(None, "POST", "/internal/drone-alarms", body, **registry)
        assert answer.status_code == 204
    foreign = await composition("provider:prv_1", "POST", "/internal/drone-alarms", body)

    (alarm,) = (await composition("provider:prv_1", "GET", "/v1/alarms")).json()["items"]
    assert (alarm["code"], alarm["drone_id"], alarm["data"]) == (
        "DRONE_JUMPED",
        "drn_1",
        {"soc": 0.5},
    )
    assert foreign.status_code == 403
