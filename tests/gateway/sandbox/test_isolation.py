"""Nothing of the sandbox reaches the services or live lists, and nothing live reaches test keys."""

from typing import Any

import pytest

from tests.gateway.sandbox.played import accepted, played, sandbox_caller, sandbox_request, shown
from tests.gateway.whole_gateway import Gateway, make_request


async def _got(gateway: Gateway, path: str, headers: dict[str, str]) -> Any:
    answer = await gateway.http.get(path, headers=headers)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_test_traffic_reaches_no_other_service(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    gateway.peers.seen.clear()

    quote = await gateway.http.post("/v1/quotes", json=sandbox_request(), headers=headers)
    offer = {
        "quote_id": quote.json()["quote_id"],
        "offer_id": quote.json()["offers"][0]["offer_id"],
    }
    delivery_id = await accepted(gateway, headers, offer)
    found = await played(gateway, headers, delivery_id)
    await _got(gateway, f"/v1/deliveries/{delivery_id}/track", headers)

    assert found["state"] == "COMPLETED"
    assert (gateway.peers.seen, gateway.registry.queries, gateway.registry.lists) == ([], [], [])
    async with gateway.parts.db.read() as connection:
        waiting = await connection.exec_driver_sql("SELECT count(*) FROM outbox")
        assert waiting.scalar_one() == 0


async def test_everything_says_that_it_is_a_test(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    hook = {"url": "http://127.0.0.1:1/hook"}
    webhook = await gateway.http.post("/v1/webhooks", json=hook, headers=headers)
    quote = await gateway.http.post("/v1/quotes", json=sandbox_request(), headers=headers)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    found = await played(gateway, headers, delivery_id)
    [statement] = (await _got(gateway, "/v1/statements", headers))["items"]
    lines = (await _got(gateway, "/v1/statements/lines", headers))["items"]

    events = await gateway.events(delivery_id)
    objects = [webhook.json(), quote.json(), found, statement, *lines, *events]
    assert {each["livemode"] for each in objects} == {False}
    assert statement["amount"] == found["price"]["amount"]


async def test_live_objects_say_that_they_are_live(gateway: Gateway) -> None:
    delivery_id = await gateway.planned()

    events = await gateway.events(delivery_id)
    assert {each["livemode"] for each in [await gateway.get(delivery_id), *events]} == {True}


async def test_operators_and_the_live_account_see_no_test_delivery(
    gateway_on_both: Gateway,
) -> None:
    gateway = gateway_on_both
    headers = await sandbox_caller(gateway)
    delivery_id = await accepted(gateway, headers, sandbox_request())
    await played(gateway, headers, delivery_id)

    for other in (gateway.operator, gateway.customer):
        assert (await _got(gateway, "/v1/deliveries", other))["items"] == []
        answer = await gateway.http.get(f"/v1/deliveries/{delivery_id}", headers=other)
        assert answer.status_code == 404
        assert (await _got(gateway, "/v1/statements", other))["items"] == []
        assert (await _got(gateway, "/v1/statements/lines", other))["items"] == []
    statistics = await _got(gateway, "/v1/stats/deliveries", gateway.operator)
    assert statistics["deliveries"] == 0


async def test_an_operator_who_names_a_test_account_sees_its_statement(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    await played(gateway, headers, await accepted(gateway, headers, sandbox_request()))

    path = "/v1/statements?party_id=test_alice"
    [statement] = (await _got(gateway, path, gateway.operator))["items"]

    assert statement["livemode"] is False


async def test_a_test_key_sees_nothing_of_its_live_account(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    live_id = await gateway.planned()

    assert (await _got(gateway, "/v1/deliveries", headers))["items"] == []
    for method, path in (
        ("GET", f"/v1/deliveries/{live_id}"),
        ("GET", f"/v1/deliveries/{live_id}/track"),
        ("POST", f"/v1/deliveries/{live_id}/cancel"),
    ):
        assert (await gateway.http.request(method, path, headers=headers)).status_code == 404


async def test_stations_of_the_other_mode_are_unknown(gateway: Gateway) -> None:
    test = await sandbox_caller(gateway)

    for headers, body in ((test, make_request()), (gateway.customer, sandbox_request())):
        for path in ("/v1/quotes", "/v1/deliveries"):
            answer = await gateway.http.post(path, json=body, headers=headers)
            assert answer.status_code == 422, answer.text
            assert "pickup.station_id" in answer.text


async def test_a_live_quote_is_not_accepted_with_a_test_key(gateway: Gateway) -> None:
    quote = await gateway.http.post("/v1/quotes", json=make_request(), headers=gateway.customer)
    headers = await sandbox_caller(gateway)

    offer = {"quote_id": quote.json()["quote_id"], "offer_id": "off_1"}
    answer = await gateway.http.post("/v1/deliveries", json=offer, headers=headers)

    assert answer.status_code == 404


async def test_a_test_key_sees_the_sandbox_network_alone(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)

    [network] = (await _got(gateway, "/v1/networks", headers))["items"]
    document = await _got(gateway, f"/v1/networks/{network['network_id']}", headers)
    path = f"/v1/networks/{network['network_id']}/stations"
    stations = (await _got(gateway, path, headers))["items"]
    providers = (await _got(gateway, "/v1/providers", headers))["items"]

    assert document["settings"]["currency"] == "USD"
    assert "harbour" in {each["station_id"] for each in stations}
    assert all(each["provider_id"].startswith("prv_test_") for each in providers)
    other = await gateway.http.get("/v1/networks/texas", headers=headers)
    assert other.status_code == 404


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/v1/live"),
        ("GET", "/v1/networks/test_island/status"),
        ("GET", "/v1/stations/harbour/pads"),
        ("POST", "/v1/compositions"),
        ("GET", "/v1/closures"),
    ],
)
async def test_calls_that_need_a_service_are_refused(
    gateway: Gateway, method: str, path: str
) -> None:
    headers = await sandbox_caller(gateway)

    answer = await gateway.http.request(method, path, headers=headers)

    assert answer.status_code == 403
    assert answer.json()["detail"]


async def test_addresses_are_the_names_of_the_sandbox_stations(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    body = sandbox_request()
    body["packages"][0]["destination"] = {"address": "Slow Street"}

    found = await played(gateway, headers, await accepted(gateway, headers, body))

    assert found["packages"][0]["destination"] == {"station_id": "slow-street"}


async def test_a_test_account_has_few_open_deliveries(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)

    quotas = (await _got(gateway, "/v1/limits", headers))["quotas"]
    most = {each["code"]: each["most"] for each in quotas}

    assert (most["TOO_MANY_DELIVERIES"], most["TOO_MANY_SCHEDULED"]) == (100, 20)


async def test_a_tracking_page_follows_a_test_delivery(gateway: Gateway) -> None:
    headers = await sandbox_caller(gateway)
    answer = await gateway.http.post("/v1/deliveries", json=sandbox_request(), headers=headers)
    await played(gateway, headers, answer.json()["delivery_id"])

    link = answer.json()["tracking_url"]
    page = await gateway.http.get(link)

    assert page.status_code == 200
    assert (await shown(gateway, headers, answer.json()["delivery_id"]))["state"] == "COMPLETED"
