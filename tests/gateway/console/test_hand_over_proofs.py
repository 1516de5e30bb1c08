"""The console's proofs of hand-overs: a customer sees them, and confirms."""

from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage, delivery
from tests.gateway.console.test_customer_desk import SESSION

pytestmark = [pytest.mark.integration, needs_browser]

PATH = "/v1/deliveries/dlv_1"
EVENTS = f"{PATH}/events"
AWAITED = {"since_at": "2026-03-01T11:59:00Z", "until_at": "2026-03-01T12:04:00Z"}
PIN = {"method": "PIN", "pin": "471100", "wrong_pins": 1, "given_at": None, "given_by": None}
SIGNED = {
    "method": "SIGNATURE",
    "given_at": "2026-03-01T11:50:00Z",
    "given_by": "RECIPIENT",
    "picture": "image/svg+xml",
}


def package(package_id: str, *, state: str, proof: Any, **members: Any) -> dict[str, Any]:
    return {
        "package_id": package_id,
        "state": state,
        "destination": {"station_id": "b"},
        "dropoff_proof": proof,
    } | members


def open_delivery(stage: StagedPage, *packages: Any) -> Page:
    stage.answers |= {"/v1/sessions/current": SESSION, PATH: delivery("dlv_1", packages=packages)}
    return stage.open("/console#/deliveries/dlv_1").page


def test_a_customer_sees_the_pin_and_confirms_while_the_drone_waits(stage: StagedPage) -> None:
    page = open_delivery(stage, package("p1", state="IN_TRANSIT", proof=PIN))
    card = page.get_by_role("article", name="Hand-over of p1")
    expect(card).to_contain_text("471100")
    expect(card).to_contain_text("asked for when the drone is there")
    expect(card.get_by_role("button")).to_have_count(0)

    waiting = package("p1", state="IN_TRANSIT", proof=PIN, proof_wait=AWAITED)
    stage.answers[PATH] = delivery("dlv_1", packages=[waiting])
    event = {"event_id": "e1", "type": "delivery.proof_awaited", "data": {}}
    sent = event | {"occurred_at": "2026-03-01T11:59:00Z"}
    stage.send(EVENTS, "delivery.proof_awaited", sent)

    expect(card).to_contain_text("the drone waits for it until 12:04")
    assert serious_problems(page) == []
    stage.answers[f"{PATH}/packages/p1/proof"] = {}
    given = PIN | {"pin": None, "given_at": "2026-03-01T12:00:00Z", "given_by": "CUSTOMER"}
    stage.answers[PATH] = delivery(
        "dlv_1", packages=[package("p1", state="IN_TRANSIT", proof=given, proof_wait=AWAITED)]
    )
    card.get_by_role("button", name="My customer has it").click()
    card.get_by_role("button", name="Yes").click()
    expect(card).to_contain_text("given 12:00, by the customer")
    assert f"POST {PATH}/packages/p1/proof?" in stage.asked
    expect(card.get_by_role("button")).to_have_count(0)


def test_a_wait_that_has_ended_offers_no_confirmation(stage: StagedPage) -> None:
    ended = AWAITED | {"until_at": "2026-03-01T11:59:30Z"}

    page = open_delivery(stage, package("p1", state="IN_TRANSIT", proof=PIN, proof_wait=ended))

    card = page.get_by_role("article", name="Hand-over of p1")
    expect(card).to_contain_text("not given")
    expect(card.get_by_role("button")).to_have_count(0)


@pytest.mark.long
def test_a_signature_is_shown_to_the_customer(stage: StagedPage) -> None:
    page = open_delivery(stage, package("p1", state="DELIVERED", proof=SIGNED))

    picture = page.get_by_role("img", name="Picture of the hand-over of p1")
    expect(picture).to_have_attribute("src", f"{PATH}/packages/p1/proof/picture")
    expect(page.get_by_role("article")).to_contain_text("given 11:50, by the recipient")
