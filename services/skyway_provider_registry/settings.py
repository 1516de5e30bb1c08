"""What the registry reads from its environment."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from skyway.runtime.settings import ServiceSettings


class RegistrySettings(ServiceSettings):
    """`ServiceSettings`, and where the broker looks for its accounts."""

    port: int = 8001
    #: The broker's accounts, written by this service alone.
    broker_password_file: Path
    #: Where the broker writes its process id; it gets SIGHUP when the accounts have changed.
    broker_pid_file: Path | None = None
    #: The folder of the authority that signs drones' certificates; without it they have none.
    drone_ca_dir: Path | None = None
    #: Wall hours for which every sample of telemetry is kept, and days for which minutes are.
    telemetry_raw_hours: Annotated[float, Field(gt=0, le=87_600)] = 24.0
    telemetry_days: Annotated[float, Field(gt=0, le=3_650)] = 30.0
