"""The gateway reads the drones for its live picture: all of them, then those that have changed."""

from datetime import timedelta
from typing import Any

LIVE = "/internal/live/drones"


async def live(api: Any, since: str | None = None) -> Any:
    path = LIVE if since is None else f"{LIVE}?since={since}"
    answer = await api(None, "GET", path, service="gateway")
    assert answer.status_code == 200, answer.text
    return answer.json()


def ids(answer: Any) -> list[str]:
    return [each["drone_id"] for each in answer["drones"]]


async def test_the_first_answer_has_every_drone(api: Any) -> None:
    provider = await api.provider()
    drones = sorted([(await api.drone(provider))["drone_id"] for _ in range(3)])

    whole = await live(api)

    assert (whole["is_whole"], ids(whole)) == (True, drones)
    first = whole["drones"][0]
    assert (first["provider_id"], first["state"]) == (provider, "REGISTERED")
    assert first["position"] == [-97.94139, 29.88327]


async def test_only_drones_that_have_changed_come_again(api: Any, clock: Any) -> None:
    provider = await api.provider()
    changed, _ = [(await api.drone(provider))["drone_id"] for _ in range(2)]
    clock.advance(timedelta(minutes=10))
    mark = (await live(api))["mark"]
    assert ids(await live(api, mark)) == []

    await api(
        f"provider:{provider}",
        "PATCH",
        f"/v1/providers/{provider}/drones/{changed}",
        {"state": "MAINTENANCE"},
    )
    answer = await live(api, mark)

    assert (answer["is_whole"], ids(answer)) == (False, [changed])
    assert answer["drones"][0]["state"] == "MAINTENANCE"
    assert ids(await live(api, answer["mark"])) == []


async def test_a_removed_drone_makes_the_next_answer_whole(api: Any) -> None:
    provider = await api.provider()
    kept, removed = [(await api.drone(provider))["drone_id"] for _ in range(2)]
    mark = (await live(api))["mark"]

    await api(f"provider:{provider}", "DELETE", f"/v1/providers/{provider}/drones/{removed}")
    answer = await live(api, mark)

    assert (answer["is_whole"], ids(answer)) == (True, [kept])


async def test_a_mark_of_another_database_makes_the_next_answer_whole(api: Any) -> None:
    provider = await api.provider()
    drone = (await api.drone(provider))["drone_id"]

    answer = await live(api, "999999.0.1")

    assert (answer["is_whole"], ids(answer)) == (True, [drone])


async def test_a_wrong_mark_is_refused(api: Any) -> None:
    for mark in ("x", "1.2", "1.2.3.4", "1.2.x"):
        answer = await api(None, "GET", f"{LIVE}?since={mark}", service="gateway")
        assert answer.status_code == 422, mark


async def test_only_the_gateway_may_ask(api: Any) -> None:
    answer = await api(None, "GET", LIVE, service="composition")

    assert answer.status_code == 403
