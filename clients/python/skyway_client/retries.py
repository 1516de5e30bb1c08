"""When a call is sent again, and after how long.

A refusal with 429 has done nothing, and a connection that cannot be made has sent nothing: such
calls are always repeated. After a lost answer, 500 or 503 only calls are repeated that may be sent
twice: `Call.is_repeatable`.
"""

from collections.abc import Callable
from typing import Any, Final

import httpx

from skyway_client.call import Call
from skyway_client.errors import SkywayError

#: A server that asks for a longer wait with Retry-After gets no other attempt, seconds.
_LONGEST_WAIT_S: Final = 60.0

_TOO_MANY: Final = 429

#: Refusals that may have passed when the call is sent again.
_MAY_PASS: Final = frozenset({_TOO_MANY, 500, 503})


def retry_rule(call: Call[Any]) -> Callable[[Exception], bool | float]:
    """Says for an error whether to send the call again, or after how many seconds."""

    def may_retry(error: Exception) -> bool | float:
        if isinstance(error, httpx.ConnectError | httpx.ConnectTimeout | httpx.PoolTimeout):
            return True
        if isinstance(error, httpx.TransportError):
            return call.is_repeatable
        if not isinstance(error, SkywayError) or error.status not in _MAY_PASS:
            return False
        if error.status != _TOO_MANY and not call.is_repeatable:
            return False
        if error.retry_after_s is None:
            return True
        return error.retry_after_s <= _LONGEST_WAIT_S and error.retry_after_s

    return may_retry
