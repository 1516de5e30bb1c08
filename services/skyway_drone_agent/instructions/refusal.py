"""A refusal: why the drone does not do what an instruction says."""

from dataclasses import dataclass, field
from typing import Any

from skyway.contracts.drone_report import RefusalCode


@dataclass(frozen=True, slots=True)
class Refusal:
    """A code of the contract, the same as a sentence, and the numbers behind it."""

    code: RefusalCode
    detail: str
    data: dict[str, Any] = field(default_factory=dict)  # whatever the code needs
