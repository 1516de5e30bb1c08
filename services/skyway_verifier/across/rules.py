"""The rules of deliveries, drones, providers, and single values that two services store."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Final

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.ids import is_live_id
from skyway_verifier.facts import CopyFacts, DeliveryFacts, HintFacts, MissionFacts, PackageFacts
from skyway_verifier.rule import AnyCrossRule, CrossRule

#: What the other service knows of a delivery; None if it does not know the delivery.
_Known = DeliveryFacts | None

_rule = partial(CrossRule[DeliveryFacts], facts=lambda facts: facts.deliveries)
#: Rules about what one service has: the other one is read later, and must have it too.
_from_gateway = partial(_rule, first="gateway", second="composition")
_from_composition = partial(_rule, first="composition", second="gateway")


def _if_known(
    find: Callable[[DeliveryFacts, DeliveryFacts], Iterable[str]],
) -> Callable[[DeliveryFacts, _Known], Iterable[str]]:
    """Finds nothing in a delivery that the other service does not know."""
    return lambda one, other: () if other is None else find(one, other)


def _unless_leaving(
    find: Callable[[DeliveryFacts, DeliveryFacts], Iterable[str]],
) -> Callable[[DeliveryFacts, _Known], Iterable[str]]:
    """Finds nothing where composition has deleted a delivery because of its age: so will others."""
    nothing = DeliveryFacts("", is_over=True)
    return lambda gateway, composition: (
        () if gateway.is_leaving and composition is None else find(gateway, composition or nothing)
    )


def _pairs(
    gateway: DeliveryFacts, composition: DeliveryFacts
) -> Iterator[tuple[MissionFacts, MissionFacts]]:
    """The missions that both services have, each as the gateway and as composition has it."""
    planned = {each.mission_id: each for each in composition.missions}
    for mission in gateway.missions:
        if mission.mission_id in planned:
            yield mission, planned[mission.mission_id]


def _missing(one: DeliveryFacts, other: DeliveryFacts) -> list[MissionFacts]:
    """The missions that only the first one has."""
    known = {each.mission_id for each in other.missions}
    return [each for each in one.missions if each.mission_id not in known]


def _package(delivery: DeliveryFacts, package_id: str) -> PackageFacts:
    return delivery.packages.get(package_id, PackageFacts())


@_unless_leaving
def _unknown_missions(gateway: DeliveryFacts, composition: DeliveryFacts) -> Iterable[str]:
    return [each.mission_id for each in _missing(gateway, composition)]


@_if_known
def _unexpected_missions(composition: DeliveryFacts, gateway: DeliveryFacts) -> Iterable[str]:
    """Live missions for which the gateway does not wait; a booking may still be answered."""
    is_explained = gateway.is_queued or gateway.waiting_messages > 0
    return [
        each.mission_id
        for each in _missing(composition, gateway)
        if each.state in LIVE_MISSION_STATES and each.waiting_reports == 0 and not is_explained
    ]


@_if_known
def _unlearnt_missions(composition: DeliveryFacts, gateway: DeliveryFacts) -> Iterator[str]:
    """Missions that are not known at the gateway although all their reports were sent often."""
    for mission in _missing(composition, gateway):
        is_untold = 0 < mission.report_seq == mission.waiting_reports
        if is_untold and mission.tries >= _MOST_TRIES:
            yield mission.mission_id


@_if_known
def _lost_reports(composition: DeliveryFacts, gateway: DeliveryFacts) -> Iterator[str]:
    for applied, sent in _pairs(gateway, composition):
        if applied.report_seq < sent.report_seq - sent.waiting_reports:
            yield sent.mission_id


@_if_known
def _invented_reports(gateway: DeliveryFacts, composition: DeliveryFacts) -> Iterator[str]:
    for applied, sent in _pairs(gateway, composition):
        if applied.report_seq > sent.report_seq:
            yield sent.mission_id


@_if_known
def _other_missions(gateway: DeliveryFacts, composition: DeliveryFacts) -> Iterator[str]:
    for applied, sent in _pairs(gateway, composition):
        # A report on its way may say that another provider's drone flies the mission.
        is_same = applied.report_seq != sent.report_seq or applied.reported == sent.reported
        if applied.fixed != sent.fixed or not is_same:
            yield sent.mission_id


@_unless_leaving
def _undelivered(gateway: DeliveryFacts, composition: DeliveryFacts) -> Iterator[str]:
    """Packages that the gateway counts as delivered, and composition not, or otherwise."""
    for package_id, package in gateway.packages.items():
        if package.recipient not in (None, _package(composition, package_id).recipient):
            yield f"{gateway.delivery_id}/{package_id}"


@_if_known
def _unreported_deliveries(composition: DeliveryFacts, gateway: DeliveryFacts) -> Iterator[str]:
    """Packages that composition counts as delivered, and the gateway not."""
    # A drone may hand over late, after its mission was given up: an alarm has called people then.
    waiting = {
        each.mission_id
        for each in composition.missions
        if each.waiting_reports > 0 or each.state in ("ABORTED", "CANCELLED", "REFUSED")
    }
    for package_id, package in composition.packages.items():
        is_reported = _package(gateway, package_id).recipient is not None
        if (
            package.recipient is not None
            and package.recipient[1] not in waiting
            and not is_reported
        ):
            yield f"{composition.delivery_id}/{package_id}"


def _other_drones(one: DeliveryFacts, other: DeliveryFacts) -> Iterable[str]:
    """Packages that another drone had by the first service than by the other one."""
    return [
        f"{one.delivery_id}/{package_id}"
        for package_id, package in one.packages.items()
        if not package.drones <= _package(other, package_id).drones
    ]


@_if_known
def _unreported_drones(composition: DeliveryFacts, gateway: DeliveryFacts) -> Iterable[str]:
    """Packages that a drone had by composition, and not by the gateway."""
    is_settled = all(each.waiting_reports == 0 for each in composition.missions)
    return _other_drones(composition, gateway) if is_settled and not gateway.is_over else ()


#: After so many tries the first report of a mission has waited for half a minute.
_MOST_TRIES: Final = 8

_ASK_PEOPLE: Final = (
    "Ask people where the package is. Correct the service that is wrong by the drone's events "
    "(composition's `mission_steps.event`), and notify the customer."
)

DELIVERY_RULES: Final = (
    _from_composition(
        "composition knows no test delivery",
        lambda own, _other: () if is_live_id(own.delivery_id) else (own.delivery_id,),
        "A real drone may fly for a test account. Cancel its missions (POST "
        "/v1/missions/{id}/commands with CANCEL), and report how it came there.",
    ),
    _from_composition(
        "a delivery of composition is a delivery of the gateway",
        lambda own, other: () if other else (own.delivery_id,),
        "The delivery was deleted at the gateway. Restore it from a backup; if that cannot "
        "be done, cancel its missions (POST /v1/missions/{id}/commands with CANCEL).",
    ),
    _from_gateway(
        "a mission of the gateway is a mission of composition",
        _unknown_missions,
        "Composition has lost the mission, so no report about it will come. Restore "
        "composition's database from a backup, or find the drone and settle the delivery by hand.",
    ),
    _from_composition(
        "a live mission is one of its delivery at the gateway",
        _unexpected_missions,
        "Nobody waits for this mission. Cancel it: POST /v1/missions/{id}/commands with CANCEL.",
    ),
    _from_composition(
        "the gateway knows each mission soon after its first report",
        _unlearnt_missions,
        "Composition flies the mission, and its customer does not know. Start the gateway "
        "if it is down; else look for NOT_YET and for `booking postponed` in its log.",
    ),
    _from_composition(
        "the gateway has every report that composition has sent",
        _lost_reports,
        "A report was lost, and the gateway waits for it. Composition's steps and custody "
        "say what it reported: restore the report as a row of composition's `outbox`, or set the "
        "gateway's `missions.report_seq` and correct the delivery by hand.",
    ),
    _from_gateway(
        "composition has sent every report that the gateway has",
        _invented_reports,
        "Composition's database is older than the gateway's, or was changed. Restore both "
        "from one backup, or set composition's `missions.report_seq` to the gateway's.",
    ),
    _from_gateway(
        "gateway and composition agree on a mission",
        _other_missions,
        "Correct the service that differs from the drone's instruction (composition's "
        "`instructions.body`) and from the events that the customer has received.",
    ),
    _from_gateway(
        "I6 what the gateway counts as delivered is delivered in composition",
        _undelivered,
        _ASK_PEOPLE,
    ),
    _from_composition(
        "I6 what composition counts as delivered is delivered at the gateway",
        _unreported_deliveries,
        "The customer may believe that the package is elsewhere. " + _ASK_PEOPLE,
    ),
    _from_gateway(
        "I6 a drone that has a package at the gateway has it in composition",
        _unless_leaving(_other_drones),
        "Two drones may have taken the package. " + _ASK_PEOPLE,
    ),
    _from_composition(
        "I6 a drone that has a package in composition has it at the gateway",
        _unreported_drones,
        "Two drones may have taken the package. " + _ASK_PEOPLE,
    ),
)


_of_hints = partial(
    CrossRule[HintFacts],
    facts=lambda facts: facts.hints,
    first="composition",
    second="registry",
)

#: A mission is reported to the registry from this state on, until it has ended.
_REPORTED: Final = ("ACCEPTED", "ACTIVE")

_SET_HINT: Final = (
    "Composition decides which drones are busy. Set the registry's `mission_hints` row as the "
    "mission is there (GET /v1/missions/{id}), and `presence.changed` of the drone to a new number "
    "of `changes.latest`."
)


def _missing_hints(composition: HintFacts, registry: HintFacts | None) -> Iterator[str]:
    if composition.waiting_reports > 0 or composition.state not in _REPORTED:
        return
    if registry is None or (not registry.is_live and registry.report_seq <= composition.report_seq):
        yield composition.mission_id


def _busy_for_ever(composition: HintFacts, registry: HintFacts | None) -> Iterator[str]:
    if registry is None or composition.waiting_reports > 0:
        return
    # A later report may have come since composition was read: a QUEUED mission was sent.
    is_latest = registry.report_seq <= composition.report_seq
    if not composition.is_live and registry.is_live and is_latest:
        yield composition.mission_id


def _invented_hints(registry: HintFacts, composition: HintFacts | None) -> Iterator[str]:
    """Missions that composition never had; it deletes those that ended long ago."""
    if registry.is_live if composition is None else composition.drone_id != registry.drone_id:
        yield registry.mission_id


def _unknown(own: str, known: str | None) -> Iterator[str]:
    if known is None:
        yield own


def _unlike_copy(
    kind: str, *, is_later: bool
) -> Callable[[CopyFacts, CopyFacts | None], Iterator[str]]:
    """Finds copies of a kind with another value, or ahead of the second one, if it `is_later`.

    What only one service stores yet, or no longer, is no fault.
    """

    def find(one: CopyFacts, other: CopyFacts | None) -> Iterator[str]:
        if other is None or not one.key.startswith(kind):
            return
        ahead = one.number - other.number
        # The parts of a millisecond that are not stored may add up to another one.
        differs = ahead > 0 if is_later else abs(ahead) > 1
        # A network that is too large for one answer has no stations at the gateway.
        if differs or (ahead == 0 and one.text and other.text and one.text != other.text):
            yield one.key

    return find


_of_copies = partial(CrossRule[CopyFacts], facts=lambda facts: facts.copies)

COPY_RULES: Final = (
    _of_copies(
        "the gateway knows no later version of a network, and no other stations",
        _unlike_copy("network ", is_later=True),
        "Delete the row of `known_networks`: the gateway asks composition again.",
        first="gateway",
        second="composition",
    ),
    _of_copies(
        "a hold is of the customer whose offers it keeps",
        _unlike_copy("hold ", is_later=False),
        "Set `customer_id` of the row of `offer_holds` to that of the gateway's quote: else "
        "it counts among the holds of another customer.",
        first="gateway",
        second="composition",
    ),
    _of_copies(
        "composition plans with the promise that the gateway made",
        _unlike_copy("promise ", is_later=False),
        "The customer was notified of the gateway's promise. Set `missions.promised` in "
        "composition to it; with `planned_conditions` -1 the mission is planned again.",
        first="composition",
        second="gateway",
    ),
    _of_copies(
        "composition counts no later renewal of a drone's credentials than the registry",
        _unlike_copy("renewal ", is_later=True),
        "Set `drone_links.renewed_ms` to the registry's `renewals.renewed_ms`.",
        first="composition",
        second="registry",
    ),
)

DRONE_RULES: Final = (
    CrossRule(
        "a provider that has a key is registered",
        _unknown,
        "The provider's calls find nothing. Restore its row of `providers` from a backup of "
        "the registry, or delete its keys (DELETE /v1/keys/{id}).",
        first="gateway",
        second="registry",
        facts=lambda facts: facts.providers,
    ),
    CrossRule(
        "the drone of a live mission is registered",
        _unknown,
        "The drone was removed while it flies, so it cannot log in again. Restore its rows "
        "of `drones`, `presence` and `broker_accounts` from a backup of the registry.",
        first="composition",
        second="registry",
        facts=lambda facts: facts.drones,
    ),
    _of_hints(
        "the registry knows that a drone on a live mission is busy",
        _missing_hints,
        _SET_HINT,
    ),
    _of_hints(
        "the registry knows that a mission is over",
        _busy_for_ever,
        "The drone would be busy for ever. " + _SET_HINT,
    ),
    _of_hints(
        "the registry knows no mission that composition does not have",
        _invented_hints,
        "Delete the row of `mission_hints`, if composition has not lost the mission.",
        first="registry",
        second="composition",
    ),
)

#: All rules that no service can check alone.
ACROSS: Final[tuple[AnyCrossRule, ...]] = (*DELIVERY_RULES, *DRONE_RULES, *COPY_RULES)
