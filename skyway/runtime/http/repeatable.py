"""What a route needs so that its call may come again: the key that it came with, and the answer."""

from typing import Annotated

from fastapi import Header, Response

from skyway.runtime.idempotency.answer import Answer

#: The header `Idempotency-Key`, for a parameter of the name `idempotency_key`.
IdempotencyKey = Annotated[str | None, Header()]


def response_of(answer: Answer) -> Response:
    """The HTTP answer, the first time or again."""
    return Response(answer.body, answer.status, dict(answer.headers), "application/json")
