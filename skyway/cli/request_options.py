"""The options that say what a customer requests, and the JSON of the delivery request they make."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import typer

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import fail
from skyway.cli.moments import ReadMoment, moment_reader
from skyway.json_text import json_value

CUSTOMER_KEY: Final = "SKYWAY_CUSTOMER_KEY"

PickupArgument = Annotated[
    str | None, typer.Argument(help="The pickup: a station, LAT,LON, a plus code or an address.")
]

PackageOption = Annotated[
    list[str] | None,
    typer.Option(
        "--package",
        "-p",
        metavar="PLACE=KG",
        help="The destination (a station, LAT,LON, a plus code or an address) and the mass of a "
        "package; repeat it for each package.",
    ),
]

FileOption = Annotated[
    Path | None, typer.Option(help="A delivery request as JSON, instead of the other options.")
]

#: `skyway.delivery.qos.Objective`, which would make the start of every command slow.
_ObjectiveName = Literal["FASTEST", "CHEAPEST", "GREENEST"]

ObjectiveOption = Annotated[_ObjectiveName, typer.Option(help="What makes an offer best.")]

#: `skyway.delivery.qos.Priority`, which would make the start of every command slow.
_PriorityName = Literal["STANDARD", "PRIORITY"]

PriorityOption = Annotated[
    _PriorityName,
    typer.Option(
        help="PRIORITY is planned first, at a price factor of the provider.",
    ),
]

#: `skyway.delivery.qos.PromiseLevel`, which would make the start of every command slow.
_PromiseName = Literal["P90", "P50"]

PromiseOption = Annotated[
    _PromiseName,
    typer.Option(
        help="Which arrival time is promised: nine of ten packages come by P90, half by P50.",
    ),
]

PoolingOption = Annotated[
    bool,
    typer.Option(
        "--pooling",
        help="Share the trip with packages of other customers, at a lower price. A request with "
        "windows flies alone.",
    ),
]

PoolingWaitOption = Annotated[
    float | None,
    typer.Option(
        "--pooling-wait-s",
        min=0.0,
        max=3600.0,
        metavar="SECONDS",
        help="With --pooling: begin so many seconds later, so that others can join.",
    ),
]

PickupWithinOption = Annotated[
    float | None,
    typer.Option(
        "--pickup-within-m",
        min=0.0,
        max=5000.0,
        metavar="METRES",
        help="With --pooling: hand the packages over at another station within so many metres, if "
        "they can share a trip from there.",
    ),
]

MayBeLaterOption = Annotated[
    float,
    typer.Option(
        "--may-be-later-s",
        min=0,
        max=14_400,
        metavar="SECONDS",
        help="By how much it may come later than first planned, so that the dispatcher can plan "
        "the whole fleet better.",
    ),
]

FirmWithinOption = Annotated[
    float,
    typer.Option(
        "--firm-within-s",
        min=0,
        max=3600,
        metavar="SECONDS",
        help="So many seconds after the booking the arrival time is promised. Until then the "
        "dispatcher may plan it at any time.",
    ),
]

MayChangeProviderOption = Annotated[
    bool,
    typer.Option(
        "--may-change-provider",
        help="Another provider may fly it, for the agreed price, while it waits for its drone.",
    ),
]

EarliestPickupOption = Annotated[
    str | None,
    typer.Option(metavar="MOMENT", help="Loading does not begin before."),
]

LatestPickupOption = Annotated[
    str | None,
    typer.Option(metavar="MOMENT", help="Loading is over by then."),
]

NotBeforeOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[PLACE=]MOMENT",
        help="The hand-over does not begin before; without PLACE at every destination.",
    ),
]

LatestOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[PLACE=]MOMENT",
        help="The hand-over is over by then; without PLACE at every destination.",
    ),
]

#: The field of each window option.
_FIELDS: Final = {
    "--earliest-pickup": "earliest_pickup_at",
    "--latest-pickup": "latest_pickup_at",
    "--not-before": "not_before_at",
    "--latest": "latest_at",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestOptions:
    """What the command line says about a delivery request."""

    pickup: str | None
    packages: Sequence[str]
    file: Path | None
    objective: str
    priority: str
    promise: str
    pooling: bool
    pooling_wait_s: float | None
    may_be_later_s: float
    firm_within_s: float
    may_change_provider: bool
    earliest_pickup: str | None
    latest_pickup: str | None
    not_before: Sequence[str]
    latest: Sequence[str]
    #: Not an option of `skyway quote`: a delivery with an offer joins no trip of others.
    pickup_within_m: float | None = None

    @property
    def fields(self) -> Mapping[str, str]:
        """The option of each field that an option has set, so that a message can name it."""
        return {} if self.file is not None else {field: opt for opt, field in _FIELDS.items()}

    @property
    def _windows(self) -> dict[str, Sequence[str]]:
        """The texts of each window option."""
        pickups = (self.earliest_pickup, self.latest_pickup)
        pickup_texts = ([] if text is None else [text] for text in pickups)
        return dict(zip(_FIELDS, (*pickup_texts, self.not_before, self.latest), strict=True))

    @property
    def _allowed(self) -> dict[str, Any]:
        """The members of `qos` that let the dispatcher plan the whole fleet better."""
        allowed: dict[str, Any] = {}
        if self.pooling:
            allowed |= {"pooling": True, "pooling_wait_s": self.pooling_wait_s or 0.0}
        if self.pickup_within_m:
            allowed["pickup_within_m"] = self.pickup_within_m
        if self.may_be_later_s:
            allowed["may_be_later_s"] = self.may_be_later_s
        if self.firm_within_s:
            allowed["firm_within_s"] = self.firm_within_s
        if self.may_change_provider:
            allowed["may_change_provider"] = True
        return allowed

    def document(self, folder: DataFolder) -> dict[str, Any]:
        """The JSON of the delivery request; the command ends with a message at a wrong option.

        The gateway of the folder says what the fleet time is, if an option counts from now.
        """
        if self.pooling_wait_s is not None and not self.pooling:
            fail("--pooling-wait-s needs --pooling")
        if self.pickup_within_m is not None and not self.pooling:
            fail("--pickup-within-m needs --pooling")
        if self.file is not None:
            given = [option for option, texts in self._windows.items() if texts]
            given += ["--pooling"] if self.pooling else []
            given += ["--may-be-later-s"] if self.may_be_later_s else []
            given += ["--firm-within-s"] if self.firm_within_s else []
            given += ["--may-change-provider"] if self.may_change_provider else []
            if self.pickup or self.packages or given:
                options = ", ".join(given) or "a pickup station or --package"
                fail(f"--file excludes {options}: write what you request into {self.file}")
            return _object(self.file)
        if not self.pickup or not self.packages:
            fail("give a pickup and at least one --package PLACE=KG, or --file")
        request: dict[str, Any] = {
            "pickup": _place(self.pickup),
            "packages": [_package(number, text) for number, text in enumerate(self.packages, 1)],
            "qos": {
                "objective": self.objective,
                "priority": self.priority,
                "promise": self.promise,
                **self._allowed,
            },
        }
        read_moment = moment_reader(folder, key_name=CUSTOMER_KEY)
        for option, texts in self._windows.items():
            for text in texts:
                _set_window(request, option, text, read_moment)
        return request


def _object(file: Path) -> dict[str, Any]:
    try:
        document = json_value(file.read_bytes())
    except ValueError as error:
        fail(f"--file {file}: {error}")
    if not isinstance(document, dict):
        fail(f"--file {file}: a delivery request is a JSON object")
    return document


def _package(number: int, text: str) -> dict[str, Any]:
    destination, equals, mass = text.rpartition("=")
    if not destination or not equals:
        fail(f"--package {text}: write --package PLACE=KG, such as --package mcqueeney=0.8")
    try:
        mass_kg = float(mass)
    except ValueError:
        fail(f"--package {text}: {mass!r} is not a mass in kg")
    return {"package_id": f"p{number}", "mass_kg": mass_kg, "destination": _place(destination)}


def _place(text: str) -> dict[str, Any]:
    """A place by the form of its text; what is no id, no numbers and no plus code is an address."""
    if re.fullmatch(r"[A-Za-z0-9_-]+", text):
        return {"station_id": text}
    if found := re.fullmatch(r"\s*(-?\d+\.?\d*)\s*,\s*(-?\d+\.?\d*)\s*", text):
        return {"location": {"latitude": float(found[1]), "longitude": float(found[2])}}
    is_plus_code = re.match(r"[2-9A-Za-z]{4,8}\+", text)
    return {"plus_code": text} if is_plus_code else {"address": text}


def _set_window(request: dict[str, Any], option: str, text: str, read_moment: ReadMoment) -> None:
    """Write one end of a window into the request, or into its packages."""
    field = _FIELDS[option]
    if option in ("--earliest-pickup", "--latest-pickup"):
        request[field] = read_moment(text, option)
        return
    station, equals, moment = text.rpartition("=")
    chosen = [
        package
        for package in request["packages"]
        if not equals or package["destination"] == _place(station)
    ]
    if not chosen:
        fail(f"{option} {text}: no --package goes to {station!r}")
    for package in chosen:
        package[field] = read_moment(moment, option)
