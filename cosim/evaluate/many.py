"""Many calls in parallel: by threads of this machine, or on a Dask cluster (the extra ``dask``).

The compiled loop releases Python's global lock while it runs, and so does a thread that waits for
its worker process. Results equal those of single runs to the last bit.
"""

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from itertools import islice
from queue import SimpleQueue
from typing import Any, NamedTuple, TypeVar

from cosim.errors import BadInput
from cosim.toolchain.threads import threads as plain_threads

PATIENCE = 15.0
"""s, within which the cluster must answer."""

AHEAD, AHEAD_FAR = 2, 4
"""Calls submitted for each thread: the one that runs and the next; on a cluster some more."""

Item = TypeVar("Item")


class Pool(NamedTuple):
    """Threads, or a cluster."""

    submit: Callable[..., Any]
    """Submits a call with its arguments, to which the common one is added first; its future."""
    at_hand: int
    """Most calls that are submitted and not ended."""


@contextmanager
def threads(common: Any, count: int) -> Iterator[Pool]:
    """``count`` threads. Each call gets ``common`` as its first argument, and as its last one a
    progress function, which ends the call once the ``with`` block has ended."""
    with plain_threads(count) as (pool, progress):
        yield Pool(lambda call, *given: pool.submit(call, common, *given, progress), AHEAD * count)


@contextmanager
def cluster(common: Any, address: str) -> Iterator[Pool]:
    """The cluster at ``address``, whose workers must have this version of cosim. Raises BadInput
    where there is no such cluster."""
    try:
        from distributed import Client

        connected: Any = Client(address, timeout=PATIENCE)
    except ImportError as error:
        raise BadInput(
            "--dask needs the package distributed: install cosim with its extra dask."
        ) from error
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"--dask {address}: no cluster answers there ({reason}).") from error
    with closing(connected) as client:
        count = sum(client.nthreads().values())
        if not count:
            raise BadInput(f"--dask {address}: this cluster has no workers.")
        # Dask recomputes a task's result if the workers that held it die; scattered data is lost.
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
