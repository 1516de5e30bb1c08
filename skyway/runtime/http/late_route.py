"""A route that is built when its app starts, or when somebody asks for it before."""

from collections.abc import Callable
from functools import partial
from typing import Any

from fastapi.routing import APIRoute
from starlette.routing import compile_path


class LateRoute(APIRoute):
    """What a request is compared with, and all else once it is wanted.

    FastAPI makes validators for all that a route takes and gives, 2 ms of processor time; a service
    has up to 87 routes, and an app that is made for a test answers two or three.
    """

    #: What is left to be done; None for a copy too, which Python asks for names before it has any.
    _build: Callable[[], None] | None = None

    def __init__(
        self, path: str, endpoint: Callable[..., Any], *, methods: list[str], **options: Any
    ) -> None:
        """Any: what FastAPI takes for its own route."""
        self.path = path
        self.endpoint = endpoint
        self.methods = {*methods}
        self.path_regex, self.path_format, self.param_convertors = compile_path(path)
        self._build = partial(super().__init__, path, endpoint, methods=methods, **options)

    def build(self) -> None:
        """Make all that FastAPI's route has, unless it is made."""
        build, self._build = self._build, None
        if build is not None:
            build()

    def __getattr__(self, name: str) -> Any:
        """What building makes; Python asks here for nothing that there is. Any: as FastAPI's."""
        if self._build is None:
            raise AttributeError(name, name=name, obj=self)
        self.build()
        return getattr(self, name)
