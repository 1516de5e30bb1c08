"""What a cloud service reads from its environment; each service adds its own fields."""

from pathlib import Path
from typing import Self

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from skyway.runtime.errors import InvalidSettings


class DatabaseSettings(BaseSettings):
    """What `migrate` and `verify` of a service need: its database, and nothing else."""

    model_config = SettingsConfigDict(env_prefix="SKYWAY_", frozen=True, extra="ignore")

    # Not shown: it may hold a password.
    database_url: str = Field(repr=False)

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
                f"SKYWAY_{'_'.join(str(part) for part in fault['loc']).upper()}: {fault['msg']}"
                for fault in error.errors(include_input=False, include_url=False)
            )
            raise InvalidSettings(faults) from None


class ServiceSettings(DatabaseSettings):
    """Variables ``SKYWAY_...``: where things are. Secrets are files in `secrets_dir`."""

    # Not shown: it may hold a password.
    mqtt_url: str = Field(repr=False)
    secrets_dir: Path
    clock_file: Path | None = None
    host: str = "127.0.0.1"
    #: 0 takes any free port.
    port: int = Field(default=0, ge=0, le=65535)
    #: A listening socket passed by the parent; it wins over host and port.
    socket_fd: int | None = None
    #: A pipe to the parent: when it closes, the service leaves.
    parent_fd: int | None = None
    log_level: str = "INFO"
    gateway_url: str = "http://127.0.0.1:8000"
    registry_url: str = "http://127.0.0.1:8001"
    composition_url: str = "http://127.0.0.1:8002"
