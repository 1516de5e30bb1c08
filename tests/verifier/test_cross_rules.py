"""The rules across services, on facts made by hand: changes in progress break none."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest
from skyway_verifier.across.rules import DELIVERY_RULES, DRONE_RULES
from skyway_verifier.check import Look
from skyway_verifier.facts import DeliveryFacts, Facts, HintFacts, MissionFacts, PackageFacts
from skyway_verifier.rule import broken_across, cell_name, still_broken

from skyway.contracts.mission import LIVE_MISSION_STATES, MissionState

BUSY = "the registry knows that a drone on a live mission is busy"
OVER = "the registry knows that a mission is over"
INVENTED = "the registry knows no mission that composition does not have"
HINT_RULES = [rule for rule in DRONE_RULES if rule.name in (BUSY, OVER, INVENTED)]


def hint_looks(**hints: Sequence[HintFacts]) -> dict[str, Look]:
    """A look at databases that have these facts about missions."""
    return {
        name: Look(facts=Facts(hints={each.mission_id: each for each in facts}))
        for name, facts in hints.items()
    }


def hint(
    state: MissionState, seq: int, *, waiting_reports: int = 0, mission_id: str = "msn_1"
) -> HintFacts:
    return HintFacts(
        mission_id=mission_id,
        drone_id="drn_1",
        state=state,
        is_live=state in LIVE_MISSION_STATES,
        report_seq=seq,
        waiting_reports=waiting_reports,
    )


def broken(composition: HintFacts | None, registry: HintFacts | None) -> Sequence[str]:
    """The names of the rules about hints that the facts of one mission break."""
    return list(_broken(composition, registry))


def _broken(composition: HintFacts | None, registry: HintFacts | None) -> Iterator[str]:
    looks = hint_looks(
        composition=() if composition is None else (composition,),
        registry=() if registry is None else (registry,),
    )
    for rule in HINT_RULES:
        if any(rule.broken(looks, looks)):
            yield rule.name


@pytest.mark.parametrize(
    ("composition", "registry", "rules"),
    [
        (hint("ACTIVE", 4), hint("ACTIVE", 4), []),
        (hint("ACTIVE", 4), None, [BUSY]),
        (hint("ACTIVE", 4), hint("COMPLETED", 4), [BUSY]),
        (hint("COMPLETED", 5), hint("ACTIVE", 4), [OVER]),
        (hint("QUEUED", 1), hint("ACTIVE", 1), [OVER]),
        (None, hint("ACTIVE", 4), [INVENTED]),
    ],
)
def test_a_difference_that_nothing_explains_breaks_a_rule(
    composition: HintFacts | None, registry: HintFacts | None, rules: list[str]
) -> None:
    assert broken(composition, registry) == rules


@pytest.mark.parametrize(
    ("composition", "registry"),
    [
        (hint("ACTIVE", 4, waiting_reports=1), None),
        (hint("COMPLETED", 5, waiting_reports=1), hint("ACTIVE", 4)),
        (hint("BOOKED", 2), None),
    ],
)
def test_a_report_on_its_way_explains_a_difference(
    composition: HintFacts, registry: HintFacts | None
) -> None:
    assert broken(composition, registry) == []


def test_a_mission_may_end_after_composition_was_read() -> None:
    assert broken(hint("ACTIVE", 4), hint("COMPLETED", 5)) == []


def test_a_queued_mission_may_be_sent_after_composition_was_read() -> None:
    assert broken(hint("QUEUED", 1), hint("ACCEPTED", 3)) == []


def test_a_mission_that_is_deleted_between_the_looks_breaks_no_rule() -> None:
    lost, old = hint("ACTIVE", 4, mission_id="msn_1"), hint("COMPLETED", 5, mission_id="msn_2")
    first = hint_looks(composition=[old], registry=[lost, old])
    later = hint_looks(composition=[], registry=[lost])

    found = still_broken(HINT_RULES, first, later)

    assert [(each.rule, each.subject) for each in found] == [(INVENTED, "msn_1")]


def test_the_registry_may_know_an_ended_mission_longer_than_composition() -> None:
    assert broken(None, hint("COMPLETED", 5)) == []


def mission(**members: object) -> MissionFacts:
    """A mission that has ended, with these members instead of its own."""
    values: dict[str, object] = {
        "mission_id": "msn_1",
        "attempt": 1,
        "trip": 1,
        "provider_id": "prv_1",
        "drone_id": "drn_1",
        "state": "COMPLETED",
        "price": (1, "USD"),
        "report_seq": 5,
        **members,
    }
    return MissionFacts(**values)  # type: ignore[arg-type]


def flown(*, is_leaving: bool = False) -> DeliveryFacts:
    """A delivery that is over, with a mission and a package."""
    package = PackageFacts(frozenset({"drn_1"}), recipient=("c", "msn_1"))
    return DeliveryFacts(
        "dlv_1",
        is_over=True,
        is_leaving=is_leaving,
        missions=(mission(),),
        packages={"p1": package},
    )


@pytest.mark.parametrize(("is_leaving", "count"), [(False, 3), (True, 0)])
def test_composition_may_lack_only_a_delivery_that_is_leaving(is_leaving: bool, count: int) -> None:
    looks = delivery_looks(gateway=flown(is_leaving=is_leaving), composition=None)

    assert len(broken_across(DELIVERY_RULES, looks, looks)) == count


def delivery_looks(**deliveries: DeliveryFacts | None) -> dict[str, Look]:
    """A look at services that have this delivery, or none."""
    return {
        name: Look(facts=Facts(deliveries={} if fact is None else {fact.delivery_id: fact}))
        for name, fact in deliveries.items()
    }


@pytest.mark.parametrize(
    ("first", "later"),
    [
        # Composition deleted it after it was read, and the gateway before it was read.
        ({"composition": flown(), "gateway": None}, {"composition": None, "gateway": None}),
        # The gateway was read before it marked the delivery, composition after it deleted it.
        (
            {"composition": None, "gateway": flown()},
            {"composition": None, "gateway": flown(is_leaving=True)},
        ),
        ({"composition": None, "gateway": flown()}, {"composition": None, "gateway": None}),
    ],
)
def test_a_delivery_that_is_deleted_while_services_are_read_breaks_no_rule(
    first: dict[str, DeliveryFacts | None],
    later: dict[str, DeliveryFacts | None],
) -> None:
    looked, again = delivery_looks(**first), delivery_looks(**later)

    assert still_broken(DELIVERY_RULES, looked, again) == []


@pytest.mark.parametrize(("applied", "is_broken"), [(5, True), (4, False)])
def test_only_a_report_on_its_way_explains_another_provider(applied: int, is_broken: bool) -> None:
    moved = {"provider_id": "prv_2", "drone_id": "drn_2", "waiting_reports": 5 - applied}
    looks = delivery_looks(
        gateway=DeliveryFacts("dlv_1", is_over=False, missions=(mission(report_seq=applied),)),
        composition=DeliveryFacts("dlv_1", is_over=False, missions=(mission(**moved),)),
    )

    found = {each.rule for each in broken_across(DELIVERY_RULES, looks, looks)}

    assert found == ({"gateway and composition agree on a mission"} if is_broken else set())


def test_the_facts_of_all_cells_are_those_of_one_composition() -> None:
    known = [hint("ACTIVE", 1, mission_id=f"msn_{number}") for number in (1, 2, 3)]
    looks = hint_looks(registry=known)
    for name, fact in zip(("composition", cell_name(1), cell_name(2)), known, strict=True):
        looks |= hint_looks(**{name: [fact]})

    assert broken_across(HINT_RULES, looks, looks) == []
    del looks[cell_name(2)]
    assert [each.subject for each in broken_across(HINT_RULES, looks, looks)] == ["msn_3"]


def test_a_rule_is_left_out_when_a_database_of_one_service_could_not_be_read() -> None:
    looks = hint_looks(registry=[hint("ACTIVE", 1)], composition=[])
    looks[cell_name(1)] = Look(error="database is unavailable")

    assert broken_across(HINT_RULES, looks, looks) == []


UNLEARNT = "the gateway knows each mission soon after its first report"


def _flown(report_seq: int, *, waiting_reports: int, tries: int) -> DeliveryFacts:
    flying = mission(
        state="ACTIVE", report_seq=report_seq, waiting_reports=waiting_reports, tries=tries
    )
    return DeliveryFacts("dlv_1", is_over=False, missions=(flying,))


@pytest.mark.parametrize(
    ("composition", "is_broken"),
    [
        (_flown(3, waiting_reports=3, tries=8), True),
        (_flown(3, waiting_reports=3, tries=7), False),  # on their way
        (_flown(3, waiting_reports=2, tries=9), False),  # the gateway has the first report
        (_flown(0, waiting_reports=0, tries=0), False),  # its drone has not answered yet
    ],
)
def test_a_queued_delivery_does_not_explain_away_reports_that_are_refused_for_long(
    composition: DeliveryFacts, is_broken: bool
) -> None:
    [rule] = [each for each in DELIVERY_RULES if each.name == UNLEARNT]
    gateway = DeliveryFacts("dlv_1", is_over=False, is_queued=True)

    assert list(rule.finder(composition, gateway)) == (["msn_1"] if is_broken else [])
    known = replace(gateway, missions=composition.missions)
    assert list(rule.finder(composition, known)) == []
