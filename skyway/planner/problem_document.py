"""Reads a problem from JSON, and names every fault in it."""

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, TypeVar

from pydantic import ValidationError

from skyway.complaints import sentence_of
from skyway.errors import FieldFault, InvalidNetwork, InvalidProblem
from skyway.json_model import JsonModel
from skyway.network.fields import shown
from skyway.network.network import Network
from skyway.planner.problem import MAX_FAULTS, Problem, network_of

_UNKNOWN = "is not a known field"
#: Characters of a field's name in a message.
_MAX_NAME = 100


def read_problem(document: Any) -> Problem:  # any JSON value, as json.loads gives it
    """The problem that a JSON document describes; its `network` may also be a `Network`.

    Raises
    ------
    InvalidProblem
        With all faults of the document, the first `MAX_FAULTS` of them.
    """
    return read_with_network(Problem, document)


_Document = TypeVar("_Document", bound=JsonModel)


def read_with_network(model: type[_Document], document: Any) -> _Document:  # any JSON value
    """The value of this model that a JSON document describes; it has a field `network`.

    Raises
    ------
    InvalidProblem
        With all faults of the document, the first `MAX_FAULTS` of them.
    """
    if not isinstance(document, Mapping):
        raise InvalidProblem("problem", f"{shown(document)} is not an object")
    unknown = (name for name in document if name not in model.model_fields)
    faults = [FieldFault(_field([name]), _UNKNOWN) for name in islice(unknown, MAX_FAULTS)]
    fields = {name: document[name] for name in model.model_fields if name in document}
    is_network_bad = False
    try:
        if "network" in fields:
            fields["network"] = network_of(fields["network"])
    except InvalidNetwork as error:
        faults.append(FieldFault(_field([error.field]), error.detail))
        fields["network"] = Network({}, ())
        is_network_bad = True
    try:
        problem = model.model_validate(fields)
    except ValidationError as error:
        complaints = error.errors(include_url=False)
        faults.extend(_fault(complaint) for complaint in complaints[:MAX_FAULTS])
    except InvalidProblem as error:
        if not is_network_bad:
            faults.extend(error.faults)
    if faults:
        raise InvalidProblem(*faults[0], *faults[1:MAX_FAULTS])
    return problem


def _fault(
    complaint: Mapping[str, Any],
) -> FieldFault:  # pydantic's error, which has no public type
    path = list(complaint["loc"])
    if path[0] == "closures" and len(path) > 2:
        del path[2]  # the arm of the union that was tried
    field = _field(path)
    value, message = complaint["input"], sentence_of(complaint)
    is_scalar = value is None or isinstance(value, bool | int | float | str)
    is_shown = is_scalar and complaint["type"] not in ("missing", "extra_forbidden")
    return FieldFault(field, f"{message}, not {shown(value)}" if is_shown else message)


def _field(path: Sequence[int | str]) -> str:
    """The path as text on one line, even if field names hold line breaks."""
    name = ".".join(map(str, path)) or "problem"
    name = name if name.isprintable() else ascii(name)[1:-1]
    return name if len(name) <= _MAX_NAME else f"{name[:_MAX_NAME]}..."
