"""GET /v1/live: who may look, and how a wrong question is answered."""

import pytest

from skyway.runtime.limits import Slots
from tests.gateway.access.test_quotas import replace_part
from tests.gateway.whole_gateway import Gateway


async def test_a_drone_may_not_look(gateway: Gateway) -> None:
    answer = await gateway.http.get("/v1/live", headers=gateway.drone)

    assert answer.status_code == 403


@pytest.mark.parametrize(
    ("query", "field"), [("kinds=ships", "kinds"), ("bbox=1,2", "bbox"), ("kind=drones", "kind")]
)
async def test_a_wrong_question_names_its_field(gateway: Gateway, query: str, field: str) -> None:
    answer = await gateway.http.get(f"/v1/live?{query}", headers=gateway.operator)

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"].endswith(field)


async def test_a_viewer_takes_one_of_its_streams(gateway: Gateway) -> None:
    slots = Slots("STREAMS", 1)
    replace_part(gateway, "streams", slots)

    with slots.held("operator:op"):
        refused = await gateway.http.get("/v1/live", headers=gateway.operator)

    assert (refused.status_code, refused.json()["code"]) == (429, "STREAMS")


async def test_without_registry_and_composition_there_is_no_first_picture(
    gateway: Gateway,
) -> None:
    gateway.parts.live.first_look_within_s = 0.0

    answer = await gateway.http.get("/v1/live", headers=gateway.operator)

    assert answer.status_code == 503
