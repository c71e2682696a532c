"""Pieces of work over workers: own processes, an executor, or a Dask cluster; results in their order, whatever ends first.

A piece is a value: with the work it says all that is to be done, and who computes it changes no bit. Few pieces are under way at
once. Workers of another arithmetic, or with other versions, refuse what they are given.
"""

from __future__ import annotations

import os
import pickle
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager
from functools import lru_cache
from io import BytesIO
from queue import SimpleQueue
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar

import numpy as np

from ..basics.checks import check_positive_int
from ..basics.interrupts import WorkersLost, interrupts_wait
from ..basics.messages import printable
from .arithmetic import Arithmetic, arithmetic

if TYPE_CHECKING:
    from .processes import OwnProcess

T = TypeVar("T")
R = TypeVar("R")

Workers: TypeAlias = int | Executor | Any
"""Processes that are begun here, an executor of `concurrent.futures` or one like it, or a client of a Dask cluster."""

MOST_WORKERS = 4096

AHEAD = 2
"""Pieces under way for each worker, so that none waits for its next one."""

WINDOW = 16
"""Pieces for each worker between the first that has not ended and the last that is sent: what waits for its turn stays bounded."""

DEATHS = 2
"""Processes that end with a piece, after which it is not tried again."""

COUNTED_EVERY = 2.0
"""Seconds after which the workers of a cluster, which come and go, are counted again."""


class _Sent(NamedTuple):
    """A piece under way: its place, and what was sent."""

    place: int
    data: bytes


class _Slot:
    """An executor, how many pieces it computes at once, and those that it has; an own process has a slot of its own."""

    def __init__(self, executor: Any, count: Callable[[], int] = lambda: 1, own: OwnProcess | None = None) -> None:
        self.executor, self.count, self.own = executor, count, own
        self.futures: dict[Future[Any], _Sent] = {}


class Distributor:
    """What sends pieces of work, and waits for them.

    Attributes
    ----------
    threads : int
        For each piece.
    """

    def __init__(self, slots: list[_Slot], threads: int) -> None:
        self._slots, self.threads = slots, threads
        self._sending: _Sending | None = None

    @property
    def here(self) -> bool:
        """Whether all is computed in this process, each piece when its turn comes."""
        return not self._slots

    def map(
        self, work: Callable[[T], R], pieces: Iterable[T], name: Callable[[int], str] = "piece {}".format, ahead: int = AHEAD
    ) -> Iterator[R]:
        """Yield what the work makes of each piece, in their order.

        Parameters
        ----------
        work : callable
            It and the pieces can be pickled, by cloudpickle where that is installed.
        pieces : iterable
        name : callable
            From the place of a piece to what it is called where it fails.
        ahead : int
            Pieces under way for each worker; 1 for long ones.

        Raises
        ------
        ValueError
            For what cannot be sent, and where workers compute otherwise than this process.
        RuntimeError
            Where processes ended with a piece twice, and where an executor broke.
        """
        if self.here:
            yield from map(work, pieces)
            return
        self._sending = _Sending(self._slots, sent(work), map(sent, pieces), name, ahead)
        try:
            yield from self._sending.results()
        finally:
            self.cancel()

    def cancel(self) -> None:
        """Have nothing begin any more, and end own processes that are at work."""
        if self._sending is not None:
            with interrupts_wait():
                self._sending.cancel()


class _Sending:
    """Pieces of one work on their way."""

    def __init__(self, slots: list[_Slot], work: bytes, pieces: Iterator[bytes], name: Callable[[int], str], ahead: int) -> None:
        self._slots, self._work, self._name, self._ahead = slots, work, name, ahead
        self._new, self._again = enumerate(pieces), deque[tuple[int, bytes]]()
        self._ended: SimpleQueue[Future[Any]] = SimpleQueue()
        self._done: dict[int, Any] = {}
        self._deaths = Counter[int]()
        self._next, self._last = 0, -1  # to be yielded, and the last that was sent

    def results(self) -> Iterator[Any]:
        while True:
            with interrupts_wait():
                self._fill()
                under_way = any(slot.futures for slot in self._slots)
            if not under_way:
                return
            ended = self._ended.get()
            with interrupts_wait():
                self._take(ended)
            while self._next in self._done:
                value, warned = self._done.pop(self._next)
                self._next += 1
                for category, text in warned:
                    warnings.warn(text, category, stacklevel=4)
                yield value

    def cancel(self) -> None:
        for slot in self._slots:
            for future in slot.futures:
                future.cancel()
            if slot.own is not None and slot.futures:
                slot.own.renew()
            slot.futures.clear()

    def _fill(self) -> None:
        """Send pieces to whoever has fewest, as long as there is room."""
        while True:
            counts = {slot: slot.count() for slot in self._slots}
            slot = min(self._slots, key=lambda one: len(one.futures) / counts[one])
            if len(slot.futures) >= self._ahead * counts[slot]:
                return
            if self._again:
                place, data = self._again.popleft()
            elif self._last - self._next < WINDOW * sum(counts.values()) and (new := next(self._new, None)) is not None:
                place, data = new
                self._last = place
            else:
                return
            future = slot.executor.submit(computed, self._work, data, arithmetic())
            slot.futures[future] = _Sent(place, data)
            future.add_done_callback(self._ended.put)

    def _take(self, future: Future[Any]) -> None:
        slot = next((slot for slot in self._slots if future in slot.futures), None)
        if slot is None:  # of a process that ended, with which it was sent again
            return
        piece = slot.futures[future]
        try:
            self._done[piece.place] = future.result()
        except BrokenExecutor as error:
            self._lost(slot, piece, error)
            return
        except CancelledError as error:
            raise WorkersLost(f"workers: expected {self._name(piece.place)} to be computed, given up by its executor") from error
        except Exception as error:
            if type(error).__name__ == "KilledWorker":  # of Dask, whose scheduler has tried it several times
                raise self._deadly(piece.place, "") from error
            raise
        del slot.futures[future]

    def _lost(self, slot: _Slot, piece: _Sent, error: BrokenExecutor) -> None:
        """Send the pieces of a process that ended again; the one that it had begun may be why it did."""
        if slot.own is None:
            name = self._name(piece.place)
            raise WorkersLost(f"workers: expected an executor that goes on, given one that broke at {name}: {error}") from error
        begun, *_ = lost = list(slot.futures.values())
        ending = slot.own.renew()
        slot.futures.clear()
        self._deaths[begun.place] += 1
        if self._deaths[begun.place] >= DEATHS:
            raise self._deadly(begun.place, ending)
        self._again.extend((one.place, one.data) for one in lost)

    def _deadly(self, place: int, ending: str) -> WorkersLost:
        how = f", the last one {ending}" if ending else ""
        return WorkersLost(
            f"workers: expected processes that last, given several that ended with {self._name(place)}{how}: too little memory is"
            " the usual reason; fewer workers need less"
        )


@contextmanager
def distributed_over(workers: Workers | None, threads: int | None) -> Iterator[Distributor]:
    """What computes pieces of work: this process where `workers` is None.

    Parameters
    ----------
    workers : int, Executor, Client, or None
        An executor and a client stay open: they are their owner's.
    threads : int or None
        In all, of this process or of own ones together; of an executor, for each piece. Default: every core; of an executor, one.

    Raises
    ------
    TypeError, ValueError
        For anything else.
    """
    check_workers(workers)
    slots, own = list[_Slot](), list[Any]()
    if isinstance(workers, int | np.integer):
        from .processes import OwnProcess

        number = int(workers)
        own = [OwnProcess() for _ in range(number)]
        slots, threads = [_Slot(one, own=one) for one in own], max(1, (threads or cores()) // number)
    elif workers is not None and hasattr(workers, "get_executor"):
        slots, threads = [_Slot(workers.get_executor(pure=False), _counted(workers))], threads or 1
    elif workers is not None:
        known = (getattr(workers, name, None) for name in ("num_workers", "_max_workers"))
        count = next((number for number in known if isinstance(number, int) and number > 0), cores())
        slots, threads = [_Slot(workers, lambda: count)], threads or 1
    distributor = Distributor(slots, threads or cores())
    try:
        yield distributor
    finally:
        with interrupts_wait():
            distributor.cancel()
            for one in own:
                one.end()


def check_workers(workers: object) -> None:
    """Raise where `workers` is unsuitable.

    Raises
    ------
    TypeError, ValueError
    """
    if isinstance(workers, bool | int | np.integer):
        check_positive_int(workers, "workers", most=MOST_WORKERS)
    elif workers is not None and not hasattr(workers, "submit"):
        raise TypeError(
            f"workers: expected a whole number, an executor of concurrent.futures or a Dask client, given {type(workers).__name__}"
        )


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _counted(client: Any) -> Callable[[], int]:
    """Count the threads of a cluster's workers, now and then."""
    last, count = -COUNTED_EVERY, 1

    def counted() -> int:
        nonlocal last, count
        if time.monotonic() - last >= COUNTED_EVERY:
            last, count = time.monotonic(), max(1, sum(client.nthreads().values()))
        return count

    return counted


# --- What travels ---------------------------------------------------------------------------------------------------------


class _Plain(pickle.Pickler):
    """Pickles all that another process can import."""

    def reducer_override(self, obj: Any) -> Any:
        if isinstance(obj, type | FunctionType) and obj.__module__ == "__main__":
            raise pickle.PicklingError(f"{obj.__qualname__} of the script or notebook itself")
        return NotImplemented


def sent(value: object) -> bytes:
    """The bytes of what is sent.

    Raises
    ------
    ValueError
        Where it cannot be sent.
    """
    buffer = BytesIO()
    try:
        _Plain(buffer, pickle.HIGHEST_PROTOCOL).dump(value)
        return buffer.getvalue()
    except Exception as plain:  # whatever an object raises
        try:
            import cloudpickle
        except ModuleNotFoundError:
            raise ValueError(
                f"workers: expected what can be sent, given {printable(plain)}: define functions in a module of their own, or"
                " install cloudpickle"
            ) from plain
        try:
            return bytes(cloudpickle.dumps(value))
        except Exception as error:
            raise ValueError(f"workers: expected what can be sent, given {printable(error)}") from error


def computed(work: bytes, piece: bytes, here: Arithmetic) -> tuple[Any, list[tuple[type[Warning], str]]]:
    """What a worker does: it returns what comes of a piece, and the warnings on the way, which are given to the sender."""
    here.check(arithmetic())
    if here.process == os.getpid():
        return _loaded(work)(pickle.loads(piece)), []
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        value = _loaded(work)(pickle.loads(piece))
    return value, [(one.category, str(one.message)) for one in heard]


@lru_cache(maxsize=2)
def _loaded(work: bytes) -> Callable[[Any], Any]:
    loaded: Callable[[Any], Any] = pickle.loads(work)
    return loaded
