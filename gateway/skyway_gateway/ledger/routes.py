"""Statements over REST: /v1/statements, as JSON, CSV or a page, and their lines."""

from typing import Annotated, Any, Final

from fastapi import Query, Request, Response
from fastapi.responses import HTMLResponse

from skyway.runtime.http.answers import NOT_FOUND, IdempotencyKey, keyed_call, response_of
from skyway.runtime.http.csv_answers import prefers
from skyway.runtime.http.paging import Page, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.limits import FairQueue
from skyway.runtime.sql.database import Tx
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.context import Context
from skyway_gateway.ledger import store
from skyway_gateway.ledger.correct import correct
from skyway_gateway.ledger.earned import Earned, EarnedQuery
from skyway_gateway.ledger.earned_store import earned_of, earned_page
from skyway_gateway.ledger.line import LedgerLine
from skyway_gateway.ledger.page import PAGE_HEADERS, statements_html
from skyway_gateway.ledger.statement import Correction, LineQuery, Statement, StatementQuery

_HTML: Final = "text/html"

#: A part of the OpenAPI document.
_PAGE: Final[dict[int | str, dict[str, Any]]] = {
    200: {"content": {_HTML: {"schema": {"type": "string", "description": "A page to print."}}}}
}

_PATH: Final = "/v1/statements"


def ledger_routes(context: Context, *, reporting: FairQueue) -> ServiceRouter:
    """GET /v1/statements and .../earnings, GET and POST /v1/statements/lines."""
    router = ServiceRouter(tags=("statements",))

    @router.get(_PATH, response_model=Page[Statement], responses=_PAGE)
    async def list_statements(
        request: Request, caller: KeyCaller, query: Annotated[StatementQuery, Query()]
    ) -> Page[Statement] | Response:
        """List the statements of a month: what each customer pays, and what each provider gets.

        Customers and providers see their own. The sums of both roles are equal.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        month = query.month_at(context.clock.now())
        async with context.db.read() as connection:
            found = await store.statements_page(connection, query.seen_by(caller), month=month)
        page = page_of(
            found,
            query,
            item=lambda each: each,
            sort_key=lambda each: (each.role, each.party_id, each.currency),
        )
        if prefers(_HTML, request):
            return HTMLResponse(statements_html(page, month), headers=PAGE_HEADERS)
        return page

    @router.get(f"{_PATH}/lines")
    async def list_statement_lines(
        caller: KeyCaller, query: Annotated[LineQuery, Query()]
    ) -> Page[LedgerLine]:
        """List the lines of the ledger of a month, by mission and number.

        Customers and providers see their own.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        month = query.month_at(context.clock.now())
        async with context.db.read() as connection:
            found = await store.lines_page(connection, query.seen_by(caller), month=month)
        return page_of(
            found, query, item=lambda it: it, sort_key=lambda it: (it.mission_id, it.number)
        )

    @router.get(f"{_PATH}/earnings")
    async def list_earnings(
        caller: KeyCaller, query: Annotated[EarnedQuery, Query()]
    ) -> Page[Earned]:
        """List what providers earned in a month by day, drone or route.

        Providers see their own. The sum over all is the amount of the statement.

        Callers: provider, operator.
        """
        caller.must_be("provider", "operator")
        month = query.month_at(context.clock.now())
        async with reporting.turn(str(caller)), context.db.survey() as connection:
            found = await earned_page(connection, query.seen_by(caller), month=month)
        return page_of(
            found,
            query,
            item=lambda row: earned_of(row, query.by),
            sort_key=lambda row: (row.provider_id, row.currency, row.first, row.second),
        )

    @router.post(f"{_PATH}/lines", status_code=201, response_model=LedgerLine, responses=NOT_FOUND)
    async def correct_mission(
        request: Request,
        caller: KeyCaller,
        requested: Correction,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Correct what a settled mission costs, by a line in the present month.

        Lines never change: a correction of a closed month is a new line, too.

        Callers: operator.
        """
        caller.must_be("operator")

        async def add(tx: Tx) -> Answer:
            line = await correct(tx, requested, context.clock)
            return Answer(201, line.model_dump_json().encode())

        call = await keyed_call(request, caller, idempotency_key)
        return response_of(await once(context.db, call, act=add, clock=context.clock))

    return router
