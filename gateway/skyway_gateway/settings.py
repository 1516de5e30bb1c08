"""What the gateway reads from its environment."""

from ipaddress import IPv4Network, IPv6Network, ip_network
from typing import Annotated

from pydantic import Field, field_validator
from pydantic_settings import NoDecode

from skyway.runtime.settings import ServiceSettings


class GatewaySettings(ServiceSettings):
    """`ServiceSettings`, and where webhooks may point to beside the public Internet."""

    port: int = 8000
    #: Networks like 127.0.0.0/8, separated by commas: webhooks may point into them.
    webhook_allow_networks: Annotated[tuple[IPv4Network | IPv6Network, ...], NoDecode] = ()
    #: Deliveries that are booked at the same time.
    bookings_at_once: int = Field(default=8, ge=1, le=64)

    @field_validator("webhook_allow_networks", mode="before")
    @classmethod
    def _read_networks(cls, value: object) -> object:
        if isinstance(value, str):
            return tuple(ip_network(part.strip()) for part in value.split(",") if part.strip())
        return value
