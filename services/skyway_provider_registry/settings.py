"""The settings that the registry reads from its environment."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator
from pydantic_settings import NoDecode

from skyway.cells import CellSettings
from skyway.errors import InvalidInput
from skyway.runtime.mqtt.address import BrokerAddress

BrokerKind = Literal["mosquitto", "nats"]


class RegistrySettings(CellSettings):
    """`CellSettings`, the broker's files, and how long telemetry is kept."""

    port: int = Field(
        default=8001,
        ge=0,
        le=65535,
        description="Port on which it listens. 0 takes any free port.",
    )
    broker_kind: BrokerKind = Field(
        default="mosquitto",
        description="For which broker it writes accounts; the embedded broker reads Mosquitto's. "
        "Credentials that were issued for one cannot log in at the other.",
    )
    broker_password_file: Path = Field(
        description="The broker's accounts. The registry alone writes this file."
    )
    broker_pid_file: Path | None = Field(
        default=None,
        description="Where Mosquitto writes its process id. It gets SIGHUP after each change of "
        "the accounts.",
    )
    drone_ca_dir: Path | None = Field(
        default=None,
        description="Folder of the authority that signs drones' certificates. Without it drones "
        "have none.",
    )
    mqtt_drone_url: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="`mqtts://HOST:PORT`: the broker's listener for drones, which each drone gets "
        "at its enrolment. For a cluster the addresses of all nodes, separated by commas.",
    )
    drones_per_provider: int = Field(
        default=20_000, ge=1, le=1_000_000, description="Drones of one provider."
    )
    telemetry_raw_hours: Annotated[
        float,
        Field(gt=0, le=87_600, description="Hours of wall time for which every sample is kept."),
    ] = 24.0
    telemetry_days: Annotated[
        float,
        Field(gt=0, le=3_650, description="Days of wall time for which minutes are kept."),
    ] = 30.0

    @field_validator("mqtt_drone_url", mode="before")
    @classmethod
    def _part(cls, value: object) -> object:
        """The parts of a text between its commas."""
        if isinstance(value, str):
            return tuple(part.strip() for part in value.split(",") if part.strip())
        return value

    @field_validator("mqtt_drone_url")
    @classmethod
    def _are_addresses(cls, urls: tuple[str, ...]) -> tuple[str, ...]:
        for url in urls:
            try:
                BrokerAddress.parse(url)
            except InvalidInput as error:
                raise ValueError("must look like mqtts://host:port,mqtts://other:port") from error
        return urls
