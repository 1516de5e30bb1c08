"""Which drones could fly a request, in which order, and why other providers have none."""

import asyncio
from collections.abc import Sequence
from typing import Any

import pytest
from skyway_provider_registry.candidates.fleet_view import Fleet, FleetColumns
from skyway_provider_registry.candidates.reasons import CachedDrone, CachedProvider
from skyway_provider_registry.candidates.selection import select as select_from
from skyway_provider_registry.candidates.selection import select_each

from skyway.announced_networks import CachedNetworks
from skyway.contracts.candidate import MAX_CANDIDATES_PER_PROVIDER, CandidateQuery
from skyway.contracts.shortlist import Candidates
from skyway.delivery.offer import Tariff
from skyway.delivery.qos import ProviderChoice
from skyway.drone.models import DJI_MATRICE_300_RTK, PAPER_SCENARIO
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId

PICKUP = Position(-97.94, 29.88)
NOW_MS = 1_000


def select(
    query: CandidateQuery, *, providers: Sequence[CachedProvider], drones: Sequence[CachedDrone]
) -> Candidates:
    """The choice among these, now."""
    columns = FleetColumns(CachedNetworks())
    columns.put(drones)
    fleet = Fleet({provider.provider_id: provider for provider in providers}, columns)
    return select_from(query, fleet, wall_now_ms=NOW_MS, now_ms=NOW_MS)


def make_query(**members: object) -> CandidateQuery:
    return CandidateQuery.model_validate(
        {
            "pickup_station_id": "pickup",
            "pickup_position": PICKUP,
            "payload_kg": 2.0,
            "providers": ProviderChoice(),
            **members,
        }
    )


def make_provider(name: str, *, is_active: bool = True) -> CachedProvider:
    tariff = Tariff(base=len(name))
    return CachedProvider(provider_id=ProviderId(name), tariff=tariff, is_active=is_active)


def make_drone(
    name: str, *, provider: str = "p", away_deg: float = 0.0, **members: Any
) -> CachedDrone:
    members_by_name: dict[str, Any] = {
        "drone_id": DroneId(name),
        "provider_id": ProviderId(provider),
        "model": PAPER_SCENARIO,
        "home_station_id": StationId("home"),
        "online_until_ms": NOW_MS,
        "station_id": StationId("pickup" if away_deg == 0 else "elsewhere"),
        "position": Position(PICKUP.longitude_deg + away_deg, PICKUP.latitude_deg),
        "soc": 0.9,
        "is_busy": False,
        **members,
    }
    return CachedDrone(**members_by_name)


def test_a_candidate_has_everything_that_composition_needs() -> None:
    found = select(make_query(), providers=[make_provider("p")], drones=[make_drone("d")])

    (candidate,) = found.shortlist.candidates
    assert (candidate.drone_id, candidate.provider_id) == ("d", "p")
    assert (candidate.station_id, candidate.home_station_id) == ("pickup", "home")
    assert (candidate.model, candidate.soc) == (PAPER_SCENARIO, 0.9)
    assert candidate.tariff == Tariff(base=1)
    assert found.infeasible == ()


def test_the_pickup_comes_first_then_the_nearest_then_the_fullest() -> None:
    drones = [
        make_drone("far", away_deg=0.3),
        make_drone("near-empty", away_deg=0.1, soc=0.5),
        make_drone("near-full", away_deg=0.1, soc=0.8),
        make_drone("there-empty", soc=0.3),
        make_drone("there-full", soc=0.4),
    ]

    found = select(make_query(), providers=[make_provider("p")], drones=drones)

    assert [each.drone_id for each in found.shortlist.candidates] == [
        "there-full",
        "there-empty",
        "near-full",
        "near-empty",
        "far",
    ]


def test_a_drone_at_the_pickup_comes_before_a_drone_with_a_nearer_position() -> None:
    elsewhere = make_drone("elsewhere", station_id=StationId("other"))
    there = make_drone("there", position=Position(PICKUP.longitude_deg + 0.001, 29.88))

    found = select(make_query(), providers=[make_provider("p")], drones=[elsewhere, there])

    assert [each.drone_id for each in found.shortlist.candidates] == [
        "there",
        "elsewhere",
    ]


def test_equal_drones_are_ordered_by_id() -> None:
    drones = [make_drone(name) for name in ("c", "a", "b")]

    found = select(make_query(), providers=[make_provider("p")], drones=drones)

    assert [each.drone_id for each in found.shortlist.candidates] == ["a", "b", "c"]


def test_a_provider_sends_its_five_best() -> None:
    drones = [make_drone(f"d{n}", away_deg=n / 100) for n in range(9, -1, -1)]

    found = select(make_query(), providers=[make_provider("p")], drones=drones)

    assert [each.drone_id for each in found.shortlist.candidates] == [
        "d0",
        "d1",
        "d2",
        "d3",
        "d4",
    ]


def test_sixty_are_compared_and_each_best_comes_before_any_second() -> None:
    providers = [make_provider(f"p{n:02}") for n in range(40)]
    drones = [
        make_drone(
            f"{provider.provider_id}-{n}", provider=provider.provider_id, away_deg=away / 100 + n
        )
        for away, provider in enumerate(providers)
        for n in range(5)
    ]

    found = select(make_query(), providers=providers, drones=drones)

    names = [each.drone_id for each in found.shortlist.candidates]
    assert len(names) == 60
    assert {each.provider_id for each in found.shortlist.candidates} == {
        provider.provider_id for provider in providers
    }
    assert names[:40] == [f"p{n:02}-0" for n in range(40)]
    assert names[40:] == [f"p{n:02}-1" for n in range(20)]


def test_with_more_than_sixty_providers_the_nearest_are_compared_and_others_get_a_reason() -> None:
    providers = [make_provider(f"p{n:02}") for n in range(62)]
    drones = [
        make_drone(f"d{n:02}", provider=f"p{n:02}", away_deg=(62 - n) / 100) for n in range(62)
    ]

    found = select(make_query(), providers=providers, drones=drones)

    assert len(found.shortlist.candidates) == 60
    reasons = [
        (reason.provider_id, reason.code, reason.is_temporary) for reason in found.infeasible
    ]
    assert reasons == [("p00", "NOT_COMPARED", True), ("p01", "NOT_COMPARED", True)]


@pytest.mark.parametrize(
    ("drone", "code", "is_temporary"),
    [
        (make_drone("d", is_busy=True), "BUSY", True),
        (make_drone("d", station_id=None), "BUSY", True),
        (make_drone("d", online_until_ms=NOW_MS - 1), "OFFLINE", True),
        (make_drone("d", online_until_ms=NOW_MS - 1, is_busy=True), "OFFLINE", True),
        (make_drone("d", online_until_ms=0, station_id=None), "OFFLINE", True),
        (make_drone("refused"), "REFUSED", False),
        (make_drone("d", model=DJI_MATRICE_300_RTK, soc=0.09), "LOW_CHARGE", True),
    ],
)
def test_a_drone_that_cannot_fly_gives_its_provider_a_reason(
    drone: CachedDrone, code: str, is_temporary: bool
) -> None:
    query = make_query(excluded_drone_ids=("refused",))

    found = select(query, providers=[make_provider("p")], drones=[drone])

    assert found.shortlist.candidates == ()
    (reason,) = found.infeasible
    assert (reason.provider_id, reason.code, reason.is_temporary) == ("p", code, is_temporary)


def test_a_charge_at_the_reserve_is_enough() -> None:
    drone = make_drone("d", model=DJI_MATRICE_300_RTK, soc=0.1)

    found = select(make_query(), providers=[make_provider("p")], drones=[drone])

    assert len(found.shortlist.candidates) == 1


def test_temporary_reasons_are_reported_before_permanent_ones() -> None:
    drones = [
        make_drone("small", model=DJI_MATRICE_300_RTK),
        make_drone("refused"),
        make_drone("offline", online_until_ms=0),
        make_drone("busy", is_busy=True),
    ]
    query = make_query(payload_kg=3.0, excluded_drone_ids=("refused",))
    codes = []
    while drones:
        found = select(query, providers=[make_provider("p")], drones=drones)
        codes.append(found.infeasible[0].code)
        drones.pop()

    assert codes == ["BUSY", "OFFLINE", "REFUSED", "OVERWEIGHT"]


def test_overweight_names_the_payload_and_the_limit_of_the_strongest() -> None:
    drones = [make_drone("small", model=DJI_MATRICE_300_RTK), make_drone("strong")]

    found = select(make_query(payload_kg=17.2), providers=[make_provider("p")], drones=drones)

    (reason,) = found.infeasible
    assert (reason.code, reason.is_temporary) == ("OVERWEIGHT", False)
    assert (
        reason.detail == "payload 17.2 kg exceeds the 15.3 kg limit of drone model paper-scenario"
    )
    assert reason.data == {"mass_kg": 17.2, "limit_kg": 15.3}


def test_a_provider_that_must_split_sends_its_strongest_first() -> None:
    drones = [
        *(make_drone(f"weak-{n}", model=DJI_MATRICE_300_RTK) for n in range(5)),
        make_drone("strong-far", away_deg=0.3),
        make_drone("strong-near", away_deg=0.1),
    ]
    query = make_query(payload_kg=20.0, heaviest_kg=2.0)

    found = select(query, providers=[make_provider("p")], drones=drones)

    names = [each.drone_id for each in found.shortlist.candidates]
    assert names == ["weak-0", "weak-1", "weak-2", "strong-near", "strong-far"]


def test_a_provider_that_splits_must_lift_the_heaviest_package() -> None:
    drones = [make_drone("weak", model=DJI_MATRICE_300_RTK), make_drone("strong")]
    query = make_query(payload_kg=20.0, heaviest_kg=3.0)

    found = select(query, providers=[make_provider("p")], drones=drones)

    assert [each.drone_id for each in found.shortlist.candidates] == ["strong"]


def test_a_provider_whose_only_strong_drone_is_busy_is_busy_and_splits_nothing() -> None:
    drones = [make_drone("weak", model=DJI_MATRICE_300_RTK), make_drone("strong", is_busy=True)]
    query = make_query(payload_kg=3.0, heaviest_kg=1.0)

    found = select(query, providers=[make_provider("p")], drones=drones)

    assert found.shortlist.candidates == ()
    assert [reason.code for reason in found.infeasible] == ["BUSY"]


@pytest.mark.parametrize(
    ("sister", "is_more_later"),
    [
        ({"is_busy": True}, True),
        ({"soc": 0.05, "model": DJI_MATRICE_300_RTK}, True),
        ({}, False),
        ({"online_until_ms": 0}, False),
        ({"is_busy": True, "model": DJI_MATRICE_300_RTK, "payload_kg": 3.0}, False),
    ],
)
def test_a_provider_may_have_more_drones_later_beside_those_to_compare(
    sister: dict[str, Any], is_more_later: bool
) -> None:
    query = make_query(payload_kg=sister.pop("payload_kg", 2.0))
    drones = [make_drone("free", away_deg=0.3), make_drone("sister", **sister)]

    found = select(query, providers=[make_provider("p")], drones=drones)

    assert found.infeasible == ()
    assert found.more_later == (("p",) if is_more_later else ())


def test_one_provider_splits_while_another_lifts_everything() -> None:
    drones = [
        make_drone("weak", provider="p", model=DJI_MATRICE_300_RTK),
        make_drone("strong", provider="q"),
        make_drone("idle", provider="q", model=DJI_MATRICE_300_RTK),
    ]
    query = make_query(payload_kg=3.0, heaviest_kg=1.0)

    found = select(query, providers=[make_provider("p"), make_provider("q")], drones=drones)

    assert {each.drone_id for each in found.shortlist.candidates} == {"weak", "strong"}


def test_a_package_that_is_too_heavy_is_named() -> None:
    drone = make_drone("weak", model=DJI_MATRICE_300_RTK)
    query = make_query(payload_kg=20.0, heaviest_kg=5.0)

    found = select(query, providers=[make_provider("p")], drones=[drone])

    assert found.infeasible[0].data == {"mass_kg": 5.0, "limit_kg": 2.7}


def test_new_data_of_a_drone_replaces_the_old() -> None:
    columns = FleetColumns(CachedNetworks())
    columns.put([make_drone(f"d{n}", is_busy=True) for n in range(1_000)])
    columns.put([make_drone("d7", soc=0.4)])
    fleet = Fleet({ProviderId("p"): make_provider("p")}, columns)

    (candidate,) = select_from(
        make_query(), fleet, wall_now_ms=NOW_MS, now_ms=NOW_MS
    ).shortlist.candidates

    assert (candidate.drone_id, candidate.soc) == ("d7", 0.4)


def test_rounding_errors_of_masses_do_not_make_a_request_too_heavy() -> None:
    drone = make_drone("d", model=DJI_MATRICE_300_RTK)

    found = select(
        make_query(payload_kg=2.7000000000000006), providers=[make_provider("p")], drones=[drone]
    )

    assert len(found.shortlist.candidates) == 1


def test_a_provider_without_drones_gets_that_reason() -> None:
    found = select(make_query(), providers=[make_provider("p")], drones=[])

    assert [reason.code for reason in found.infeasible] == ["NO_DRONES"]


@pytest.mark.parametrize(
    "choice",
    [
        ProviderChoice(pinned=ProviderId("good")),
        ProviderChoice(allowed=(ProviderId("good"),)),
        ProviderChoice(denied=(ProviderId("bad"),)),
    ],
)
def test_only_admitted_providers_have_candidates(choice: ProviderChoice) -> None:
    drones = [make_drone("d1", provider="good"), make_drone("d2", provider="bad")]
    providers = [make_provider("good"), make_provider("bad")]

    found = select(make_query(providers=choice), providers=providers, drones=drones)

    assert [each.provider_id for each in found.shortlist.candidates] == ["good"]
    assert [(reason.provider_id, reason.code) for reason in found.infeasible] == [
        ("bad", "NOT_ADMITTED")
    ]


def test_a_suspended_provider_gets_no_missions() -> None:
    provider = make_provider("p", is_active=False)

    found = select(make_query(), providers=[provider], drones=[make_drone("d")])

    assert found.shortlist.candidates == ()
    assert [reason.code for reason in found.infeasible] == ["NOT_ADMITTED"]


def test_the_drone_of_a_held_offer_is_named_although_others_are_nearer() -> None:
    drones = [make_drone(f"d{number}") for number in range(MAX_CANDIDATES_PER_PROVIDER + 1)]
    query = make_query()
    usual = select(query, providers=[make_provider("p")], drones=drones).shortlist.drone_ids
    (last,) = {drone.drone_id for drone in drones} - set(usual)

    kept = query.model_copy(update={"kept_drone_ids": (last,)})
    found = select(kept, providers=[make_provider("p")], drones=drones)

    assert found.shortlist.drone_ids == (*usual, last)


def test_the_drone_of_a_held_offer_is_not_named_while_it_cannot_fly() -> None:
    query = make_query().model_copy(update={"kept_drone_ids": ("d",)})

    found = select(
        query, providers=[make_provider("p")], drones=[make_drone("d", online_until_ms=0)]
    )

    assert found.shortlist.drone_ids == ()


async def test_other_work_goes_on_while_many_queries_are_answered() -> None:
    columns = FleetColumns(CachedNetworks())
    columns.put([make_drone("d")])
    fleet = Fleet({ProviderId("p"): make_provider("p")}, columns)
    answering = asyncio.ensure_future(
        select_each([make_query()] * 64, fleet, wall_now_ms=NOW_MS, now_ms=NOW_MS)
    )

    turns = 0
    while not answering.done():
        await asyncio.sleep(0)
        turns += 1

    assert len(await answering) == 64
    assert turns >= 64
