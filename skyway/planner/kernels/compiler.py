"""How the kernels are compiled: without the interpreter's lock, and kept on disk."""

from collections.abc import Callable
from typing import Any, Final, TypeVar

import numba

_Function = TypeVar("_Function", bound=Callable[..., Any])

_OPTIONS: Final[dict[str, Any]] = {"nogil": True, "cache": True, "error_model": "numpy"}


def entrance(function: _Function) -> _Function:
    """Compile this function when it is first called, to be called from Python too."""
    compiled: _Function = numba.njit(**_OPTIONS)(function)
    return compiled


def kernel(function: _Function) -> _Function:
    """Compile this function for other kernels alone.

    Without the wrappers through which Python calls it that takes a third of the time.
    """
    compiled: _Function = numba.njit(
        no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS
    )(function)
    return compiled
