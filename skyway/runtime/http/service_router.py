"""The routes of a service, each of which refuses JSON that cannot be stored."""

from fastapi import APIRouter, Depends

from skyway.runtime.http.json_bodies import refuse_unstorable_json
from skyway.runtime.http.late_route import LateRoute


class ServiceRouter(APIRouter):
    """Routes that an app takes over as they are.

    FastAPI would rather include routers: then every route is built twice, and every request is
    matched twice. So what holds of all routes comes with them, not with the app.
    """

    def __init__(
        self, *, tags: tuple[str, ...] = (), prefix: str = "", include_in_schema: bool = True
    ) -> None:
        super().__init__(
            tags=[*tags],
            prefix=prefix,
            dependencies=[Depends(refuse_unstorable_json)],
            include_in_schema=include_in_schema,
            route_class=LateRoute,
        )
