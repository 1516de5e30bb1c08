"""The errors of the library.

    SkywayError
    ├── InvalidInput            a value from outside breaks a named limit
    │   ├── InvalidStateOfCharge
    │   ├── InvalidNetwork
    │   └── InvalidProblem
    ├── PlanRejected            raised by `skyway.planner`: a plan breaks its problem's rules
    └── Unreachable...          raised by `skyway.runtime`, which draws its own branch

An expected outcome (no plan exists) is a value, never one of these.
"""


class SkywayError(Exception):
    """Anything Skyway itself reports; the message names the value and the limit."""


class InvalidInput(SkywayError):
    """A value from outside breaks a limit.

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


class InvalidStateOfCharge(InvalidInput):
    """A state of charge lies outside what the battery or its charge curve allows."""


class InvalidNetwork(InvalidInput):
    """A GeoJSON document or graph is not a skyway network."""


class InvalidProblem(InvalidInput):
    """A composition problem contradicts itself or its network."""
