"""Cluster: draws batches of points, and measures machines of a search, on the workers of a Dask client.

    plan, scenes ─► once per worker ┐
    batches of about a second ─────┴─► workers ─► rows ─► one file of the folder each

The scheduler and any worker may die at any time: tasks in flight are submitted again. Only the client writes.
"""

from __future__ import annotations

import hashlib
import threading
import time
import warnings
from collections import OrderedDict, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from splatsim import _native
from splatsim._native import InputError, JobError, SplatsimError
from splatsim._report import Progress

#: Target duration of a batch, seconds. It is longer with many workers, so that at most 100 batches end per second: each takes time of the
#: scheduler and the client.
BATCH_SECONDS = 1.0
SECONDS_A_THREAD = 0.01
#: Batches per thread of the workers: one that is drawn, and one that is queued.
BATCHES_A_THREAD = 2
#: Limit of worker deaths on one batch: beyond it the batch is the cause.
MOST_DEATHS = 30
#: Interval between two polls for finished tasks without a notification, and for the number of threads.
LOOK_EVERY_SECONDS = 0.1
COUNT_EVERY_SECONDS = 2.0
#: Interval between two calls of a progress callback.
PROGRESS_EVERY_SECONDS = 0.2
#: Limit of consecutive failures to fetch results.
MOST_FAULTS = 50


# --- On a worker ---

#: Stages and views of this process, most recent last: scenes are unpacked once per worker, and frames shared by batches are drawn once.
_kept: OrderedDict[str, Any] = OrderedDict()
_MOST_KEPT = 3
_keeping = threading.Lock()


@dataclass
class _Slot:
    lock: threading.Lock = field(default_factory=threading.Lock)
    value: Any = None


def _once(key: str, make: Callable[[], Any], most: int) -> Any:
    """The value of `make`, made once for all threads of this process."""
    with _keeping:
        slot = _kept.setdefault(key, _Slot())
        _kept.move_to_end(key)
        while len(_kept) > most:
            _kept.popitem(last=False)
    with slot.lock:
        if slot.value is None:
            slot.value = make()
    return slot.value


@dataclass(frozen=True)
class Shared:
    """Data that many tasks use; it is sent to each worker once."""

    key: str
    version: str
    parts: tuple[Any, ...]

    @classmethod
    def of(cls, *parts: Any) -> Shared:
        digest = hashlib.sha256()
        for part in parts:
            digest.update(part if isinstance(part, bytes) else str(part).encode())
        return cls(digest.hexdigest(), _native.VERSION, parts)

    def check(self) -> None:
        """Refuses data of another version."""
        if self.version != _native.VERSION:
            raise InputError(f"a worker has splatsim {_native.VERSION}, and the client {self.version}: both must have the same")


def keep_shared(shared: Shared) -> Shared:
    """A task whose result is shared data: workers pass it on to each other."""
    return shared


def draw_points(shared: Shared, numbers: list[int]) -> tuple[bytes, float]:
    """A task: rows of points as Parquet, and the seconds taken."""
    shared.check()
    plan, number, scene = shared.parts
    stage = _once(shared.key, lambda: _native.Stage(plan, number, scene, 1), _MOST_KEPT)
    start = time.perf_counter()
    rows = stage.draw(numbers, 1)
    return rows, time.perf_counter() - start


def measure_machines(*given: Any) -> list[str]:
    """A task: measurements of machines on views, which are shared. The last two arguments are the machines and the target."""
    *views, machines, target = given
    sights = [_sight(view, len(views) + _MOST_KEPT) for view in views]
    return [_native.measure(sights, machine, target, 1) for machine in machines]


def _sight(shared: Shared, most: int) -> _native.View:
    shared.check()
    [view] = shared.parts
    sight: _native.View = _once(shared.key, lambda: _native.View(view), most)
    return sight


# --- On the client ---


@dataclass
class Task:
    """A call to run on any worker."""

    function: Callable[..., Any]
    shared: tuple[str, ...]
    arguments: tuple[Any, ...]
    deaths: int = 0


@contextmanager
def client_of(client: Any) -> Iterator[Any]:
    """A client: the caller's own, a new one for an address, or for True one with workers on this computer, each with one thread."""
    try:
        import distributed
    except ImportError:
        raise InputError("client: distributed is not installed: pip install 'splatsim[cluster]'") from None
    # distributed has no types.
    dask: Any = distributed
    if client is True:
        with dask.LocalCluster(threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster, dask.Client(cluster) as own:
            yield own
    elif isinstance(client, str):
        with dask.Client(client) as own:
            yield own
    elif isinstance(client, dask.Client) and not client.asynchronous:
        yield client
    else:
        raise InputError("client: a distributed.Client that is not asynchronous, a scheduler's address, or True is needed")


class Crew:
    """The workers of a client. Each task in flight lands exactly once, even if workers die."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._flying: dict[Any, Task] = {}
        self._shared: dict[str, Shared] = {}
        self._futures: dict[str, Any] = {}
        self._landing = threading.Event()
        self._threads, self._counted = 0, 0.0
        self._faults = 0

    def threads(self) -> int:
        """Current number of threads of all workers; at least 1, even if there is none yet."""
        now = time.monotonic()
        if now - self._counted > COUNT_EVERY_SECONDS and self._client.status == "running":
            self._counted = now
            try:
                counts = self._client.sync(self._client.scheduler.ncores, callback_timeout=5)
                self._threads = sum(counts.values())
            except (OSError, TimeoutError):
                pass  # The scheduler is dying; the last count is kept.
        return max(1, self._threads)

    def flying(self) -> int:
        """Number of tasks in flight."""
        return len(self._flying)

    def status(self) -> str:
        """The workers, in words."""
        return f"{self._threads} threads of workers" if self._threads else "no worker yet"

    def forget_unused(self) -> None:
        """Drops shared data that no task in flight uses."""
        used = {key for task in self._flying.values() for key in task.shared}
        for key in set(self._shared) - used:
            del self._shared[key]
            self._futures.pop(key, None)

    def share(self, shared: Shared) -> str:
        """Registers shared data for tasks; returns its key."""
        self._shared.setdefault(shared.key, shared)
        return shared.key

    def start(self, task: Task) -> None:
        """Submits a task."""
        futures = [self._future(key) for key in task.shared]
        future = self._client.submit(task.function, *futures, *task.arguments, pure=False)
        self._flying[future] = task
        future.add_done_callback(lambda _: self._landing.set())

    def _future(self, key: str) -> Any:
        future = self._futures.get(key)
        if future is None or future.status not in ("pending", "finished"):
            with warnings.catch_warnings():
                # Ignore the warning about large data: scenes are large.
                warnings.simplefilter("ignore")
                future = self._client.submit(keep_shared, self._shared[key], pure=False)
            self._futures[key] = future
        return future

    def landed(self) -> list[tuple[Task, Any]]:
        """Finished tasks with their results; waits briefly if there are none. Lost tasks are submitted again."""
        self._landing.clear()
        over = [future for future in self._flying if future.done()]
        if not over:
            self._landing.wait(LOOK_EVERY_SECONDS)
            return []
        finished = [future for future in over if future.status == "finished"]
        for future in over:
            if future.status not in ("finished", "pending"):
                self._again(future, self._flying.pop(future))
        return self._gathered(finished)

    def _gathered(self, futures: list[Any]) -> list[tuple[Task, Any]]:
        if not futures:
            return []
        try:
            results = self._client.gather(futures)
        except Exception as fault:
            # Their worker has died: they are drawn again, or have become errors, which the next poll finds.
            self._faults += 1
            if self._faults > MOST_FAULTS:
                raise JobError(f"results cannot be fetched from the workers: {_sentence(fault)}") from fault
            time.sleep(LOOK_EVERY_SECONDS * self._faults)
            return []
        self._faults = 0
        return [(self._flying.pop(future), result) for future, result in zip(futures, results, strict=True)]

    def _again(self, future: Any, task: Task) -> None:
        fault = _fault_of(future)
        if fault is not None:
            _check_fault(fault, task)
            task.deaths += 1
        self._wait_for_scheduler()
        self.start(task)

    def _wait_for_scheduler(self) -> None:
        while self._client.status == "connecting":
            time.sleep(LOOK_EVERY_SECONDS)
        if self._client.status != "running":
            raise JobError("the scheduler is gone: finished rows are kept, and the same call with another client continues")

    def cancel(self) -> None:
        """Cancels all tasks."""
        futures = [*self._flying, *self._futures.values()]
        self._flying.clear()
        self._futures.clear()
        if futures and self._client.status == "running":
            try:
                self._client.cancel(futures, force=True)
            except (OSError, TimeoutError):
                pass  # Then there is no scheduler left.


def _fault_of(future: Any) -> BaseException | None:
    """Error of a failed task; None if it was lost with the scheduler."""
    if future.status != "error":
        return None
    try:
        fault = future.exception(timeout=5)
    except Exception:
        return None
    return fault if isinstance(fault, BaseException) else None


def _check_fault(fault: BaseException, task: Task) -> None:
    """Raises errors that a retry cannot fix."""
    if isinstance(fault, SplatsimError):
        raise fault
    if isinstance(fault, ImportError | AttributeError):
        raise JobError(f"a worker cannot draw: {_sentence(fault)}; splatsim {_native.VERSION} must be installed there") from fault
    # By its name: its module in distributed has changed before.
    if type(fault).__name__ not in ("KilledWorker", "CancelledError", "FutureCancelledError", "NoValidWorkerError", "CommClosedError"):
        raise JobError(f"a worker has failed: {_sentence(fault)}") from fault
    if task.deaths >= MOST_DEATHS:
        raise JobError(f"workers have died {task.deaths} times over the same points: {task.arguments}: do they have enough memory?") from fault


def _sentence(fault: BaseException) -> str:
    return f"{type(fault).__name__}: {fault}".splitlines()[0]


class _Pace:
    """Number of points per batch: as many as fill it at the measured speed, but at most twice the largest batch so far."""

    def __init__(self) -> None:
        self._each: float | None = None
        self._measured = 1

    def landed(self, points: int, seconds: float) -> None:
        """Records the duration of a batch."""
        each = seconds / points
        self._each = each if self._each is None else 0.7 * self._each + 0.3 * each
        self._measured = max(self._measured, points)

    def size(self, threads: int) -> int:
        """Points of the next batch."""
        if not self._each:
            return self._measured
        target = max(BATCH_SECONDS, threads * SECONDS_A_THREAD) / self._each
        return max(1, min(int(target), 2 * self._measured))


def _taken(groups: deque[list[int]], size: int) -> list[int]:
    """About `size` points, from the end of each group. Points that share a frame stay together if they fit into one batch."""
    batch: list[int] = []
    while groups and len(batch) < size:
        left = size - len(batch)
        if len(groups[0]) <= left:
            batch += groups.popleft()
        elif batch and len(groups[0]) <= size:
            break
        else:
            batch += groups[0][-left:]
            del groups[0][-left:]
    return sorted(batch)


def carry_out(own: _native.Sweep, client: Any, progress: Progress | None) -> None:
    """Draws the missing points of a folder's sweep on the workers of a client."""
    crew = Crew(client)
    try:
        _Drawing(own, crew, progress).all()
    finally:
        crew.cancel()


class _Drawing:
    """A sweep while its points are drawn."""

    def __init__(self, own: _native.Sweep, crew: Crew, progress: Progress | None) -> None:
        self._own, self._crew, self._progress = own, crew, progress
        scenes, _ = own.counts()
        self._missing = [own.missing(nth) for nth in range(scenes)]
        self._left = sum(len(group) for groups in self._missing for group in groups)
        self._done, self._reported = 0, 0.0
        self._pace = _Pace()

    def all(self) -> None:
        """Draws all missing points. The last batches of a scene overlap with the first of the next scene."""
        for nth, groups in enumerate(self._missing):
            if groups:
                self._scene(nth, deque(group[::-1] for group in groups))
        while self._crew.flying():
            self._land()

    def _scene(self, nth: int, waiting: deque[list[int]]) -> None:
        self._crew.forget_unused()
        key = self._crew.share(Shared.of(self._own.plan(), nth, self._own.scene(nth)))
        self._pace = _Pace()
        while waiting:
            while waiting and self._crew.flying() < BATCHES_A_THREAD * self._crew.threads():
                numbers = _taken(waiting, self._pace.size(self._crew.threads()))
                self._crew.start(Task(draw_points, (key,), (numbers,)))
            self._land()

    def _land(self) -> None:
        for task, (rows, seconds) in self._crew.landed():
            [numbers] = task.arguments
            self._own.keep(numbers, rows)
            self._done += len(numbers)
            self._pace.landed(len(numbers), seconds)
        now = time.monotonic()
        if self._progress is not None and (now - self._reported > PROGRESS_EVERY_SECONDS or self._done == self._left):
            self._reported = now
            self._progress(float(self._done), float(self._left), self._crew.status())


class _Measuring:
    """Measures machines of a search; called by Rust, from its own thread."""

    def __init__(self, crew: Crew) -> None:
        self._crew = crew
        self._views: list[str] = []
        self._is_over = threading.Event()

    def width(self) -> int:
        """Number of machines that keep all workers busy."""
        return self._crew.threads()

    def learn(self, view: bytes) -> None:
        """Adds a view."""
        self._views.append(self._crew.share(Shared.of(view)))

    def measure(self, machines: list[str], target: str) -> list[str]:
        """Measurements of machines on all views."""
        parts = min(len(machines), self._crew.threads())
        for part in range(parts):
            self._crew.start(Task(measure_machines, tuple(self._views), (machines[part::parts], target)))
        measured: dict[str, str] = {}
        while self._crew.flying():
            if self._is_over.is_set():
                raise JobError("stopped")
            for task, texts in self._crew.landed():
                measured.update(zip(task.arguments[0], texts, strict=True))
        return [measured[machine] for machine in machines]

    def stop(self) -> None:
        """Stops the measurement."""
        self._is_over.set()


@contextmanager
def measuring(client: Any) -> Iterator[_Measuring]:
    """A crew of a client's workers for a search."""
    with client_of(client) as own:
        crew = Crew(own)
        measures = _Measuring(crew)
        try:
            yield measures
        finally:
            measures.stop()
            crew.cancel()
