"""The services really show what the alert rules and the board ask for."""

from typing import Any

import pytest

from tests.end_to_end.eventually import eventually
from tests.end_to_end.webhook_receiver import webhook_receiver
from tests.metric_names import expressions, faults_of, shown_in

pytestmark = [pytest.mark.end_to_end, pytest.mark.storage_pair("embedded")]

SERVICES = ("gateway", "registry", "composition")

#: A metric that is shown only while somebody looks at the live picture.
WHILE_WATCHED = "skyway_live_age_seconds"
#: Metrics that are shown only after the database refused a plan, or the gateway a request.
SELDOM = {"skyway_booking_conflicts_total", "skyway_requests_shed_total"}


def test_rules_and_panels_ask_for_what_the_services_show(system: Any) -> None:
    system.publish_corridor("watched")
    system.start_fleet(["watched-s1"])
    key = system.keys["SKYWAY_CUSTOMER_KEY"]
    with webhook_receiver() as receiver:
        body = {"url": receiver.url}
        webhook = system.call("POST", "/v1/webhooks", key=key, body=body).json()
        delivery_id = system.request_delivery(["watched-s3"], pickup="watched-s1")
        system.until_state(delivery_id, "COMPLETED")
        receiver.until_received("delivery.completed", delivery_id)
        system.call("DELETE", f"/v1/webhooks/{webhook['webhook_id']}", key=key)

    def missing() -> set[str]:
        shown = shown_in(system.metrics_of(service) for service in SERVICES)
        faults = {fault for each in expressions() for fault in faults_of(each, shown)}
        return faults - SELDOM - {WHILE_WATCHED, "by (by)"}

    # Services keep what they have measured for some seconds.
    eventually(lambda: not missing(), "all that is asked for", instead=missing)


@pytest.mark.long
def test_the_gauges_show_a_fleet_and_its_mission(system: Any) -> None:
    system.publish_corridor("gauged")
    provider = system.start_fleet(["gauged-s1"])
    system.until_available(provider["provider_id"], drones=1)

    shown = system.metrics_of("registry")

    assert 'skyway_part_ready{part="database"} 1.0' in shown
    assert 'skyway_drones{state="AVAILABLE"}' in shown
