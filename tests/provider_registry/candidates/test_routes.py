"""Services ask for candidates, and get them from the committed data."""

from collections.abc import Awaitable, Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_provider_registry.presence.follow import Recorder

from skyway.announced_networks import NetworkLearner
from skyway.contracts.candidate import CANDIDATE_LISTS
from skyway.contracts.drone_report import Connection, DroneState
from skyway.contracts.shortlist import CandidateLists, Candidates, Shortlist
from skyway.contracts.topics import CONNECTION, STATE
from skyway.contracts.world import NetworkVersion
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import MissionId, NetworkId, StationId
from skyway.runtime.clock import ManualClock
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database

pytestmark = pytest.mark.databases("sqlite")

AT = datetime(2026, 3, 1, 12, tzinfo=UTC)
QUERY: dict[str, object] = {
    "pickup_station_id": "san-marcos",
    "pickup_position": [-97.94139, 29.88327],
    "payload_kg": 2.0,
    "providers": {},
}

Ready = Callable[..., Awaitable[dict[str, Any]]]
Announce = Callable[[str], Awaitable[None]]


@pytest.fixture
def ready(api: Any, db: Database, clock: ManualClock) -> Ready:
    """Makes a drone that has sent its first messages."""

    async def make(
        provider_id: str, *, station_id: str = "san-marcos", mission_id: str | None = None
    ) -> dict[str, Any]:
        drone: dict[str, Any] = await api.drone(provider_id)
        ids = (provider_id, drone["drone_id"])
        online = Connection(
            message_id="m", sent_at=AT, session=1, connection_number=1, status="ONLINE"
        )
        state = DroneState(
            message_id="m",
            sent_at=AT,
            session=1,
            seq=1,
            at=AT,
            activity="IDLE",
            stream=0,
            last_instruction_seq=0,
            last_event_seq=0,
            station_id=StationId(station_id),
            mission_id=None if mission_id is None else MissionId(mission_id),
            position=Position(-97.94139, 29.88327),
            soc=0.8,
        )
        batch: list[Received[Any]] = [
            Received(CONNECTION, ids, online, False),
            Received(STATE, ids, state, False),
        ]
        await Recorder(db, clock).record(batch)
        return drone

    return make


async def ask(api: Any, **members: object) -> Candidates:
    answer = await api(None, "POST", "/internal/candidates", {**QUERY, **members})
    assert answer.status_code == 200, answer.text
    return Candidates.model_validate_json(answer.content)


async def test_a_candidate_has_its_own_standby_or_its_providers(api: Any, ready: Ready) -> None:
    provider_id = await api.provider(standby="STAY")
    first, second = await ready(provider_id), await ready(provider_id)
    path = f"/v1/providers/{provider_id}/drones/{second['drone_id']}"
    await api(f"provider:{provider_id}", "PATCH", path, {"standby": "PARKING"})

    found = await ask(api)

    assert {each.drone_id: each.standby for each in found.shortlist.candidates} == {
        first["drone_id"]: "STAY",
        second["drone_id"]: "PARKING",
    }


async def test_a_drone_that_stands_online_is_a_candidate(api: Any, ready: Ready) -> None:
    provider_id = await api.provider()
    drone = await ready(provider_id)

    found = await ask(api)

    (candidate,) = found.shortlist.candidates
    assert candidate.drone_id == drone["drone_id"]
    assert candidate.provider_id == provider_id
    assert (candidate.station_id, candidate.soc) == ("san-marcos", 0.8)
    assert candidate.home_station_id == "san-marcos"
    assert candidate.tariff.base == 300
    assert candidate.loading == "AUTOMATIC"
    assert candidate.model == DroneModel.model_validate(drone["model"])
    assert found.infeasible == ()


async def test_a_candidate_says_who_confirms_its_loading(api: Any, ready: Ready) -> None:
    await ready(await api.provider(loading="CONFIRMED"))

    (candidate,) = (await ask(api)).shortlist.candidates

    assert candidate.loading == "CONFIRMED"


async def test_a_drone_that_never_sent_a_message_is_no_candidate(api: Any) -> None:
    await api.drone(await api.provider())

    found = await ask(api)

    assert found.shortlist.is_empty
    assert [reason.code for reason in found.infeasible] == ["OFFLINE"]


async def test_a_drone_that_names_a_mission_is_busy(api: Any, ready: Ready) -> None:
    await ready(await api.provider(), mission_id="msn_1")

    found = await ask(api)

    assert [reason.code for reason in found.infeasible] == ["BUSY"]


async def test_a_silent_drone_is_no_candidate(api: Any, ready: Ready, clock: ManualClock) -> None:
    await ready(await api.provider())
    clock.advance(timedelta(minutes=5))

    found = await ask(api)

    assert [reason.code for reason in found.infeasible] == ["OFFLINE"]


async def test_a_drone_that_refused_is_left_out(api: Any, ready: Ready) -> None:
    drone = await ready(await api.provider())

    found = await ask(api, excluded_drone_ids=[drone["drone_id"]])

    assert [reason.code for reason in found.infeasible] == ["REFUSED"]


@pytest.fixture
def announce(networks: NetworkLearner) -> Announce:
    """Announces a network to the registry, which reads its stations."""

    async def announce(network_id: str) -> None:
        message = NetworkVersion(
            message_id="m",
            sent_at=AT,
            network_id=NetworkId(network_id),
            version=1,
            sha256="0" * 64,
            href="/",
        )
        networks.note(message)
        await networks.learn()

    return announce


async def test_drones_of_another_network_leave_their_places_to_drones_of_the_pickups_network(
    api: Any, ready: Ready, announce: Announce
) -> None:
    provider_id = await api.provider()
    foreign = [await ready(provider_id, station_id="c-s1") for _ in range(6)]
    own = await ready(provider_id, station_id="mcqueeney")
    before = await ask(api)

    await announce("texas")
    await announce("city")
    after = await ask(api)

    path = f"/v1/providers/{provider_id}/drones/{foreign[0]['drone_id']}"
    await api("operator:op", "DELETE", path)
    with_one_less = await ask(api)

    assert set(before.shortlist.drone_ids) == {drone["drone_id"] for drone in foreign[:5]}
    assert after.shortlist.drone_ids == (own["drone_id"],)
    assert with_one_less.shortlist.drone_ids == (own["drone_id"],)


async def test_a_provider_in_another_network_only_gets_that_reason(
    api: Any, ready: Ready, announce: Announce
) -> None:
    await ready(await api.provider(), station_id="c-s1")
    await announce("texas")
    await announce("city")

    (reason,) = (await ask(api)).infeasible

    assert (reason.code, reason.is_temporary) == ("DESTINATION_UNREACHABLE", False)
    assert reason.detail == "station 'c-s1' is not in network 'texas'"


async def test_a_suspended_provider_has_no_candidates(api: Any, ready: Ready) -> None:
    provider_id = await api.provider()
    await ready(provider_id)
    await api("operator:op", "PATCH", f"/v1/providers/{provider_id}", {"state": "SUSPENDED"})

    found = await ask(api)

    assert [reason.code for reason in found.infeasible] == ["NOT_ADMITTED"]


async def test_without_providers_there_are_no_reasons(api: Any) -> None:
    assert await ask(api) == Candidates(shortlist=Shortlist(), infeasible=())


async def test_one_call_answers_questions_about_several_requests(api: Any, ready: Ready) -> None:
    providers = [await api.provider(), await api.provider()]
    for provider_id in providers:
        await ready(provider_id)
    choices: list[dict[str, object]] = [{"pinned": each} for each in reversed(providers)]
    queries = [{**QUERY, "providers": choice} for choice in choices]

    answer = await api(None, "POST", "/internal/candidate-lists", {"queries": queries})

    found = CandidateLists.model_validate_json(answer.content)
    assert list(found.answers) == [await ask(api, providers=choice) for choice in choices]
    assert [each.shortlist.provider_ids for each in found.answers] == [
        (each,) for each in reversed(providers)
    ]


async def test_composition_gets_the_same_answer_about_several_requests(
    api: Any, ready: Ready
) -> None:
    await ready(await api.provider())
    asked = {"queries": [QUERY]}

    answers = [
        await api(None, "POST", CANDIDATE_LISTS, asked, service=service)
        for service in ("gateway", "composition")
    ]

    first, second = (CandidateLists.model_validate_json(each.content) for each in answers)
    assert first == second
    assert len(second.answers[0].shortlist.drone_ids) == 1


async def test_a_bad_query_is_refused_with_its_field(api: Any) -> None:
    answer = await api(None, "POST", "/internal/candidates", {**QUERY, "payload_kg": -1})

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "payload_kg"


@pytest.mark.parametrize(
    "path", ["/internal/candidates", "/internal/candidate-lists", "/internal/payload-limit"]
)
async def test_only_services_may_ask(api: Any, path: str) -> None:
    answer = await api("customer:c", "POST", path, {**QUERY, "queries": [QUERY]})

    assert answer.status_code == 403


async def limit(api: Any, **choice: object) -> Any:
    answer = await api(None, "POST", "/internal/payload-limit", {"providers": choice})
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_the_payload_limit_is_that_of_the_strongest_drone(api: Any) -> None:
    provider_id = await api.provider()
    await api.drone(provider_id, model_id="dji-matrice-300-rtk")
    small = await limit(api)
    await api.drone(provider_id, model_id="paper-scenario")

    assert (small["max_payload_kg"], small["drone_model_id"]) == (2.7, "dji-matrice-300-rtk")
    assert (await limit(api))["max_payload_kg"] == 15.3


async def test_the_payload_limit_counts_admitted_providers_only(api: Any) -> None:
    small, strong = await api.provider(), await api.provider()
    await api.drone(small, model_id="dji-matrice-300-rtk")
    await api.drone(strong, model_id="paper-scenario")

    assert (await limit(api, pinned=small))["max_payload_kg"] == 2.7
    assert (await limit(api, denied=[strong]))["max_payload_kg"] == 2.7
    assert (await limit(api, allowed=[strong]))["max_payload_kg"] == 15.3


async def test_the_payload_limit_leaves_suspended_providers_out(api: Any) -> None:
    provider_id = await api.provider()
    await api.drone(provider_id)
    await api("operator:op", "PATCH", f"/v1/providers/{provider_id}", {"state": "SUSPENDED"})

    assert (await limit(api))["max_payload_kg"] is None


async def test_unknown_providers_are_named(api: Any) -> None:
    known = await api.provider()

    answer = await limit(api, pinned="prv_0", allowed=["prv_0", known, "prv_1"], denied=["prv_2"])

    assert answer["unknown_provider_ids"] == ["prv_0", "prv_1", "prv_2"]
    assert answer["max_payload_kg"] is None
