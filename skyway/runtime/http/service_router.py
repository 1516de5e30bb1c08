"""The routes of a service, each of which refuses JSON that cannot be stored."""

from fastapi import APIRouter, Depends
from fastapi.routing import APIRoute

from skyway.runtime.http.json_bodies import refuse_unstorable_json


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
            generate_unique_id_function=operation_id,
        )


def operation_id(route: APIRoute) -> str:
    """The operation id of a route: its function's name in camel case, as `listStations`."""
    first, *others = route.name.split("_")
    return first + "".join(word.capitalize() for word in others)
