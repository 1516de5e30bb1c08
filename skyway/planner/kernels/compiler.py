"""Compiles the kernels without the interpreter's lock, and keeps the compiled code on disk.

Numba keeps compiled code until the function's own file changes. A kernel also contains the code of
the kernels that it calls, so here compiled code is kept until any kernel file changes.
"""

import hashlib
import logging
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any, Final, TypeVar

import numba
from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba import types
from numba.core import caching, cgutils, config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.environment import lookup_environment
from numba.extending import intrinsic, overload

from skyway.errors import SkywayError

_Function = TypeVar("_Function", bound=Callable[..., Any])

#: The processors for which the image is compiled (NUMBA_CPU_NAME): x86-64 servers since 2015. They
#: can do this more than the first ones.
_OF_IMAGE: Final = "x86-64-v3"
_ABILITIES: Final = ("avx2", "bmi2", "f16c", "fma", "lzcnt", "movbe")

log = logging.getLogger(__name__)


@cache
def _say_once() -> None:
    """Say why this process waits; without a log of its own, on standard error."""
    log.warning(
        "The planner is compiled, once; this usually takes up to a minute. "
        "The result is kept on disk."
    )


def _compile_for_this_processor_if_it_can_do_less() -> None:
    """Do without the code of the image on a processor that cannot run it (decision 0046)."""
    abilities = get_host_cpu_features()
    if config.CPU_NAME == _OF_IMAGE and not all(abilities.get(each) for each in _ABILITIES):
        config.CPU_NAME = config.CPU_FEATURES = None


_compile_for_this_processor_if_it_can_do_less()

_OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy"}


class _InnerLibrary(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
    """The code of a function that only compiled code calls: neither optimised nor made runnable.

    Numba does both for each function, and again for each function that calls it.
    """

    @property
    def codegen(self) -> Any:
        """Itself: only `set_env` is called on it."""
        return self

    def set_env(self, name: str, env: Any) -> None:
        """Do nothing: the entrance that holds this code sets the environment."""

    def finalize(self) -> None:
        """Keep the code as it is."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Null: there is nothing to run."""
        return 0


class _EntranceLibrary(JITCodeLibrary):  # type: ignore[misc]
    """The code of a function that Python calls, with all the code that it calls, optimised once."""

    def finalize(self) -> None:
        """Optimise, with the inner code that is called by other inner code."""
        for library in self._linking_libraries:  # the list grows meanwhile
            if isinstance(library, _InnerLibrary):
                known = set(self._linking_libraries)
                more = (each for each in library._linking_libraries if each not in known)
                self._linking_libraries.extend(dict.fromkeys(more))
        super().finalize()
        for variable in self._final_module.global_variables:
            if variable.name.startswith("_ZN08NumbaEnv"):
                env = lookup_environment(variable.name)
                if env is not None:
                    self._codegen.set_env(variable.name, env)


class _Inner(Compiler):  # type: ignore[misc]
    """Compiles a function that only compiled code calls."""

    def __init__(self, typing: Any, target: Any, _library: Any, *others: Any) -> None:
        super().__init__(typing, target, _InnerLibrary(target.codegen(), "inner"), *others)


class _Entrance(Compiler):  # type: ignore[misc]
    """Compiles a function that Python calls."""

    def __init__(self, typing: Any, target: Any, _library: Any, *others: Any) -> None:
        _say_once()
        library = _EntranceLibrary(target.codegen(), "entrance")
        library.enable_object_caching()
        super().__init__(typing, target, library, *others)


_ENTRANCE: Final[dict[str, Any]] = {**_OPTIONS, "cache": True, "pipeline_class": _Entrance}
# Wrappers are for calls from Python.
_INNER: Final[dict[str, Any]] = {
    **_OPTIONS,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "pipeline_class": _Inner,
}


def _digest_of_sources() -> bytes:
    sources = (each for each in files(__package__).iterdir() if each.name.endswith(".py"))
    digest = hashlib.sha256()
    for source in sorted(sources, key=lambda each: each.name):
        digest.update(source.read_bytes())
    return digest.digest()


class _StampOfAllSources:
    """The key of a compiled kernel: the sources of all kernels."""

    _digest: Final = _digest_of_sources()

    def get_source_stamp(self) -> bytes:
        """The digest of all sources."""
        return self._digest


class InFolderGiven(_StampOfAllSources, caching.UserProvidedCacheLocator):  # type: ignore[misc]
    """Keeps compiled kernels in the folder that NUMBA_CACHE_DIR names."""


class BesideSource(_StampOfAllSources, caching.InTreeCacheLocator):  # type: ignore[misc]
    """Keeps compiled kernels beside their source."""


class InHomeFolder(_StampOfAllSources, caching.UserWideCacheLocator):  # type: ignore[misc]
    """Keeps compiled kernels in the user's cache folder, where the source cannot be written to."""


class NoFolderForKernels(SkywayError):
    """Neither the folder of the sources nor the user's cache folder can be written to."""

    exit_code = 2  # the environment of the process is wrong

    def __init__(self) -> None:
        super().__init__(
            "compiled kernels need a folder that can be written to: set NUMBA_CACHE_DIR to one"
        )


_LOCATORS: Final = ",".join(
    f"{each.__module__}.{each.__qualname__}" for each in (InFolderGiven, BesideSource, InHomeFolder)
)


def entrance(function: _Function) -> _Function:
    """Compile this function when it is first called, to be called from Python too."""
    return _compiled(function, {**_ENTRANCE, "_nrt": True})


def kernel(function: _Function) -> _Function:
    """Compile this function for other kernels alone, without counting references to arrays.

    Counting them takes half of a search's time. The kernel must not make arrays, and must not call
    kernels that return arrays or handles: nobody would free these.
    """
    return _compiled(function, {**_INNER, "_nrt": False})


def array_kernel(function: _Function) -> _Function:
    """Compile this function for other kernels alone; it may make, receive and return arrays."""
    return _compiled(function, {**_INNER, "_nrt": True})


def _compiled(function: _Function, options: dict[str, Any]) -> _Function:
    before = config.CACHE_LOCATOR_CLASSES
    config.CACHE_LOCATOR_CLASSES = _LOCATORS
    try:
        compiled: _Function = numba.njit(**options)(function)
    except RuntimeError as error:
        raise NoFolderForKernels from error
    finally:
        config.CACHE_LOCATOR_CLASSES = before
    return compiled


def fetch_soon(array: Any, index: int) -> None:
    """Let the processor load this element or row into its cache, because it is read soon.

    It changes no result, and does nothing where kernels are not compiled.
    """


@intrinsic  # type: ignore[untyped-decorator]
def _fetch(_typing: Any, array: Any, index: Any) -> Any:
    """The processor's own instruction, which numba does not offer."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        of_array = signature.args[0]
        view = context.make_array(of_array)(context, builder, arguments[0])
        zero = context.get_constant(types.intp, 0)
        place = [arguments[1], *[zero] * (of_array.ndim - 1)]
        element = cgutils.get_item_pointer(
            context, builder, of_array, view, place, wraparound=False
        )
        number, address = ir.IntType(32), cgutils.voidptr_t
        of_fetch = ir.FunctionType(ir.VoidType(), [address, number, number, number])
        fetch = cgutils.get_or_insert_function(builder.module, of_fetch, "llvm.prefetch.p0")
        # To read (0) data (1), and keep them in every cache (3).
        builder.call(fetch, [builder.bitcast(element, address), number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


@overload(fetch_soon)  # type: ignore[untyped-decorator]
def _compiled_fetch_soon(array: Any, index: Any) -> Any:
    def fetch(array: Any, index: Any) -> Any:
        return _fetch(array, index)

    return fetch
