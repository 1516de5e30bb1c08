"""The errors of the library.

    SkywayError
    ├── InvalidInput            a value from a caller breaks a named limit
    │   ├── InvalidStateOfCharge
    │   ├── InvalidNetwork
    │   └── InvalidProblem
    ├── PlanRejected            raised by `skyway.planner`: a plan breaks its problem's rules
    └── Unreachable...          raised by `skyway.runtime`, which draws its own branch

An expected outcome (no plan exists) is a value, never an error.
"""

from typing import NamedTuple


class SkywayError(Exception):
    """Anything Skyway itself reports; the message names the value and the limit."""


class FieldFault(NamedTuple):
    """A field at fault, by its path, and what is wrong with it as one sentence."""

    field: str
    detail: str

    def __str__(self) -> str:
        return f"{self.field}: {self.detail}"


class InvalidInput(SkywayError):
    """A value from a caller breaks a limit.

    Parameters
    ----------
    field
        Path of the field at fault, in the caller's own JSON: ``packages.0.mass_kg``.
    detail
        The value and the limit, as one sentence.
    """

    def __init__(self, field: str, detail: str) -> None:
        super().__init__(f"{field}: {detail}")
        self.field = field
        self.detail = detail
        self.faults: tuple[FieldFault, ...] = (FieldFault(field, detail),)


class InvalidStateOfCharge(InvalidInput):
    """A state of charge lies outside what the battery or its charge curve allows."""


class InvalidNetwork(InvalidInput):
    """A GeoJSON document or graph is not a skyway network."""


class InvalidProblem(InvalidInput):
    """A composition problem breaks limits, or contradicts itself or its network.

    `faults` holds all faults; `field` and `detail` are those of the first.
    """

    def __init__(self, field: str, detail: str, *others: FieldFault) -> None:
        super().__init__(field, detail)
        self.faults = (FieldFault(field, detail), *others)
        self.args = ("; ".join(map(str, self.faults)),)
