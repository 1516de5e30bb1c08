"""The outcomes that a test delivery can be made to have: by its reference, or by a destination."""

from dataclasses import dataclass
from typing import Final, Literal

from skyway.delivery.request import DeliveryRequest
from skyway.errors import InvalidInput
from skyway.ids import TEST_PREFIX, StationId

OutcomeName = Literal[
    "delivered",
    "late",
    "undeliverable",
    "wrong_pin",
    "stranded",
    "refused",
    "withdrawn",
    "weather",
    "busy",
]


@dataclass(frozen=True, slots=True)
class Outcome:
    """An outcome, the station that forces it, and the state in which its delivery ends."""

    name: OutcomeName
    station_id: StationId
    station_name: str
    ends_as: str
    about: str

    @property
    def reference(self) -> str:
        """The reference that forces it."""
        return TEST_PREFIX + self.name


def _outcome(name: OutcomeName, station_name: str, ends_as: str, about: str) -> Outcome:
    station_id = StationId(station_name.lower().replace(" ", "-"))
    return Outcome(name, station_id, station_name, ends_as, about)


#: The page docs/sandbox.md has the same table.
OUTCOMES: Final = (
    _outcome("delivered", "Market Square", "COMPLETED", "The packages come as promised."),
    _outcome(
        "late",
        "Slow Street",
        "COMPLETED",
        "The packages come an hour late: `delivery.delayed`, and a refund in the statement.",
    ),
    _outcome(
        "undeliverable",
        "Empty House",
        "FAILED",
        "Nobody is at the destination: the packages come back to the pickup.",
    ),
    _outcome(
        "wrong_pin",
        "Keypad Corner",
        "FAILED",
        "Somebody types five wrong PINs at the drone, so packages that need a PIN come back.",
    ),
    _outcome(
        "stranded",
        "Lost Lagoon",
        "FAILED",
        "The drone has to land on the way: `package.stranded` says where the packages are.",
    ),
    _outcome(
        "refused",
        "Refusal Ridge",
        "COMPLETED",
        "The first drone refuses the mission. Another drone delivers.",
    ),
    _outcome(
        "withdrawn",
        "Withdrawal Wharf",
        "REJECTED",
        "The provider withdraws its drones after the booking, and no other drone is found.",
    ),
    _outcome(
        "weather",
        "Storm Point",
        "FAILED",
        "The weather ends the mission before the packages are loaded: they stay at the pickup.",
    ),
    _outcome(
        "busy",
        "Busy Bay",
        "REJECTED",
        "All drones stay busy. The delivery waits until its deadline, or for an hour of fleet time "
        "and at least a minute.",
    ),
)

_BY_REFERENCE: Final = {each.reference: each.name for each in OUTCOMES}
_BY_STATION: Final = {each.station_id: each.name for each in OUTCOMES}


def outcome_of(request: DeliveryRequest) -> OutcomeName:
    """The outcome that a request asks for: its reference counts first, then its destinations.

    Raises
    ------
    InvalidInput
        The reference looks like one of an outcome, and is none.
    """
    reference = request.reference or ""
    if reference.startswith(TEST_PREFIX) and reference not in _BY_REFERENCE:
        known = ", ".join(_BY_REFERENCE)
        raise InvalidInput(
            "reference", f"{reference!r} names no outcome of the sandbox, which has {known}"
        )
    forced = (_BY_STATION.get(each, "delivered") for each in request.destinations)
    by_station: OutcomeName = next((each for each in forced if each != "delivered"), "delivered")
    return _BY_REFERENCE.get(reference, by_station)
