"""Composition asks which providers exchange deliveries, and at which tariffs."""

from typing import Any, Final

from skyway.contracts.drones import EXCHANGING

_TARIFF: Final = {"base": 300, "per_km": 20}


async def exchanging(api: Any) -> dict[str, int]:
    """The base price of each provider that exchanges deliveries."""
    answer = await api(None, "GET", EXCHANGING, service="composition")
    assert answer.status_code == 200, answer.text
    return {name: each["base"] for name, each in answer.json()["tariffs"].items()}


async def test_a_provider_exchanges_deliveries_while_it_says_so_and_is_active(api: Any) -> None:
    first = await api.provider(tariff=_TARIFF, exchanges_deliveries=True)
    second = await api.provider(name="Other")
    assert await exchanging(api) == {first: 300}

    await api(
        f"provider:{second}", "PATCH", f"/v1/providers/{second}", {"exchanges_deliveries": True}
    )
    await api(f"provider:{first}", "PATCH", f"/v1/providers/{first}", {"tariff": {"base": 400}})
    assert (await exchanging(api))[first] == 400
    assert second in await exchanging(api)

    await api("operator:op", "PATCH", f"/v1/providers/{first}", {"state": "SUSPENDED"})
    await api(
        f"provider:{second}", "PATCH", f"/v1/providers/{second}", {"exchanges_deliveries": False}
    )
    assert await exchanging(api) == {}


async def test_a_provider_cannot_set_the_rule_of_another_one(api: Any) -> None:
    first, second = await api.provider(), await api.provider(name="Other")
    path, rule = f"/v1/providers/{second}", {"exchanges_deliveries": True}

    answer = await api(f"provider:{first}", "PATCH", path, rule)

    assert answer.status_code == 404
    assert await exchanging(api) == {}


async def test_customers_see_no_rule_of_a_provider(api: Any) -> None:
    provider = await api.provider(exchanges_deliveries=True)

    card = await api("customer:shop", "GET", f"/v1/providers/{provider}")

    assert "exchanges_deliveries" not in card.json()
