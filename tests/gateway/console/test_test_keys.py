"""A customer's keys in the console: which are test keys, and how a new one is made."""

from typing import Any

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser, serious_problems
from tests.gateway.console.staged_page import StagedPage
from tests.gateway.console.test_customer_desk import SESSION

pytestmark = [pytest.mark.integration, needs_browser]


def key(name: str, *, livemode: bool) -> dict[str, Any]:
    return {
        "key_id": f"key_{name}",
        "role": "customer",
        "subject_id": "alice" if livemode else "test_alice",
        "name": name,
        "livemode": livemode,
        "scopes": None,
        "created_wall_at": "2026-03-01T11:00:00Z",
        "expires_wall_at": None,
    }


def test_a_customer_makes_a_test_key_and_deletes_only_test_keys(stage: StagedPage) -> None:
    keys = [key("shop", livemode=True), key("ci", livemode=False)]
    stage.answers |= {
        "/v1/sessions/current": SESSION,
        "/v1/keys": {"items": keys, "next_cursor": None, "key": "sk_test_1"},
        "/v1/webhooks": {"items": [], "next_cursor": None},
    }
    page = stage.open("/console#/account").page
    listed = page.get_by_role("table", name="Keys")
    live, test = (listed.get_by_role("row").filter(has_text=name) for name in ("shop", "ci"))

    expect(live.get_by_role("cell", name="Live")).to_be_visible()
    expect(live.get_by_role("button")).to_have_count(0)
    expect(test.get_by_role("cell", name="Test", exact=True)).to_be_visible()
    expect(test.get_by_role("button", name="Delete key ci")).to_be_visible()
    assert serious_problems(page) == []

    form = page.get_by_role("form", name="New test key")
    form.get_by_label("Name").fill("laptop")
    with page.expect_request(lambda each: each.method == "POST") as asked:
        form.get_by_role("button", name="Make the test key").click()
    assert asked.value.post_data_json == {"livemode": False, "name": "laptop"}
    expect(page.get_by_label("Key", exact=True)).to_have_value("sk_test_1")
