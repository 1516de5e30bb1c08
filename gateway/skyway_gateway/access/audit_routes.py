"""The audit log over REST; operators only."""

from typing import Annotated

from fastapi import Depends, Query
from pydantic import Field

from skyway.ids import SubjectId
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_gateway.access import audit_store
from skyway_gateway.access.audit_store import LONGEST_PATH, AuditEntry, AuditFilter
from skyway_gateway.access.routes import KeyGate
from skyway_gateway.access.store import KeyRole


class AuditQuery(PageQuery):
    """The query of the audit log; `path` is how the entries' paths begin."""

    role: Annotated[KeyRole | None, Field(description="Only calls of this role.")] = None
    subject_id: Annotated[
        SubjectId | None, Field(description="Only calls of this provider or operator.")
    ] = None
    path: Annotated[
        str | None,
        Field(
            min_length=1,
            max_length=LONGEST_PATH,
            description="Only calls whose path begins with this text.",
        ),
    ] = None


def audit_routes(*, db: Database, gate: KeyGate) -> ServiceRouter:
    """GET /v1/audit."""
    router = ServiceRouter(tags=("audit",))

    @router.get("/v1/audit")
    async def list_audit_entries(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[AuditQuery, Query()]
    ) -> Page[AuditEntry]:
        """List what operators and providers changed, the newest first.

        Callers: operator.
        """
        caller.must_be("operator")
        filters = AuditFilter(query.role, query.subject_id, query.path)
        async with db.survey() as connection:
            found = await audit_store.page(connection, query, filters)
        return page_of(found, query, item=lambda it: it, sort_key=lambda it: (it.entry_id,))

    return router
