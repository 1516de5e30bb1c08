"""The settings that a cloud service reads from its environment; each service adds its own."""

import ssl
from pathlib import Path
from typing import Self

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from skyway.complaints import fault_of, sentence_of
from skyway.runtime.errors import InvalidSettings


class DatabaseSettings(BaseSettings):
    """The settings of `migrate` and `verify`: the database of the service."""

    model_config = SettingsConfigDict(env_prefix="SKYWAY_", frozen=True, extra="ignore")

    # Not shown: it may hold a password.
    database_url: str = Field(
        repr=False,
        description="`sqlite:///FILE` or `postgresql://...`: the database of this service alone. "
        "With several servers, separated by commas, the primary is used. `?connections=8`: "
        "connections to write, and as many to read (1 to 64). `?pooling=transaction`: behind "
        "PgBouncer.",
    )

    @classmethod
    def load(cls) -> Self:
        """The settings of this process.

        Raises
        ------
        InvalidSettings
            Naming every variable that is missing or wrong, never its value.
        """
        try:
            return cls()
        except ValidationError as error:
            faults = "; ".join(
                f"SKYWAY_{fault_of(fault)[0].replace('.', '_').upper()}: {sentence_of(fault)}"
                for fault in error.errors(include_input=False, include_url=False)
            )
            raise InvalidSettings(faults) from None


class ArchiveSettings(DatabaseSettings):
    """What `archive` of a service needs: its database, and which day is today."""

    clock_file: Path | None = Field(
        default=None,
        description="The anchor of the fleet clock. Without it fleet time is wall time.",
    )


class ServiceSettings(ArchiveSettings):
    """Variables ``SKYWAY_...``: where things are. Secrets are files in `secrets_dir`."""

    # Not shown: it may hold a password.
    mqtt_url: str = Field(
        repr=False,
        description="`mqtt://HOST:PORT` or `mqtts://...`: the broker's listener for services. "
        "For a cluster the addresses of all nodes, separated by commas; with NATS each begins with "
        "`mqtt+nats://`.",
    )
    mqtt_ca_file: Path | None = Field(
        default=None,
        description="The authority that signed the broker's certificate (PEM). Without it the "
        "system's roots are trusted.",
    )
    secrets_dir: Path = Field(description="Folder with one file for each secret.")
    host: str = Field(default="127.0.0.1", description="Address on which the service listens.")
    port: int = Field(
        default=0, ge=0, le=65535, description="Port on which it listens. 0 takes any free port."
    )
    socket_fd: int | None = Field(
        default=None,
        description="A listening socket that the parent process passes. It replaces host and port.",
    )
    parent_fd: int | None = Field(
        default=None,
        description="A pipe to the parent process. The service ends when it closes.",
    )
    trusted_proxies: str = Field(
        default="",
        description="Addresses and networks, separated by commas, whose `X-Forwarded-For` is "
        "believed.",
    )
    http_connections: int = Field(
        default=4_000,
        ge=64,
        le=1_000_000,
        description="Open HTTP connections of the process. Its limit of open files may allow "
        "fewer. If there are more, the one that waits longest for its caller is closed.",
    )
    http_connections_per_address: int = Field(
        default=1_000,
        ge=8,
        le=1_000_000,
        description="Open HTTP connections of one address (IPv6: one /64), at most half of all.",
    )
    http_url_bytes: int = Field(
        default=8_192, ge=1_024, le=65_536, description="Bytes of a path with its query."
    )
    http_head_bytes: int = Field(
        default=32_768,
        ge=4_096,
        le=1_048_576,
        description="Bytes of all header lines of a request.",
    )
    http_head_s: float = Field(
        default=10.0,
        ge=0.1,
        le=600.0,
        description="Seconds of wall time within which a request's header lines must have come.",
    )
    http_body_s: float = Field(
        default=30.0,
        ge=0.1,
        le=600.0,
        description="Seconds of wall time within which a request's body must have come, and one "
        "more for each 64 KiB of it.",
    )
    log_level: str = Field(default="INFO", description="DEBUG, INFO, WARNING or ERROR.")
    otlp_endpoint: str | None = Field(
        default=None,
        description="Where spans go, such as `http://collector:4318/v1/traces` (OTLP over HTTP). "
        "Needs `pip install 'skyway[otlp]'`. Without it no spans are recorded.",
    )
    gateway_url: str = Field(
        default="http://127.0.0.1:8000", description="Where the other services find the gateway."
    )
    registry_url: str = Field(
        default="http://127.0.0.1:8001", description="Where the other services find the registry."
    )
    composition_url: str = Field(
        default="http://127.0.0.1:8002",
        description="Where the other services find composition.",
    )

    @property
    def mqtt_tls(self) -> ssl.SSLContext | None:
        """The trusted certificates of the broker's connection; None: the system's roots.

        Raises
        ------
        InvalidSettings
            There is no such file, or no certificate in it.
        """
        if self.mqtt_ca_file is None:
            return None
        try:
            return ssl.create_default_context(cafile=str(self.mqtt_ca_file))
        except OSError as error:  # ssl.SSLError is one
            fault = f"SKYWAY_MQTT_CA_FILE: {self.mqtt_ca_file} holds no certificate: {error}"
            raise InvalidSettings(fault) from error
