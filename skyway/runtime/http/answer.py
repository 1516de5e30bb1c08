"""What another service's HTTP answer means here: a value, its problem, or "ask later"."""

import logging
from functools import lru_cache
from http import HTTPStatus
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from skyway.contracts.problem_details import ProblemDetails
from skyway.runtime.errors import RemoteProblem, ServiceUnavailable
from skyway.runtime.http.connections import Answer

log = logging.getLogger(__name__)

T = TypeVar("T")


def refuse_failure(service: str, response: Answer) -> None:
    """Raise what an answer other than 2xx means.

    Raises
    ------
    RemoteProblem
        The service refuses: the same request would be refused again.
    ServiceUnavailable
        It failed, or does not know us: the same request may succeed later.
    """
    if response.status == HTTPStatus.UNAUTHORIZED:
        raise not_known(service)
    if response.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        raise ServiceUnavailable(service, f"it answered {response.status}")
    if not HTTPStatus.OK <= response.status < HTTPStatus.MULTIPLE_CHOICES:
        raise RemoteProblem(response.status, _problem_in(response))


def not_known(service: str) -> ServiceUnavailable:
    """A 401 between services: no fault of our own caller, who therefore is not told 401."""
    log.error("secret refused", extra={"asked_service": service})
    return ServiceUnavailable(service, "it does not accept the secret shown to it")


def read_answer(service: str, answer: type[T], response: Answer) -> T:
    """The value that an answer holds; fields that this version does not know are ignored."""
    reader: TypeAdapter[T] = _reader(answer)  # type: ignore[arg-type]  # types are hashable
    try:
        return reader.validate_json(response.content, extra="ignore")
    except ValidationError as error:
        log.exception("answer unreadable", extra={"asked_service": service})
        raise ServiceUnavailable(service, "its answer cannot be read") from error


@lru_cache(maxsize=256)  # making one takes as long as reading a small answer
def _reader(answer: type[Any]) -> TypeAdapter[Any]:
    """Any: whatever type was asked for."""
    return TypeAdapter(answer)


def _problem_in(response: Answer) -> dict[str, Any]:  # problems have members of their own
    try:
        problem = ProblemDetails.model_validate_json(response.content)
    except ValidationError:
        problem = ProblemDetails(title=response.reason, status=response.status)
    return problem.model_dump(mode="json", exclude_none=True)
