"""One transaction, as a write block sees it: statements, and messages that leave with them."""

from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Literal, TypeVar

from sqlalchemy import Executable, Table
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.engine import CursorResult
from sqlalchemy.exc import DBAPIError
from sqlalchemy.sql.dml import ReturningUpdate

from skyway.contracts.message import Message
from skyway.contracts.topic import Address
from skyway.json_model import JsonModel
from skyway.runtime.errors import Taken
from skyway.runtime.sql.at_once import write_at_once
from skyway.runtime.sql.connection import BlockConnection
from skyway.runtime.sql.constraints import taken_constraint
from skyway.runtime.sql.declared import Change, Consequence, Declared, Following, Guard, Row
from skyway.runtime.sql.engines import Dialect
from skyway.runtime.sql.in_turn import write_in_turn
from skyway.runtime.tracing import current_traceparent

MessageT = TypeVar("MessageT", bound=Message)


class Tx:
    """What `Database.write` lends to a block; it ends with the block.

    After an error in a statement the whole block is rolled back, even when the error is caught:
    PostgreSQL could not go on, so SQLite does not either.
    """

    def __init__(
        self, connection: BlockConnection, *, dialect: Dialect, outbox: Table | None
    ) -> None:
        self.connection = connection
        self.dialect = dialect
        self._outbox = outbox
        self._declared = Declared()
        self._leaving: list[Row] = []
        self._callbacks: list[Callable[[], None]] = []
        self._failure: Exception | None = None

    async def execute(
        self, statement: Executable, parameters: Row | Sequence[Row] | None = None
    ) -> CursorResult[*tuple[Any, ...]]:
        """Run a statement; a list of parameters runs it once for each.

        Raises
        ------
        Taken
            A unique, exclusion or trigger rule refused a row.
        """
        return await self._told(self.connection.execute(statement, parameters))

    def insert(self, table: Table) -> postgresql.Insert:
        """An INSERT that knows ON CONFLICT, which both dialects spell the same."""
        if self.dialect == "postgresql":
            return postgresql.insert(table)
        # The two classes share the methods that are used: on_conflict_do_nothing and _do_update.
        return sqlite.insert(table)  # type: ignore[return-value]

    def only_if(
        self,
        guard: ReturningUpdate[*tuple[Any, ...]],  # whatever column it returns
        values: Row,
        *,
        otherwise: Exception,
    ) -> None:
        """Run this UPDATE when the block ends, and raise `otherwise` where it finds no row.

        It comes before all else that is declared, which is then not written either.
        """
        if self._declared.guard is not None:
            raise RuntimeError("a block depends on one row")
        self._declared.guard = Guard(guard, values, otherwise)

    def change(
        self,
        table: Table,
        this: Row,
        rows: Sequence[Row],
        *,
        key: str,
        counted: Sequence[str] = (),
    ) -> None:
        """Change rows when the block ends, each found by its `key` among those of `this`.

        They have the same columns; to those that are `counted` their values are added.
        """
        if rows:
            self._declared.changes.append(Change(table, this, rows, key, tuple(counted)))

    def add(self, table: Table, rows: Sequence[Row]) -> None:
        """Insert rows when the block ends, all at once; until then the block does not see them.

        Rows of one table have the same columns; a table comes before those that refer to it. What
        refuses a row is raised at the end of the block.
        """
        if rows:
            self._declared.added.setdefault(table, []).extend(rows)

    def follow_up(
        self, consequence: Consequence, values: Row, *, then: Callable[[], None] | None = None
    ) -> None:
        """Insert what follows from what is added or changed; `then` is told if there was any."""
        self._declared.following.append(Following(consequence, values, then))

    def send(
        self,
        address: Address[MessageT],
        message: MessageT,
        *,
        confirmed_by: Literal["receiver", "broker"],
        stream: str,
    ) -> None:
        """Publish a message once this block is committed, after what `stream` holds already.

        `receiver`: repeated until `outbox.confirm`; `broker`: until the broker has taken it.
        """
        if message.traceparent is None:
            message = message.model_copy(update={"traceparent": current_traceparent()})
        self._leave(
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
        """POST a body to a service once this block is committed, repeated until answered 2xx."""
        self._leave(
            channel=service,
            address=path,
            stream=stream,
            confirmed_by="answer",
            message_id=None,
            mqtt_qos=0,
            is_retained=False,
            payload=body.model_dump_json().encode(),
        )

    def after_commit(self, callback: Callable[[], None]) -> None:
        """Call back once this block is on disk; not at all when it is rolled back."""
        self._callbacks.append(callback)

    def outbox_table(self) -> Table:
        """The table of messages that leave with this transaction."""
        if self._outbox is None:
            raise RuntimeError("this database was opened without an outbox")
        return self._outbox

    async def finish(self) -> frozenset[str]:
        """Write what was added and leaves, right before the COMMIT; the channels it leaves on."""
        if self._failure is not None:
            raise self._failure
        if self._leaving:
            self.add(self.outbox_table(), self._leaving)
        if self._declared:
            await self._write_declared()
        return frozenset(row["channel"] for row in self._leaving)

    def committed(self) -> None:
        """Tell those who asked to be told after the COMMIT."""
        for callback in self._callbacks:
            callback()

    async def _write_declared(self) -> None:
        if self.dialect == "postgresql":
            last = self.connection.execute_last
            followed = await write_at_once(self._declared, lambda *what: self._told(last(*what)))
        else:
            followed = await write_in_turn(self._declared, self.execute)
        self._callbacks += [each.then for each in followed if each.then is not None]

    async def _told(
        self, running: Awaitable[CursorResult[*tuple[Any, ...]]]
    ) -> CursorResult[*tuple[Any, ...]]:
        """What a statement did, or by its name the rule that refused a row."""
        try:
            return await running
        except DBAPIError as error:
            self._failure = error
            # On PostgreSQL the transaction is already unable to answer; on SQLite it still can.
            constraint = await taken_constraint(self.connection, error, dialect=self.dialect)
            if constraint is None:
                raise
            self._failure = Taken(constraint)
            raise self._failure from error

    def _leave(self, **row: object) -> None:
        self.outbox_table()
        self._leaving.append({**row, "traceparent": current_traceparent()})
