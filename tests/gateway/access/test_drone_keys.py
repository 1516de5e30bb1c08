"""A drone's key: what it opens, and that it opens nothing once the registry has dropped it."""

import pytest

from tests.gateway.whole_gateway import Gateway

#: All that a drone may call; whose what is, the services decide.
ALLOWED = {
    ("GET", "/v1/clock"),
    ("GET", "/v1/missions"),
    ("GET", "/v1/missions/{mission_id}"),
    ("GET", "/v1/networks/{network_id}/stations"),
    ("GET", "/v1/providers/{provider_id}/drones/{drone_id}"),
    ("GET", "/v1/providers/{provider_id}/drones/{drone_id}/telemetry"),
    ("GET", "/v1/stations/{station_id}/pads"),
    ("POST", "/v1/enrolments"),
    ("POST", "/v1/enrolments/rotations"),
}


async def test_a_revoked_key_stops_with_the_next_call(gateway: Gateway) -> None:
    before = await gateway.http.get("/v1/clock", headers=gateway.drone)

    gateway.registry.drone_keys.clear()

    after = await gateway.http.get("/v1/clock", headers=gateway.drone)
    assert (before.status_code, after.status_code) == (200, 401)


async def test_a_drone_key_works_again_after_the_registry_was_away(gateway: Gateway) -> None:
    gateway.registry.is_away = True

    answer = await gateway.http.get("/v1/clock", headers=gateway.drone)

    assert answer.status_code == 503


@pytest.mark.parametrize("key", ["dk_", "dk_unknown", "sk_drone", "drn_1"])
async def test_an_invented_drone_key_is_refused(gateway: Gateway, key: str) -> None:
    answer = await gateway.http.get("/v1/clock", headers={"Authorization": f"Bearer {key}"})

    assert answer.status_code == 401


async def test_a_drone_may_make_only_the_listed_calls(
    gateway: Gateway, subtests: pytest.Subtests
) -> None:
    ids = dict.fromkeys(("pad",), "0")
    for path, operations in (await gateway.http.get("/openapi.json")).json()["paths"].items():
        for method in (name.upper() for name in operations):
            with subtests.test(f"{method} {path}"):
                url = "/".join(
                    ids.get(level[1:-1], "x_1") if level.startswith("{") else level
                    for level in path.split("/")
                )

                answer = await gateway.http.request(method, url, json={}, headers=gateway.drone)

                is_allowed = (method, path) in ALLOWED or not path.startswith("/v1/")
                # Where a body is read before the role, an empty one may be refused first.
                refused = {403, 422} if not is_allowed else {403}
                assert (answer.status_code in refused) is not is_allowed, answer.text
