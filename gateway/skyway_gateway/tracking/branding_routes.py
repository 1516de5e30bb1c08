"""GET and PUT /v1/branding: how a customer's tracking pages look."""

from skyway.ids import SubjectId
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access.routes import KeyCaller
from skyway_gateway.context import Context
from skyway_gateway.tracking.branding import Branding
from skyway_gateway.tracking.branding_store import branding_of, put_branding


def branding_routes(context: Context) -> ServiceRouter:
    """GET and PUT /v1/branding."""
    router = ServiceRouter(tags=("deliveries",))

    @router.get("/v1/branding")
    async def get_branding(caller: KeyCaller) -> Branding:
        """Show the name and the colour of your shop on your tracking pages.

        Callers: customer.
        """
        caller.must_be("customer")
        async with context.db.read() as connection:
            return await branding_of(connection, SubjectId(caller.subject_id))

    @router.put("/v1/branding")
    async def change_branding(caller: KeyCaller, branding: Branding) -> Branding:
        """Set the name and the colour of your shop on all your tracking pages.

        What the body leaves out is no longer shown.

        Callers: customer.
        """
        caller.must_be("customer")
        async with context.db.write() as tx:
            await put_branding(tx, SubjectId(caller.subject_id), branding)
        return branding

    return router
