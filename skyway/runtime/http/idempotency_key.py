"""The Idempotency-Key header of a route, and the HTTP answer of a call that may be repeated."""

from typing import Annotated

from fastapi import Header, Response

from skyway.runtime.idempotency.once import Answer

#: The header `Idempotency-Key`, for a parameter of the name `idempotency_key`.
IdempotencyKey = Annotated[str | None, Header()]


def response_of(answer: Answer) -> Response:
    """The HTTP answer, the first time or again."""
    return Response(answer.body, answer.status, dict(answer.headers), "application/json")
