"""A viewer of the live picture sees all of it while the services behind it are killed."""

import itertools
from typing import Any

import pytest

from tests.end_to_end.eventually import eventually
from tests.end_to_end.live_viewer import LiveViewer, live_events

pytestmark = [pytest.mark.end_to_end, pytest.mark.long, pytest.mark.storage_pair("embedded")]

SERVICES = ("skyway_composition", "skyway_provider_registry", "skyway_gateway")


def test_a_viewer_misses_nothing_while_each_service_is_killed(system: Any) -> None:
    system.publish_corridor("seen")
    system.start_fleet(["seen-s1"] * len(SERVICES))
    requested: list[str] = []
    with LiveViewer(system) as viewer:
        eventually(lambda: viewer.newest, "a snapshot")
        for package in SERVICES:
            requested.append(system.request_delivery(["seen-s2"], pickup="seen-s1"))
            system.kill(package)
            viewer.come_back()
        for delivery_id in requested:
            assert system.until_ended(delivery_id)["state"] == "COMPLETED"
        eventually(lambda: set(requested).isdisjoint(deliveries(viewer)), "ended deliveries leave")
        document, fresh = seen_by_both(system, viewer)

    assert document == fresh
    assert_whole(viewer)


def deliveries(viewer: LiveViewer) -> dict[str, Any]:
    """The deliveries in the viewer's document."""
    shown_now: dict[str, Any] = (
        viewer.newest.document.get("deliveries", {}) if viewer.newest else {}
    )
    return shown_now


def seen_by_both(system: Any, viewer: LiveViewer) -> tuple[Any, Any]:
    """The viewer's document, and a snapshot of the same number for somebody who comes now."""
    event_id, name, fresh = next(live_events(system))
    assert name == "snapshot"
    epoch, _, number = event_id.partition("-")
    return shown(viewer.document_at(epoch, int(number))), shown(fresh)


def shown(document: Any) -> dict[str, Any]:
    """The kinds that have items."""
    return {kind: items for kind, items in document.items() if items}


def assert_whole(viewer: LiveViewer) -> None:
    """Streams go on where the one before ended, or begin with a snapshot; numbers only rise."""
    for stream in viewer.streams:
        assert len({event.epoch for event in stream}) == 1
        assert all(one.number < other.number for one, other in itertools.pairwise(stream))
        assert "snapshot" not in {event.name for event in stream[1:]}
    resumed = 0
    for before, after in itertools.pairwise(viewer.streams):
        if after[0].name == "change":
            assert after[0].epoch == before[-1].epoch
            assert after[0].number > before[-1].number
            resumed += 1
        else:
            assert after[0].epoch != before[-1].epoch, "a snapshot though the gateway was up"
    assert resumed
    assert len({stream[0].epoch for stream in viewer.streams}) == 2, "the gateway was killed once"
