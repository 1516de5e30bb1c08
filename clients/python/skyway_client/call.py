"""One call of the API as a value: what is sent, and how its answer is read."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Generic, Self, TypeVar
from uuid import uuid4

import httpx

from skyway_client.errors import problem_of

AnswerT_co = TypeVar("AnswerT_co", covariant=True)

_IDEMPOTENCY_KEY = "idempotency-key"

#: Calls of these methods may be repeated: the second has no effect that the first had not.
_REPEATABLE = frozenset({"GET", "PUT", "DELETE"})


class UnexpectedAnswer(Exception):
    """The server answered with a status that the API does not document."""

    def __init__(self, response: httpx.Response) -> None:
        super().__init__(f"unexpected status {response.status_code}")
        self.response = response


@dataclass(frozen=True, slots=True, kw_only=True)
class Call(Generic[AnswerT_co]):
    """A call that `Skyway.send` or `AsyncSkyway.send` sends."""

    method: str
    path: str
    params: Mapping[str, Any]  # the values of a query
    headers: Mapping[str, Any]
    body: Any  # what JSON holds; None without a body
    takes_idempotency_key: bool
    read: Callable[[httpx.Response], AnswerT_co]

    def with_idempotency_key(self) -> Self:
        """The call with a new random key, if the operation takes one and the caller gave none."""
        if not self.takes_idempotency_key or self.headers.get(_IDEMPOTENCY_KEY):
            return self
        return replace(self, headers={**self.headers, _IDEMPOTENCY_KEY: str(uuid4())})

    @property
    def is_repeatable(self) -> bool:
        """Whether sending it twice does nothing twice."""
        return self.method in _REPEATABLE or _IDEMPOTENCY_KEY in self.headers

    def after(self, cursor: str) -> Self:
        """The call for the next page of a list."""
        return replace(self, params={**self.params, "cursor": cursor})

    def request_of(self, http: httpx.Client | httpx.AsyncClient) -> httpx.Request:
        """The request that carries the call."""
        headers = {name: str(value) for name, value in self.headers.items() if value is not None}
        return http.build_request(
            self.method, self.path, params=dict(self.params), headers=headers, json=self.body
        )

    def answer_of(self, response: httpx.Response) -> AnswerT_co:
        """The answer.

        Raises
        ------
        SkywayError
            The server refused the call: the subclass says why.
        UnexpectedAnswer
            The API does not document this status.
        """
        if response.is_error:
            raise problem_of(response)
        return self.read(response)
