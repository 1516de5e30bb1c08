"""Branding: tracking pages show the name and the colour of the customer's shop."""

from typing import Any

import pytest
from skyway_gateway.tracking.branding import Branding, ShownBranding

from tests.gateway.tracking.test_tracking import requested
from tests.gateway.whole_gateway import Gateway

SHOP = {"name": "Hill Country Books", "colour": "#0b6bcb"}
OWNED = "whose deliveries, webhooks, branding and calls are stored has a key, or had one"
FORM = "every stored text has its form"


async def put(gateway: Gateway, body: dict[str, Any]) -> Any:
    return await gateway.http.put("/v1/branding", json=body, headers=gateway.customer)


async def shop(gateway: Gateway, path: str) -> Any:
    return (await gateway.http.get(f"{path}/state")).json()["shop"]


async def test_a_page_shows_the_branding_of_its_customer(gateway_on_both: Gateway) -> None:
    gateway = gateway_on_both
    _, path = await requested(gateway)
    assert await shop(gateway, path) == {"name": None, "colour": None, "text_colour": None}

    await put(gateway, {"name": "Old name"})
    answer = await put(gateway, SHOP)

    assert answer.json() == SHOP
    stored = await gateway.http.get("/v1/branding", headers=gateway.customer)
    assert stored.json() == SHOP
    assert await shop(gateway, path) == {**SHOP, "text_colour": "#ffffff"}
    assert await gateway.verified() == []


async def test_an_empty_branding_shows_no_shop(gateway: Gateway) -> None:
    _, path = await requested(gateway)
    await put(gateway, SHOP)

    await put(gateway, {})

    assert await shop(gateway, path) == {"name": None, "colour": None, "text_colour": None}


async def test_a_customer_changes_no_branding_of_another(gateway: Gateway) -> None:
    _, path = await requested(gateway)
    body = {"role": "customer", "subject_id": "mallory"}
    made = await gateway.http.post("/v1/keys", json=body, headers=gateway.operator)
    mallory = {"Authorization": f"Bearer {made.json()['key']}"}

    await gateway.http.put("/v1/branding", json=SHOP, headers=mallory)

    assert (await shop(gateway, path))["name"] is None
    for headers in (gateway.provider, gateway.operator):
        assert (await gateway.http.get("/v1/branding", headers=headers)).status_code == 403


@pytest.mark.parametrize(
    "body",
    [
        {"name": ""},
        {"name": "   "},
        {"name": "x" * 61},
        {"name": "two\nlines"},
        {"name": "turned \u202e round"},
        {"colour": "red"},
        {"colour": "#0b6bcb;position:fixed"},
        {"colour": "#fff"},
        {"logo": "https://elsewhere.example/logo.png"},
    ],
)
async def test_a_branding_that_a_page_cannot_show_is_refused(
    gateway: Gateway, body: dict[str, Any]
) -> None:
    answer = await put(gateway, body)

    assert answer.status_code == 422
    assert next(iter(body)) in answer.text


@pytest.mark.parametrize(
    ("colour", "text"),
    [
        ("#000000", "#ffffff"),
        ("#FFFFFF", "#000000"),
        ("#777777", "#000000"),
        ("#757575", "#ffffff"),
    ],
)
def test_the_text_has_the_higher_contrast(colour: str, text: str) -> None:
    assert ShownBranding.of(Branding(colour=colour)).text_colour == text


@pytest.mark.parametrize(
    ("damage", "rule"),
    [
        ("UPDATE brandings SET customer_id = 'nobody'", OWNED),
        ("UPDATE brandings SET name = ''", FORM),
        ("UPDATE brandings SET colour = 'red'", FORM),
    ],
)
async def test_a_branding_that_nobody_can_have_set_is_named(
    gateway: Gateway, damage: str, rule: str
) -> None:
    await put(gateway, SHOP)
    gateway.is_damaged = True

    await gateway.execute(damage)

    assert rule in await gateway.verified()
