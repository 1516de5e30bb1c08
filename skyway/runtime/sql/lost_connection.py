"""A connection to the database that is lost, told in our own words."""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy.exc import DBAPIError

from skyway.runtime.errors import ServiceUnavailable


@contextmanager
def loss_told() -> Iterator[None]:
    """Let a block use a connection.

    Raises
    ------
    ServiceUnavailable
        It was lost meanwhile.
    """
    try:
        yield
    except DBAPIError as error:
        if not error.connection_invalidated:
            raise
        raise ServiceUnavailable("database", "the connection was lost") from error
