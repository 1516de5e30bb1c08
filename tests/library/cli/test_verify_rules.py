"""The rules across services, on facts made by hand: changes in progress break none."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from skyway.cli.verify.delivery_rules import DELIVERY_RULES
from skyway.cli.verify.drone_rules import DRONE_RULES
from skyway.cli.verify.looks import ServiceLook, cell_name, still_broken, with_cells
from skyway.contracts.mission import LIVE_MISSION_STATES, MissionState
from skyway.contracts.service_facts import (
    CustodyLink,
    DeliveryFacts,
    HintFacts,
    MissionFacts,
    PackageFacts,
)
from skyway.delivery.offer import Price
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, ProviderId

BUSY = "the registry knows that a drone on a live mission is busy"
OVER = "the registry knows that a mission is over"
INVENTED = "the registry knows no mission that composition does not have"


def hint(
    state: MissionState, seq: int, *, waiting_reports: int = 0, mission_id: str = "msn_1"
) -> HintFacts:
    return HintFacts(
        mission_id=MissionId(mission_id),
        drone_id=DroneId("drn_1"),
        state=state,
        is_live=state in LIVE_MISSION_STATES,
        report_seq=seq,
        waiting_reports=waiting_reports,
    )


def broken(composition: HintFacts | None, registry: HintFacts | None) -> Sequence[str]:
    """The names of the rules about hints that the facts of one mission break."""
    return list(_broken(composition, registry))


def _broken(composition: HintFacts | None, registry: HintFacts | None) -> Iterator[str]:
    facts = {"composition": composition, "registry": registry}
    for rule in DRONE_RULES:
        if rule.name in (BUSY, OVER, INVENTED) and any(
            rule.finder(facts[rule.first], facts[rule.second])  # type: ignore[arg-type]
        ):
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


def looks(folder: Path, **hints: Sequence[HintFacts]) -> dict[str, ServiceLook]:
    """A look at services that have these facts about missions, which are written to a folder."""
    for service, facts in hints.items():
        own = folder / service
        own.mkdir(parents=True)
        lines = "".join(f"{each.model_dump_json()}\n" for each in facts)
        (own / "hints.jsonl").write_text(lines)
    return {service: ServiceLook(service, (), folder / service) for service in hints}


def test_a_mission_that_is_deleted_between_the_looks_breaks_no_rule(tmp_path: Path) -> None:
    lost, old = hint("ACTIVE", 4, mission_id="msn_1"), hint("COMPLETED", 5, mission_id="msn_2")
    rules = [rule for rule in DRONE_RULES if rule.name in (BUSY, OVER, INVENTED)]
    first = looks(tmp_path / "first", composition=[old], registry=[lost, old])
    later = looks(tmp_path / "later", composition=[], registry=[lost])

    found = still_broken(rules, first, later)

    assert [(each.rule, each.subject) for each in found] == [(INVENTED, "msn_1")]


def test_the_registry_may_know_an_ended_mission_longer_than_composition() -> None:
    assert broken(None, hint("COMPLETED", 5)) == []


def flown(*, is_leaving: bool = False) -> DeliveryFacts:
    """A delivery that is over, with a mission and a package."""
    mission = MissionFacts(
        mission_id=MissionId("msn_1"),
        attempt=1,
        trip=1,
        provider_id=ProviderId("prv_1"),
        drone_id=DroneId("drn_1"),
        state="COMPLETED",
        price=Price(amount=1, currency="USD"),
        report_seq=5,
    )
    chain = (
        CustodyLink(kind="DRONE", custodian_id="drn_1"),
        CustodyLink(kind="RECIPIENT", custodian_id="c", mission_id=MissionId("msn_1")),
    )
    package = PackageFacts(package_id=PackageId("p1"), chain=chain)
    return DeliveryFacts(
        delivery_id=DeliveryId("dlv_1"),
        is_over=True,
        is_leaving=is_leaving,
        missions=(mission,),
        packages=(package,),
    )


@pytest.mark.parametrize(("is_leaving", "count"), [(False, 3), (True, 0)])
def test_composition_may_lack_only_a_delivery_that_is_leaving(is_leaving: bool, count: int) -> None:
    facts = {"gateway": flown(is_leaving=is_leaving), "composition": None}

    found = [
        rule.name
        for rule in DELIVERY_RULES
        if any(rule.finder(facts[rule.first], facts[rule.second]))
    ]

    assert len(found) == count


def delivery_looks(folder: Path, **deliveries: DeliveryFacts | None) -> dict[str, ServiceLook]:
    """A look at services that have this delivery, or none."""
    for service, fact in deliveries.items():
        (folder / service).mkdir(parents=True)
        line = "" if fact is None else f"{fact.model_dump_json()}\n"
        (folder / service / "deliveries.jsonl").write_text(line)
    return {service: ServiceLook(service, (), folder / service) for service in deliveries}


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
    tmp_path: Path,
    first: dict[str, DeliveryFacts | None],
    later: dict[str, DeliveryFacts | None],
) -> None:
    looked = delivery_looks(tmp_path / "first", **first)
    again = delivery_looks(tmp_path / "later", **later)

    assert still_broken(DELIVERY_RULES, looked, again) == []


def test_verify_reads_the_facts_of_all_cells_as_one_composition(tmp_path: Path) -> None:
    looks = {}
    for name, mission_ids in (
        ("composition", ("msn_1", "msn_4")),
        (cell_name(1), ("msn_3",)),
        (cell_name(2), ("msn_2",)),
    ):
        folder = tmp_path / name
        folder.mkdir()
        facts = (hint("ACTIVE", 1, mission_id=each).model_dump_json() for each in mission_ids)
        (folder / "hints.jsonl").write_text("".join(f"{each}\n" for each in facts))
        looks[name] = ServiceLook(name, (), folder)

    composition = with_cells(looks)["composition"]

    assert [each.mission_id for each in composition.hints()] == ["msn_1", "msn_2", "msn_3", "msn_4"]
    assert composition.has_facts
    (tmp_path / cell_name(2) / "hints.jsonl").unlink()
    (tmp_path / cell_name(2)).rmdir()
    assert not composition.has_facts


UNLEARNT = "the gateway knows each mission soon after its first report"


def _flown(report_seq: int, *, waiting_reports: int, tries: int) -> DeliveryFacts:
    mission = MissionFacts(
        mission_id=MissionId("msn_1"),
        attempt=1,
        trip=1,
        provider_id=ProviderId("prv_1"),
        drone_id=DroneId("drn_1"),
        state="ACTIVE",
        price=Price(amount=1, currency="USD"),
        report_seq=report_seq,
        waiting_reports=waiting_reports,
        tries=tries,
    )
    return DeliveryFacts(delivery_id=DeliveryId("dlv_1"), is_over=False, missions=(mission,))


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
    gateway = DeliveryFacts(delivery_id=DeliveryId("dlv_1"), is_over=False, is_queued=True)

    found = list(rule.finder(composition, gateway))

    assert found == (["msn_1"] if is_broken else [])
    known = gateway.model_copy(update={"missions": composition.missions})
    assert list(rule.finder(composition, known)) == []
