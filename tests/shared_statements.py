"""The compiled statements that all engines of one test process share.

A service compiles each statement once in its life. A test has an engine of its own, and would
compile all its statements anew: a third of the time of the tests that use a database.
"""

from collections.abc import Hashable
from typing import Any

from sqlalchemy import Compiled, Engine, event
from sqlalchemy.engine import Connection


class SharedStatements(dict[Hashable, Compiled]):
    """Compiled statements by dialect and statement, for SQLAlchemy's option `compiled_cache`.

    SQLAlchemy's keys begin with the dialect object, and each engine has its own. All our engines
    of one database are made in the same way, so the class of the dialect replaces the object.
    """

    def get(self, key: Any, default: Any = None) -> Any:
        """The compiled statement with this key."""
        return super().get(_shared(key), default)

    def __setitem__(self, key: Any, compiled: Compiled) -> None:
        super().__setitem__(_shared(key), compiled)


def share_statements() -> None:
    """Let all engines of this process use the same compiled statements from now on."""
    statements = SharedStatements()

    def use(connection: Connection) -> None:
        connection.execution_options(compiled_cache=statements)

    event.listen(Engine, "engine_connect", use)


def _shared(key: tuple[Any, ...]) -> tuple[Any, ...]:
    dialect, *rest = key
    return (type(dialect), *rest)
