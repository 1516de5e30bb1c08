"""The console says how old its picture is, and a tab that nobody sees has no stream."""

import pytest
from playwright.sync_api import expect

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.staged_page import LIVE, StagedPage

pytestmark = [pytest.mark.integration, needs_browser]

_DRONE = {"state": "ON_MISSION", "activity": "FLYING", "soc": 0.5, "position": [0, 0]}
_OPEN_STREAMS = "() => streams.filter((each) => each.readyState !== 2).length"


def test_a_silent_service_dims_what_it_feeds_and_says_since_when(stage: StagedPage) -> None:
    page = stage.open("/console#/alarms").page
    silent = {"is_answering": False, "silent_since_at": "2026-03-01T10:50:00Z"}
    stage.send(
        LIVE, "snapshot", {"services": {"registry": silent, "gateway": {"is_answering": True}}}
    )
    expect(page.locator(".connection")).to_have_text("Partly old")
    expect(page.get_by_role("alert")).to_have_text(
        "Registry has not answered since 10:50 UTC: drones and their charge stand still."
    )
    expect(page.locator("main")).to_have_class("stale stale-registry")

    stage.send(
        LIVE, "change", {"services": {"registry": {"is_answering": True, "silent_since_at": None}}}
    )
    expect(page.locator(".connection")).to_have_text("Live")
    expect(page.get_by_role("alert")).to_have_count(0)


def test_a_gateway_without_news_is_not_live(stage: StagedPage) -> None:
    """The stream of a network that is gone looks open for minutes."""
    stage.install_clock()
    page = stage.open("/console#/alarms").page
    stage.send(LIVE, "snapshot", {})
    expect(page.locator(".connection")).to_have_text("Live")

    stage.is_silent = True
    page.clock.run_for(120_000)

    expect(page.locator(".connection")).to_have_text("No connection")
    expect(page.get_by_role("alert")).to_contain_text("You see the picture of 12:00 UTC")
    stage.is_silent = False
    page.clock.run_for(31_000)
    expect(page.locator(".connection")).to_have_text("Live")


def test_a_hidden_tab_closes_its_stream_and_comes_back_with_a_new_picture(
    stage: StagedPage,
) -> None:
    stage.install_clock()
    page = stage.open("/console#/alarms").page
    page.evaluate(
        """async () => {
          const {effect} = await import("@preact/signals");
          const {picture} = await import("/console/live.js");
          window.seen = [];
          const places = () => Object.values(picture.drones.value).map(({position}) => position[0]);
          effect(() => seen.push(places()));
        }"""
    )
    stage.send(LIVE, "snapshot", {"drones": {"drn_1": _DRONE}})
    page.evaluate("setVisibility('hidden')")
    page.clock.run_for(9_000)
    assert page.evaluate(_OPEN_STREAMS) == 1
    page.clock.run_for(2_000)
    assert page.evaluate(_OPEN_STREAMS) == 0

    page.evaluate("setVisibility('visible')")
    page.wait_for_function("() => streams.length === 2")
    moved = _DRONE | {"position": [1, 0]}
    stage.send(LIVE, "snapshot", {"drones": {"drn_1": moved}})
    page.wait_for_function("() => seen.at(-1)[0] === 1")
    # Between both places the drone was gone, so it cannot glide from one to the other.
    assert page.evaluate("seen.slice(-3)") == [[0], [], [1]]


def test_a_tab_of_another_session_reads_everything_anew(stage: StagedPage) -> None:
    """Another tab of the browser has logged in as somebody else."""
    stage.install_clock()
    page = stage.open("/console#/deliveries").page
    stage.send(LIVE, "snapshot", {})
    expect(page.get_by_role("link", name="Health")).to_be_visible()
    stage.answers["/v1/sessions/current"] = {"subject_id": "shop", "role": "customer"}

    stage.sleep(60)

    expect(page.get_by_role("link", name="Health")).to_have_count(0)
    expect(page.get_by_role("link", name="New delivery")).to_be_visible()
