"""From a validator's complaint to the field at fault, in the caller's own JSON."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from skyway.contracts.problem_details import FieldProblem

#: One bad body must not turn into a megabyte of answer.
MAX_FIELD_PROBLEMS = 50
_MAX_TEXT = 300


def field_problems(
    complaints: Sequence[Mapping[str, Any]],  # pydantic's error dicts, which have no public type
    body: object,
) -> tuple[FieldProblem, ...]:
    """The fields at fault, each once per complaint, in the validator's order."""
    problems = (
        FieldProblem(
            field=_field_name(complaint, body)[:_MAX_TEXT], detail=_sentence(complaint)[:_MAX_TEXT]
        )
        for complaint in complaints[:MAX_FIELD_PROBLEMS]
    )
    return tuple(dict.fromkeys(problems))


def _field_name(complaint: Mapping[str, Any], body: object) -> str:
    place, *path = complaint["loc"]
    if place != "body":
        return _printable(".".join(map(str, path)) or str(place))
    return _printable(".".join(map(str, _parts_of(body, path, complaint["type"]))) or "body")


def _parts_of(value: Any, path: Sequence[int | str], complaint_type: str) -> Iterator[int | str]:
    """Only the parts that name a member: a validator also names the arms of a union it tried."""
    for number, part in enumerate(path):
        if _holds(value, part):
            value = value[part]
        elif not (complaint_type == "missing" and number == len(path) - 1):
            continue
        yield part


def _holds(value: object, part: int | str) -> bool:
    if isinstance(value, dict):
        return part in value
    return isinstance(value, list) and isinstance(part, int) and part < len(value)


def _sentence(complaint: Mapping[str, Any]) -> str:
    message = _printable(str(complaint["msg"]))
    reason = complaint.get("ctx", {}).get("error")
    if complaint["type"] == "json_invalid" and reason:
        return f"{message}: {_printable(str(reason))}"
    return message.removeprefix("Value error, ").removeprefix("Assertion failed, ")


def _printable(text: str) -> str:
    """The text without the half surrogate pairs that no UTF-8 answer can hold."""
    return text.encode(errors="replace").decode()
