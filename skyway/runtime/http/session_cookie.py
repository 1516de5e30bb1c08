"""The cookie of a browser's session: it stands for an API key, so that no page holds the key."""

from typing import Final

from fastapi import Request, Response

from skyway.runtime.errors import AccessDenied

#: How the secrets of sessions begin.
SESSION_PREFIX: Final = "ss_"

_COOKIE: Final = "skyway_session"
#: Calls that change nothing.
_SAFE: Final = frozenset({"GET", "HEAD", "OPTIONS"})


def session_in(request: Request) -> str | None:
    """The secret of the session whose cookie a browser shows; None without one.

    Raises
    ------
    AccessDenied
        A page of another site makes the browser call.
    """
    secret = request.cookies.get(_COOKIE, "")
    if not secret.startswith(SESSION_PREFIX):
        return None
    if request.method not in _SAFE:
        require_own_page(request)
    return secret


def require_own_page(request: Request) -> None:
    """Check that a page of this host made the browser call; every browser reports that.

    Raises
    ------
    AccessDenied
        A page of another site makes the browser call.
    """
    host = request.headers.get("host", "")
    if request.headers.get("origin") not in (f"http://{host}", f"https://{host}"):
        raise AccessDenied("a session may call from pages of its own gateway only: see Origin")


def set_session(response: Response, request: Request, secret: str, *, lasts_s: int) -> None:
    """Make the browser show this secret from now on; no script and no other site sees it."""
    response.set_cookie(
        _COOKIE,
        secret,
        max_age=lasts_s,
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https",
    )


def end_session(response: Response) -> None:
    """Make the browser forget its session."""
    response.delete_cookie(_COOKIE, httponly=True, samesite="strict")
