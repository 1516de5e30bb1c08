"""The rules of drones, providers, and single values that two services store."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final

from skyway_verifier.across.deliveries import DELIVERY_RULES
from skyway_verifier.cross_rule import AnyCrossRule, CrossRule
from skyway_verifier.facts import CopyFacts, HintFacts

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
