"""Many calls at once: by threads of this machine, or on a Dask cluster (the extra ``dask``).

The compiled loop leaves Python to the other threads while it runs, and so does a thread that waits
for its worker; so the numbers are those of single runs, to the last bit.
"""

import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from itertools import islice
from queue import SimpleQueue
from typing import Any, NamedTuple, TypeVar

from cosim.errors import BadInput

PATIENCE = 15.0
"""s in which the cluster must answer."""

AHEAD, AHEAD_FAR = 2, 4
"""Calls at hand for each thread: the one that runs and the next; on a cluster, to keep it busy."""

Item = TypeVar("Item")


class Pool(NamedTuple):
    """Where calls are made."""

    submit: Callable[..., Any]
    """Its future; what all calls have in common is the first argument."""
    at_hand: int
    """How many calls it has at once, at most."""


class _Ended(Exception):
    """Nobody wants to know any more."""


@contextmanager
def threads(common: Any, count: int) -> Iterator[Pool]:
    """So many threads. A call's last argument is a progress, which ends it when nobody waits."""
    ended = threading.Event()

    def progress(time: float) -> None:
        if ended.is_set():
            raise _Ended

    pool = ThreadPoolExecutor(count)
    try:
        yield Pool(lambda call, *given: pool.submit(call, common, *given, progress), AHEAD * count)
    finally:
        ended.set()
        pool.shutdown(cancel_futures=True)


@contextmanager
def cluster(common: Any, address: str) -> Iterator[Pool]:
    """The cluster at ``address``, whose workers must have this version of cosim. Raises BadInput
    where there is no such cluster."""
    with closing(_client(address)) as client:
        count = sum(client.nthreads().values())
        if not count:
            raise BadInput(f"--dask {address}: this cluster has no workers.")
        # What a task gave is made again where the workers that had it die, scattered data is not.
        there = client.submit(lambda same: same, common, pure=False)
        yield Pool(
            lambda call, *given: client.submit(call, there, *given, pure=False), AHEAD_FAR * count
        )


def each(
    pool: Pool, call: Callable[..., Any], items: Iterable[Item]
) -> Generator[tuple[Item, Any], None, None]:
    """Each item with what ``call(common, item)`` gives or raises, in the order in which the pool
    finishes them. Items are drawn as it has room for them."""
    waiting, running = iter(items), dict[Any, Item]()
    done: SimpleQueue[Any] = SimpleQueue()
    while True:
        for item in islice(waiting, pool.at_hand - len(running)):
            future = pool.submit(call, item)
            running[future] = item
            future.add_done_callback(done.put)
        if not running:
            return
        future = done.get()
        item = running.pop(future)
        try:
            found = future.result()
        except Exception as error:
            found = error
        yield item, found


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise BadInput(
            "--dask needs the package distributed: install cosim with its extra dask."
        ) from error
    try:
        return Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"--dask {address}: no cluster answers there ({reason}).") from error
