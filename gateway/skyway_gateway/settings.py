"""The settings that the gateway reads from its environment."""

import os
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from pathlib import Path
from socket import socket
from typing import Annotated, Final

from pydantic import AnyHttpUrl, Field, ValidationInfo, field_validator
from pydantic_settings import NoDecode

from skyway.cells import CellSettings
from skyway.contracts.candidate import MOST_QUERIES
from skyway.ids import NetworkId

#: Where the address stands in the URL of a geocoder.
ADDRESS: Final = "{address}"


class GatewaySettings(CellSettings):
    """The settings of the gateway."""

    port: int = Field(
        default=8000,
        ge=0,
        le=65535,
        description="Port on which it listens. 0 takes any free port.",
    )
    webhook_allow_networks: Annotated[
        tuple[IPv4Network | IPv6Network, ...],
        NoDecode,
        Field(
            description="Networks like `127.0.0.0/8`, separated by commas, into which webhooks may "
            "point beside the public Internet."
        ),
    ] = ()
    public_url: AnyHttpUrl | None = Field(
        default=None,
        validate_default=True,
        description="How people reach the gateway, as links to tracking pages and to the console "
        "begin. Without it they begin with the address on which the gateway listens, which has to "
        "be a loopback address.",
    )
    small_world_file: Path | None = Field(
        default=None,
        description="A file that the gateway makes when an operator asks for the small world. "
        "`skyway up` sets it and waits for the file; elsewhere there is no small world.",
    )
    console_map: Path | None = Field(
        default=None,
        description="A folder with the console's base map: `style.json`, a MapLibre style, and the "
        "files that it names, such as PMTiles; `skyway console base-map` makes one. Without it the "
        "console draws the map of the world that comes with Skyway.",
    )
    bookings_at_once: int = Field(
        default=8, ge=1, le=MOST_QUERIES, description="Deliveries that are booked at the same time."
    )
    geocoder_url: str | None = Field(
        default=None,
        description="The URL of a geocoder that answers GeoJSON, with `{address}` where the "
        "address stands: `https://photon.example/api?limit=5&q={address}` (Photon), "
        "`https://pelias.example/v1/search?text={address}` (Pelias) or "
        "`https://nominatim.example/search?format=geojson&q={address}` (Nominatim). Without it the "
        "embedded geocoder knows names of stations and towns, and no streets.",
    )
    booking_horizon_h: float = Field(
        default=24.0,
        ge=0.1,
        le=720.0,
        description="Hours of fleet time. A request whose `earliest_pickup_at` is further ahead "
        "waits as SCHEDULED and holds nothing.",
    )
    closed_networks: Annotated[
        frozenset[NetworkId],
        NoDecode,
        Field(
            description="Networks, separated by commas, that accept nothing new, so that their "
            "missions come to an end. Waiting deliveries stay in the queue."
        ),
    ] = frozenset()

    delivery_days: float | None = Field(
        default=None,
        ge=2.0,
        le=36_500.0,
        description="Days of fleet time for which a delivery is kept after its end, and at least "
        "25 hours of wall time. Without it deliveries are kept for ever.",
    )
    personal_data_days: float = Field(
        default=30.0,
        ge=0.0,
        le=36_500.0,
        description="Days of fleet time after a delivery's end until its personal data is erased. "
        "A change holds for what customers write from then on.",
    )
    proof_store: str | None = Field(
        default=None,
        pattern=r"^(file:///|s3://[^/])",
        description="Where photos of hand-overs are kept: `file:///folder`, which all replicas "
        "share, or `s3://bucket/prefix`, whose keys are read from variables such as "
        "`AWS_ACCESS_KEY_ID` and `AWS_ENDPOINT_URL`. Without it no package may ask for a PHOTO.",
    )
    proof_days: float = Field(
        default=30.0,
        ge=0.0,
        le=36_500.0,
        description="Days of fleet time until the photo or the signature of a hand-over is erased.",
    )
    audit_days: float | None = Field(
        default=None,
        ge=1.0,
        le=36_500.0,
        description="Days of wall time for which entries of the audit log are kept. Without it for "
        "ever.",
    )
    webhook_attempt_days: float | None = Field(
        default=None,
        ge=1.0,
        le=36_500.0,
        description="Days of wall time for which attempts to notify webhooks are kept. Without it "
        "for ever.",
    )

    hold_s: float = Field(
        default=120.0,
        ge=1.0,
        le=600.0,
        description="Seconds of wall time for which the offers of a quote with `hold` are held.",
    )
    held_quotes_per_customer: int = Field(
        default=3,
        ge=0,
        le=1000,
        description="Quotes with `hold` that one customer may hold at the same time. 0 holds none.",
    )

    requests_per_s: float = Field(
        default=100.0,
        ge=1.0,
        le=100_000.0,
        description="Requests a second that each tenant (customer, provider, operator or drone) "
        "may send for ever.",
    )
    requests_burst: int = Field(
        default=500,
        ge=10,
        le=1_000_000,
        description="Requests that a tenant may send together after a pause.",
    )
    refusals_per_s: float = Field(
        default=20.0,
        ge=1.0,
        le=100_000.0,
        description="Refused requests a second (400, 403, 404, 405, 413, 415, 422) that each "
        "customer, provider or drone may send for ever.",
    )
    refusals_burst: int = Field(
        default=1_000,
        ge=10,
        le=1_000_000,
        description="Refused requests that a customer, provider or drone may send together after "
        "a pause. Then it may send no other request either until some of them are forgotten.",
    )
    address_requests_per_s: float = Field(
        default=200.0,
        ge=1.0,
        le=100_000.0,
        description="Requests a second without a known key from one address (IPv6: one /64). A "
        "refused one, and one for a page of documentation, counts as ten.",
    )
    address_requests_burst: int = Field(
        default=10_000,
        ge=10,
        le=1_000_000,
        description="Requests without a known key that one address may send together.",
    )

    live_deliveries_per_customer: int = Field(
        default=20_000,
        ge=1,
        le=10_000_000,
        description="Deliveries of one customer that are not over.",
    )
    scheduled_deliveries_per_customer: int = Field(
        default=5_000,
        ge=0,
        le=10_000_000,
        description="Of these, SCHEDULED ones: their pickup is beyond the booking horizon.",
    )
    webhooks_per_customer: int = Field(
        default=50, ge=1, le=10_000, description="Webhooks of one customer."
    )
    webhook_slots: int = Field(
        default=256,
        ge=8,
        le=10_000,
        description="Webhooks that are notified at the same time. Those that did not answer the "
        "last time have three eighths of the slots.",
    )
    webhook_slots_per_customer: int = Field(
        default=32,
        ge=1,
        le=10_000,
        description="Of these slots, those of one customer. One host and port has half as many.",
    )
    composition_stations: int = Field(
        default=2_000,
        ge=10,
        le=250_000,
        description="Stations of a network that a customer or provider may send to "
        "`POST /v1/compositions`: its body has 256 KiB, and 1 KiB for each of them.",
    )
    quotes_at_once: int = Field(
        default=3,
        ge=1,
        le=1_000,
        description="Quotes that are planned at the same time, at most two of one tenant. Tenants "
        "that wait take turns.",
    )
    compositions_at_once: int = Field(
        default=2,
        ge=1,
        le=1_000,
        description="Problems of `POST /v1/compositions` that are planned at the same time, at "
        "most one of one tenant. Tenants that wait take turns.",
    )
    reports_at_once: int = Field(
        default=4,
        ge=1,
        le=1_000,
        description="Reports that are read at the same time, at most two of one tenant: "
        "statistics, earnings, schedules, past plans and closures, telemetry and whole networks. "
        "Tenants that wait take turns.",
    )
    plans_waiting_per_tenant: int = Field(
        default=100,
        ge=1,
        le=10_000,
        description="Quotes of one tenant that may wait for their turn, as many compositions, and "
        "as many reports.",
    )
    keys_per_subject: int = Field(
        default=100,
        ge=1,
        le=10_000,
        description="API keys in use of one customer, provider or operator.",
    )
    streams_per_tenant: int = Field(
        default=200,
        ge=1,
        le=100_000,
        description="Event streams that a tenant may have open at each replica of the gateway.",
    )
    live_views_per_tenant: int = Field(
        default=16,
        ge=1,
        le=10_000,
        description="Different parts of the live picture (`kinds` and `bbox`) that a customer or "
        "provider may follow together at each replica of the gateway.",
    )

    @field_validator("public_url")
    @classmethod
    def _begin_links(cls, value: AnyHttpUrl | None, info: ValidationInfo) -> AnyHttpUrl:
        if value is not None:
            return value
        host, port = info.data.get("host", ""), info.data.get("port", 0)
        if (socket_fd := info.data.get("socket_fd")) is not None:
            with socket(fileno=os.dup(socket_fd)) as passed:
                host, port = passed.getsockname()[:2]
        shown = f"[{host}]" if ":" in host else host
        # Links that follow the Host header of a request can be made to lead anywhere.
        if port == 0 or not (host == "localhost" or _is_loopback(host)):
            raise ValueError(
                f"is needed where the gateway listens on {shown}:{port}: say how people reach it, "
                "such as https://skyway.example.org"
            )
        return AnyHttpUrl(f"http://{shown}:{port}")

    @field_validator("geocoder_url")
    @classmethod
    def _has_room_for_address(cls, value: str | None) -> str | None:
        if value is None or (value.startswith(("http://", "https://")) and ADDRESS in value):
            return value or None
        raise ValueError(f"must begin with http:// or https:// and hold {ADDRESS}")

    @field_validator("closed_networks", mode="before")
    @classmethod
    def _read_names(cls, value: object) -> object:
        if isinstance(value, str):
            return frozenset(part.strip() for part in value.split(",") if part.strip())
        return value

    @field_validator("webhook_allow_networks", mode="before")
    @classmethod
    def _read_networks(cls, value: object) -> object:
        if isinstance(value, str):
            return tuple(ip_network(part.strip()) for part in value.split(",") if part.strip())
        return value


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False
