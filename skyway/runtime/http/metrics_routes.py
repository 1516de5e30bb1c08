"""GET /metrics of every service, for Prometheus and others with the deployment's metrics key.

The key is a secret file, so it can be checked while the database is away.
"""

import hmac
from pathlib import Path

from fastapi import Depends, Request, Response
from fastapi.openapi.models import HTTPBearer as HTTPBearerModel
from fastapi.responses import PlainTextResponse
from fastapi.security.base import SecurityBase
from fastapi.security.utils import get_authorization_scheme_param

from skyway.runtime.errors import InvalidSettings, Unauthenticated
from skyway.runtime.exposition import exposition
from skyway.runtime.gauges import Gauges
from skyway.runtime.http.identity import read_secret
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.metrics import METRICS_KEY


class MetricsGate(SecurityBase):
    """A dependency that accepts only callers with the metrics key.

    The file is read at each call, so another key in it counts immediately.
    """

    model = HTTPBearerModel(description="the deployment's metrics key")
    scheme_name = "MetricsKey"

    def __init__(self, secrets_dir: Path) -> None:
        self._secrets_dir = secrets_dir

    async def __call__(self, request: Request) -> None:
        """Go on for a caller that shows the key.

        Raises
        ------
        Unauthenticated
            No key or a wrong key is shown, or the deployment has no such key.
        """
        scheme, shown = get_authorization_scheme_param(request.headers.get("Authorization"))
        if scheme.lower() != "bearer" or not shown:
            raise Unauthenticated("the metrics key is needed: Authorization: Bearer ...")
        try:
            key = read_secret(self._secrets_dir, METRICS_KEY)
        except InvalidSettings as error:
            raise Unauthenticated("this deployment has no metrics key: skyway secrets") from error
        if not hmac.compare_digest(shown.encode(), key.encode()):
            raise Unauthenticated("this is not the metrics key")


def metrics_routes(*, gate: MetricsGate, gauges: Gauges) -> ServiceRouter:
    """GET /metrics."""
    router = ServiceRouter(tags=("service",))

    @router.get("/metrics", response_class=PlainTextResponse, dependencies=[Depends(gate)])
    async def get_metrics() -> Response:
        """The counters and gauges of the process, for Prometheus; the metrics key is needed."""
        content, content_type = exposition(await gauges.read())
        return Response(content, headers={"Content-Type": content_type})

    return router
