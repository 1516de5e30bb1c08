"""Worker processes for heavy work: processes of this machine, or those of a Ray cluster.

Both are an `Executor` of the standard library, so the same code uses either of them.
"""

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any, ParamSpec, TypeVar

from skyway.errors import SkywayError

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

#: The setting that names a Ray cluster: `auto`, `host:port` or `ray://host:port`.
RAY_ADDRESS = "SKYWAY_RAY_ADDRESS"


class NoRay(SkywayError):
    """A Ray cluster was named, and Ray is not installed."""

    def __init__(self) -> None:
        super().__init__(f"{RAY_ADDRESS} needs Ray: pip install 'skyway[ray]'")


@contextmanager
def open_workers(
    count: int, *, warm_up: Callable[[], None], ray_address: str | None = None
) -> Iterator[Executor]:
    """Workers that have called `warm_up` before their first task.

    When an error ends the block, tasks that have not begun are cancelled.

    Parameters
    ----------
    count
        The processes of this machine. A Ray cluster has one worker for each of its processors.
    ray_address
        The Ray cluster that runs the tasks instead. All its nodes have this version of Skyway.

    Raises
    ------
    NoRay
        `ray_address` is given, and Ray is not installed.
    """
    workers = _local(count, warm_up) if ray_address is None else RayWorkers(ray_address, warm_up)
    try:
        yield workers
    except BaseException:
        workers.shutdown(wait=False, cancel_futures=True)
        raise
    workers.shutdown()


def _local(count: int, warm_up: Callable[[], None]) -> Executor:
    # Fresh processes: a fork would copy this process's threads and, in plain Python, its numba.
    return ProcessPoolExecutor(
        count, mp_context=multiprocessing.get_context("spawn"), initializer=warm_up
    )


class RayWorkers(Executor):
    """Runs each task on a free processor of a Ray cluster."""

    def __init__(self, address: str, warm_up: Callable[[], None]) -> None:
        try:
            import ray
        except ImportError as error:
            raise NoRay from error
        self._ray = ray
        self._warm_up = warm_up
        self._tasks: list[Any] = []  # Ray's references, which have no type of their own
        ray.init(address, log_to_driver=False)
        self._remote: Any = ray.remote(_run)

    def submit(
        self,
        fn: Callable[Arguments, Result],
        /,
        *args: Arguments.args,
        **kwargs: Arguments.kwargs,
    ) -> Future[Result]:
        """The future of a task on some node."""
        task = self._remote.remote(self._warm_up, fn, args, kwargs)
        self._tasks.append(task)
        future: Future[Result] = task.future()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster, whose nodes stay."""
        if cancel_futures:
            for task in self._tasks:
                self._ray.cancel(task)
        elif wait and self._tasks:
            self._ray.wait(self._tasks, num_returns=len(self._tasks))
        self._tasks.clear()
        self._ray.shutdown()


def _run(
    warm_up: Callable[[], None],
    function: Callable[..., Result],
    args: tuple[Any, ...],  # the arguments of any function
    kwargs: dict[str, Any],
) -> Result:
    """The result of the function, on a worker of a cluster."""
    _warmed_up(warm_up)
    return function(*args, **kwargs)


@cache
def _warmed_up(warm_up: Callable[[], None]) -> None:
    """Call it once in each process."""
    warm_up()
