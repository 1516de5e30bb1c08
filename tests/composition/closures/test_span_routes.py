"""GET /v1/closures lists what was closed in a past span, of every kind."""

from datetime import timedelta
from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)

OPERATOR = "operator:op"


async def make(composition: Any, path: str, **body: Any) -> str:
    answer = await composition(OPERATOR, "POST", path, {"reason": "fog", **body})
    assert answer.status_code == 201, answer.text
    return str(answer.json()["closure_id"])


async def listed(composition: Any, query: str = "") -> list[str]:
    answer = await composition("customer:c", "GET", f"/v1/closures{query}")
    assert answer.status_code == 200, answer.text
    return [each["closure_id"] for each in answer.json()["items"]]


def moment(composition: Any, *, hours: float) -> str:
    at = composition.clock.now() + timedelta(hours=hours)
    return str(at.isoformat().replace("+00:00", "Z"))


async def test_closures_of_every_kind_are_listed_while_they_last(composition: Any) -> None:
    station = await make(composition, "/v1/stations/b/closures", until=moment(composition, hours=1))
    stop = await make(composition, "/v1/ground-stops")
    lifted = await make(composition, "/v1/segments/a/b/closures")
    await composition(OPERATOR, "DELETE", f"/v1/segments/a/b/closures/{lifted}")
    composition.clock.advance(timedelta(hours=3))

    assert await listed(composition) == [stop]
    earlier = f"?from={moment(composition, hours=-2.5)}"
    assert sorted(await listed(composition, earlier)) == sorted([station, stop])
    assert await listed(composition, f"?to={moment(composition, hours=-4)}") == []


async def test_a_closure_is_listed_until_it_was_lifted(composition: Any) -> None:
    closure_id = await make(composition, "/v1/ground-stops")
    composition.clock.advance(timedelta(hours=1))
    await composition(OPERATOR, "DELETE", f"/v1/ground-stops/{closure_id}")
    composition.clock.advance(timedelta(hours=1))

    assert await listed(composition, f"?from={moment(composition, hours=-1.5)}") == [closure_id]
    assert await listed(composition, f"?from={moment(composition, hours=-0.5)}") == []


async def test_closures_come_in_pages(composition: Any) -> None:
    made = [await make(composition, "/v1/ground-stops") for _ in range(3)]
    composition.clock.advance(timedelta(minutes=1))

    first = (await composition(OPERATOR, "GET", "/v1/closures?limit=2")).json()

    assert len(first["items"]) == 2
    rest = await listed(composition, f"?limit=2&cursor={first['next_cursor']}")
    assert sorted([*(each["closure_id"] for each in first["items"]), *rest]) == sorted(made)


async def test_a_span_is_at_most_a_day(composition: Any) -> None:
    query = f"?from={moment(composition, hours=-25)}"

    assert (await composition(OPERATOR, "GET", f"/v1/closures{query}")).status_code == 422
