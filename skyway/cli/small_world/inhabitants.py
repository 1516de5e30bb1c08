"""Who lives in the small world; a file in the data folder keeps them, so a restart goes on."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from skyway.broker_setup.private_file import write_private
from skyway.cli.demo.fleets import RegisteredFleet


@dataclass(slots=True)
class Inhabitants:
    """The fleets and the customers' keys that are registered so far, by their names."""

    file: Path
    fleets: dict[str, RegisteredFleet] = field(default_factory=dict)
    customer_keys: dict[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Inhabitants":
        """Those in the file; nobody without a file."""
        if not file.exists():
            return cls(file)
        kept: dict[str, Any] = json.loads(file.read_text())
        fleets = {name: RegisteredFleet(**fleet) for name, fleet in kept["fleets"].items()}
        return cls(file, fleets, kept["customer_keys"])

    def keep(self) -> None:
        """Write them into the file; only this user can read it."""
        fleets = {name: asdict(fleet) for name, fleet in self.fleets.items()}
        write_private(
            self.file, json.dumps({"fleets": fleets, "customer_keys": self.customer_keys})
        )

    @property
    def drones(self) -> list[dict[str, Any]]:
        """All drones with their credentials, as JSON."""
        return [drone for fleet in self.fleets.values() for drone in fleet.drones]
