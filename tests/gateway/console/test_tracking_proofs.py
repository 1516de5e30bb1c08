"""How a recipient proves a hand-over on the tracking page: by a PIN, a signature, or not at all."""

from typing import Any

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage
from tests.gateway.console.test_tracking_script import PAGE, after, state

pytestmark = [pytest.mark.integration, needs_browser, pytest.mark.long]


def asking(*, is_there: bool = True, **proof: Any) -> dict[str, Any]:
    """A delivery whose package needs this proof."""
    shown = state()
    known = {"pin": None, "wrong_pins": 0, "given_at": None, "picture": None}
    shown["packages"][0] |= {
        "dropoff_proof": known | proof,
        "proof_until_at": after(120) if is_there else None,
    }
    return shown


def opened(stage: StagedPage, shown: dict[str, Any]) -> StagedPage:
    stage.page.set_viewport_size({"width": 390, "height": 844})
    stage.answers[f"{PAGE}/state"] = shown
    return stage.open(PAGE)


def posted(stage: StagedPage) -> Any:
    """The proof that the page sends when the button is pressed."""
    stage.answers[f"{PAGE}/proof"] = {}
    with stage.page.expect_request(f"**{PAGE}/proof") as asked:
        stage.page.get_by_role("button", name="Confirm the hand-over").click()
    return asked.value.post_data_json


def test_the_pin_is_shown_before_the_drone_comes(stage: StagedPage) -> None:
    page = opened(stage, asking(is_there=False, method="PIN", pin="471100")).page

    expect(page.locator("#proofs .pin")).to_have_text("471100")
    expect(page.locator("#proofs input")).to_have_count(0)


def test_the_recipient_types_the_pin_when_the_drone_is_there(stage: StagedPage) -> None:
    page = opened(stage, asking(method="PIN", pin="471100", wrong_pins=2)).page

    expect(page.locator("#headline")).to_have_text("The drone is here")
    expect(page.locator("#detail")).to_have_text("It waits at B until 12:02.")
    expect(page.get_by_role("alert").first).to_have_text("Wrong PIN. 3 tries are left.")
    assert serious_problems(page) == []
    page.get_by_label("Type the PIN").fill("471100")
    assert posted(stage) == {"package_id": "p1", "pin": "471100"}


def test_the_recipient_signs_with_a_finger(stage: StagedPage) -> None:
    page = opened(stage, asking(method="SIGNATURE")).page
    box = page.locator("canvas").bounding_box()
    assert box is not None
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 390

    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] * 2, box["y"] + box["height"] / 2, steps=5)
    page.mouse.up()

    assert serious_problems(page) == []
    [stroke] = posted(stage)["signature"]["strokes"]
    assert stroke[0] == pytest.approx([500, 200], abs=2)
    assert stroke[-1] == pytest.approx([1000, 200], abs=2)  # the line ends at the edge of the field


def test_the_recipient_signs_with_the_keyboard(stage: StagedPage) -> None:
    page = opened(stage, asking(method="SIGNATURE")).page

    page.get_by_label("Or type your name").fill("Ada Lovelace")

    assert posted(stage) == {"package_id": "p1", "signature": {"name": "Ada Lovelace"}}


def test_what_is_being_typed_stays_while_the_page_goes_on(stage: StagedPage) -> None:
    stage.install_clock()
    page = opened(stage, asking(method="PIN", pin="471100")).page
    page.get_by_label("Type the PIN").fill("47")

    page.clock.run_for(61_000)

    expect(page.get_by_label("Type the PIN")).to_have_value("47")


def test_every_control_is_large_enough_for_a_finger(stage: StagedPage) -> None:
    page = opened(stage, asking(method="SIGNATURE")).page

    for control in page.locator("#proofs input, #proofs button").all():
        box = control.bounding_box()
        assert box is not None
        assert box["height"] >= 44


@pytest.mark.parametrize(
    ("proof", "text"),
    [
        ({"method": "PIN", "wrong_pins": 5}, "Ask the sender to confirm the hand-over."),
        ({"method": "PHOTO"}, "The drone takes a photo"),
        ({"method": "PIN", "given_at": after(0)}, "The hand-over is confirmed."),
    ],
)
def test_where_nothing_can_be_typed_there_is_no_field(
    stage: StagedPage, proof: dict[str, Any], text: str
) -> None:
    page = opened(stage, asking(**proof)).page

    expect(page.locator("#proofs")).to_contain_text(text)
    expect(page.locator("#proofs button")).to_have_count(0)


def test_the_picture_of_the_proof_is_shown(stage: StagedPage) -> None:
    given: dict[str, Any] = {
        "method": "SIGNATURE",
        "given_at": after(0),
        "picture": "image/svg+xml",
    }

    page = opened(stage, asking(**given)).page

    expect(page.get_by_alt_text("Signature")).to_have_attribute(
        "src", f"{PAGE}/packages/p1/picture"
    )
