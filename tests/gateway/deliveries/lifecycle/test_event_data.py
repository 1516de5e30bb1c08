"""What delivery events say."""

from datetime import UTC, datetime, timedelta

from skyway_gateway.deliveries.lifecycle.booking_effects import after_booking
from skyway_gateway.deliveries.requests.accept import new_delivery

from skyway.delivery.plan import PickUp
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, PackageId, StationId, SubjectId
from tests.gateway.fake_composition import make_mission
from tests.gateway.whole_gateway import make_request

START = datetime(2026, 3, 1, 12, tzinfo=UTC)


def test_the_pickup_is_when_the_drone_begins_to_load() -> None:
    request = DeliveryRequest.model_validate(make_request())
    delivery = new_delivery(
        DeliveryId("dlv_1"),
        customer_id=SubjectId("alice"),
        request=request,
        offer=None,
        at=START,
    )
    mission = make_mission(
        request, delivery_id="dlv_1", attempt=1, drone_id="drn_1", start_at=START
    )
    load = PickUp(
        station_id=StationId("san-marcos"),
        package_ids=(PackageId("p1"),),
        start_s=300,
        end_s=360,
    )
    plan = mission.plan.model_copy(update={"steps": (load,)})

    [planned] = after_booking(
        delivery, [mission.model_copy(update={"plan": plan})], at=START
    ).happenings

    at = START + timedelta(seconds=300)
    assert datetime.fromisoformat(planned.data["pickup_at"]) == at
