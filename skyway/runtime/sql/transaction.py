"""One transaction, as a write block sees it: statements, and messages that are sent after it."""

import time
from collections.abc import Awaitable, Callable, Collection, Sequence
from typing import Any, Literal, TypeVar

from sqlalchemy import Executable, Table
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import CursorResult
from sqlalchemy.exc import DBAPIError
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.contracts.message import Message
from skyway.contracts.topics import Address
from skyway.json_model import JsonModel
from skyway.runtime.errors import RowRefused
from skyway.runtime.sql.bulk_write import (
    BulkWrite,
    DerivedAddition,
    DerivedRows,
    Guard,
    Row,
    RowUpdates,
    run_one_by_one,
)
from skyway.runtime.sql.connection import BlockConnection
from skyway.runtime.sql.server_url import Dialect
from skyway.runtime.sql.single_statement import run_as_one
from skyway.runtime.sql.trouble import violated_constraint
from skyway.runtime.tracing import current_traceparent

MessageT = TypeVar("MessageT", bound=Message)


class Tx:
    """The transaction of a write block; it ends with the block.

    After an error in a statement the whole block is rolled back, even when the error is caught:
    PostgreSQL cannot go on then, so SQLite does not either.

    `add`, `update_rows`, `add_derived` and `only_if` write when the block ends, in one statement on
    PostgreSQL. Until then the block does not see their rows.
    """

    def __init__(
        self, connection: BlockConnection, *, dialect: Dialect, outbox: Table | None
    ) -> None:
        self.connection = connection
        self.dialect = dialect
        self._outbox = outbox
        self._bulk = BulkWrite()
        self._messages: list[Row] = []
        self._callbacks: list[Callable[[], None]] = []
        self._failure: Exception | None = None

    async def execute(
        self, statement: Executable, parameters: Row | Sequence[Row] | None = None
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run a statement; a list of parameters runs it once for each.

        Raises
        ------
        RowRefused
            A unique, exclusion or trigger rule refused a row.
        """
        return await self._named_error(self.connection.execute(statement, parameters))

    def insert(self, table: Table) -> postgresql.Insert:
        """An INSERT that knows ON CONFLICT, which both dialects spell the same."""
        if self.dialect == "postgresql":
            return postgresql.insert(table)
        # The two classes share the methods that are used: on_conflict_do_nothing and _do_update.
        return sqlite.insert(table)  # type: ignore[return-value]

    def only_if(
        self,
        guard: ReturningUpdate[*tuple[Any, ...]],  # Any: the column may have every type
        values: Row,
        *,
        otherwise: Exception,
    ) -> None:
        """Run this UPDATE before the other writes; if it finds no row, raise `otherwise` instead.

        None of the other writes happens then.
        """
        if self._bulk.guard is not None:
            raise RuntimeError("a block depends on one row")
        self._bulk.guard = Guard(guard, values, otherwise)

    def update_rows(
        self,
        table: Table,
        where: Row,
        rows: Sequence[Row],
        *,
        key: str,
        increments: Sequence[str] = (),
    ) -> None:
        """Change rows, each found by its `key` among the rows with the values of `where`.

        The rows have the same columns. The values of `increments` are added to the present ones.
        """
        if rows:
            self._bulk.updates.append(RowUpdates(table, where, rows, key, tuple(increments)))

    def add(self, table: Table, rows: Sequence[Row]) -> None:
        """Insert rows. An error that refuses a row is raised at the end of the block.

        The rows of one table have the same columns. Add to a table before adding to the tables that
        refer to it.
        """
        if rows:
            self._bulk.added.setdefault(table, []).extend(rows)

    def add_derived(
        self,
        derived: DerivedRows,
        values: Row,
        *,
        on_added: Callable[[], None] | None = None,
    ) -> None:
        """Insert rows that are derived from rows of this block.

        `on_added` is called after the commit if there were any.
        """
        self._bulk.derived.append(DerivedAddition(derived, values, on_added))

    def send(
        self,
        address: Address[MessageT],
        message: MessageT,
        *,
        confirmed_by: Literal["receiver", "broker"],
        stream: str,
    ) -> None:
        """Publish a message after this block is committed, and after earlier messages of `stream`.

        `receiver`: repeated until `outbox.confirm`; `broker`: until the broker has acknowledged it.
        """
        if message.traceparent is None:
            message = message.model_copy(update={"traceparent": current_traceparent()})
        self._store_message(
            channel="mqtt",
            address=address.name,
            stream=stream,
            confirmed_by=confirmed_by,
            message_id=message.message_id,
            mqtt_qos=address.topic.mqtt_qos,
            is_retained=address.topic.retained,
            payload=message.model_dump_json().encode(),
        )

    def report(self, service: str, path: str, body: JsonModel, *, stream: str) -> None:
        """POST a body to a service after this block is committed, until it answers 2xx."""
        self._store_message(
            channel=service,
            address=path,
            stream=stream,
            confirmed_by="answer",
            message_id=None,
            mqtt_qos=0,
            is_retained=False,
            payload=body.model_dump_json().encode(),
        )

    def withdraw(self, message_ids: Collection[str]) -> None:
        """Leave out messages that this block was to send."""
        kept = [row for row in self._messages if row["message_id"] not in message_ids]
        self._messages = kept

    def after_commit(self, callback: Callable[[], None]) -> None:
        """Call this once the block is on disk; never when it is rolled back."""
        self._callbacks.append(callback)

    def outbox_table(self) -> Table:
        """The table of messages that are sent after this transaction."""
        if self._outbox is None:
            raise RuntimeError("this database was opened without an outbox")
        return self._outbox

    async def finish(self) -> frozenset[str]:
        """Write the bulk and the messages right before the COMMIT; the channels of the messages."""
        if self._failure is not None:
            raise self._failure
        if self._messages:
            self.add(self.outbox_table(), self._messages)
        if self._bulk:
            await self._write_bulk()
        return frozenset(row["channel"] for row in self._messages)

    def committed(self) -> None:
        """Call what waited for the COMMIT."""
        for callback in self._callbacks:
            callback()

    async def _write_bulk(self) -> None:
        if self.dialect == "postgresql":
            last = self.connection.execute_last
            added = await run_as_one(self._bulk, lambda *what: self._named_error(last(*what)))
        else:
            added = await run_one_by_one(self._bulk, self.execute)
        self._callbacks += [each.on_added for each in added if each.on_added is not None]

    async def _named_error(
        self, running: Awaitable[CursorResult[*tuple[Any, ...]]]
    ) -> CursorResult[*tuple[Any, ...]]:
        """The result of a statement. If a rule refused a row, the error names the rule."""
        try:
            return await running
        except DBAPIError as error:
            self._failure = error
            # On PostgreSQL the transaction is already unable to answer; on SQLite it still can.
            constraint = await violated_constraint(self.connection, error, dialect=self.dialect)
            if constraint is None:
                raise
            self._failure = RowRefused(constraint)
            raise self._failure from error

    def _store_message(self, **row: object) -> None:
        self.outbox_table()
        self._messages.append(
            {
                **row,
                "traceparent": current_traceparent(),
                "stored_wall_ms": time.time_ns() // 1_000_000,
            }
        )
