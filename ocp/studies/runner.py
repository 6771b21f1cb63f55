"""Carrying out a study: cases go to an executor as soon as the one they start from is finished."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from ocp import checks
from ocp.studies.case_record import Record
from ocp.studies.designs import Case
from ocp.studies.store import LEASE, Store
from ocp.studies.sweeping import in_words
from ocp.studies.worker import Known, Task, Work, compute

AHEAD = 128  # cases given to an executor at a time
PATIENCE = 0.5  # seconds between two looks at what another process does
DIED = "the process that computed it died (killed, or out of memory)"


@dataclass(frozen=True)
class Progress:
    """How far a study is."""

    total: int
    done: int  # finished, in this run or before
    failed: int  # of them
    last: Record | None = None  # finished last


@dataclass(eq=False)
class _State:
    """What is finished, running, and waiting."""

    work: Work
    cases: Sequence[Case]
    ids: Sequence[str]
    parents: Sequence[int | None]
    store: Store
    finished: dict[str, Record]
    again: dict[str, Record]  # failed before, to be tried again
    ready: deque[int] = field(default_factory=deque)
    running: dict[Future[Record], int] = field(default_factory=dict)
    elsewhere: set[int] = field(default_factory=set)  # computed by another process
    failed: int = 0

    def task(self, number: int) -> Task:
        """Return a case with the nearest solved case above it."""
        above, start, structure = self.parents[number], None, None
        while above is not None:
            record = self.finished[self.ids[above]]
            if record.ok:
                content = self.store.solution(record.id)
                if content is not None:  # else a plain function found it, and there is nothing to start from
                    start = Known(record.id, self.cases[above], content)
                    structure = self._structure(record, start)
                break
            above = self.parents[above]
        failed = self.again.get(self.ids[number])
        attempts = failed.attempts + 1 if failed else 1
        return Task(self.ids[number], self.cases[number], start, structure, attempts, failed is not None)

    def _structure(self, record: Record, start: Known) -> Known | None:
        if record.structure is None or record.structure == start.id:
            return start if record.structure else None
        content = self.store.solution(record.structure)
        if content is None:
            return None
        known = self.finished.get(record.structure) or self.store.records([record.structure])[record.structure]
        return Known(record.structure, dict(known.parameters), content)

    @cached_property
    def children(self) -> dict[int, list[int]]:
        """The cases that start from each case."""
        results: dict[int, list[int]] = {}
        for number, above in enumerate(self.parents):
            if above is not None:
                results.setdefault(above, []).append(number)
        return results


def carry_out(
    work: Work,
    cases: Sequence[Case],
    ids: Sequence[str],
    parents: Sequence[int | None],
    store: Store,
    executor: Executor | Callable[[], Executor] | None,
    retry_failed: bool,
    watch: Callable[[Progress], None] | None,
) -> None:
    """Compute all cases that are not stored.

    Args:
        work: what they share.
        cases: all of them.
        ids: of the cases.
        parents: number of the case that each starts from.
        store: open for writing.
        executor: an executor, a function that makes one, or None.
        retry_failed: whether failed cases are tried again.
        watch: called after every case.

    Raises:
        StoreError: the store cannot be written.
        RuntimeError: the given executor broke.
        TypeError: what is to make an executor makes something else.
    """
    known = store.records(ids)
    again = {name: record for name, record in known.items() if retry_failed and not record.ok}
    finished = {name: record for name, record in known.items() if name not in again}
    state = _State(work, cases, ids, parents, store, finished, again)
    state.failed = sum(not record.ok for record in finished.values())
    for number, above in enumerate(parents):
        if ids[number] not in finished and (above is None or ids[above] in finished):
            state.ready.append(number)
    _tell(state, watch, None)
    make: Callable[[], Executor] | None = None if isinstance(executor, Executor) else executor
    pool = executor if isinstance(executor, Executor) else _made(make) if make else None
    try:
        _loop(state, pool, make, watch)
    finally:
        for future in state.running:
            future.cancel()
        store.release()
        if make and pool is not None:
            pool.shutdown(wait=False, cancel_futures=True)


def _loop(
    state: _State, pool: Any, make: Callable[[], Executor] | None, watch: Callable[[Progress], None] | None
) -> None:
    suspects: deque[int] = deque()  # in flight when a process died; tried one by one
    renewed = time.monotonic()
    while state.ready or state.running or state.elsewhere or suspects:
        limit = 1 if suspects or pool is None else AHEAD
        while len(state.running) < limit and (suspects or state.ready):
            number = (suspects if suspects else state.ready).popleft()
            if not _taken(state, number, watch):
                continue
            task = state.task(number)
            state.running[_submit(pool, state.work, task)] = number
            if pool is None or suspects:
                break
        done, _ = wait(state.running, timeout=PATIENCE, return_when=FIRST_COMPLETED) if state.running else ((), ())
        broken = False
        for future in done:
            number = state.running.pop(future)
            try:
                record = future.result()
            except BrokenExecutor as error:
                if make is None:
                    count = sum(name in state.finished for name in state.ids)
                    raise RuntimeError(
                        f"the executor broke ({in_words(error)}); {count} of {len(state.ids)} cases are stored, "
                        "run again with a new executor to go on"
                    ) from None
                broken = True
                if limit > 1 or state.running:
                    suspects.append(number)
                    continue
                record = _died(state, number)
            except Exception as error:  # of the executor, or something that could not travel
                record = replace(_died(state, number), message=in_words(error))
            # Not within the try: what goes wrong with the store is no failure of the case.
            _finish(state, number, record, watch)
        if broken and make is not None:
            suspects += [number for number in state.running.values() if number not in suspects]
            state.running.clear()
            pool.shutdown(wait=False, cancel_futures=True)
            pool = _made(make)
        if time.monotonic() - renewed > LEASE / 4.0:
            state.store.renew()
            renewed = time.monotonic()
        if state.elsewhere:
            _look(state, watch)


def _made(make: Callable[[], Executor]) -> Executor:
    """Return a new executor."""
    pool = make()
    told = f"executor: {checks.shown(make)} made"
    checks.instance(told, pool, Executor, "a concurrent.futures.Executor")
    return pool


def _taken(state: _State, number: int, watch: Callable[[Progress], None] | None) -> bool:
    """Return whether this process is to compute a case; what another one has finished is taken over."""
    name = state.ids[number]
    if not state.store.claim(name):
        state.elsewhere.add(number)
        return False
    record = state.store.records([name]).get(name)
    if record is None or (name in state.again and record.attempts <= state.again[name].attempts):
        return True
    _finish(state, number, record, watch, stored=True)
    return False


def _look(state: _State, watch: Callable[[Progress], None] | None) -> None:
    """See what other processes have finished, or given up."""
    if not state.running and not state.ready:
        time.sleep(PATIENCE)
    numbers, state.elsewhere = sorted(state.elsewhere), set()
    for number in numbers:
        if _taken(state, number, watch):
            state.ready.append(number)


def _finish(
    state: _State, number: int, record: Record, watch: Callable[[Progress], None] | None, stored: bool = False
) -> None:
    if not stored:
        state.store.finish(state.work.token, record)
    state.finished[record.id] = replace(record, solutions={})
    state.failed += not record.ok
    state.ready.extend(k for k in state.children.get(number, ()) if state.ids[k] not in state.finished)
    _tell(state, watch, record)


def _died(state: _State, number: int) -> Record:
    failed = state.again.get(state.ids[number])
    attempts = failed.attempts + 1 if failed else 1
    return Record(state.ids[number], state.cases[number], "failed", "", DIED, attempts=attempts)


def _tell(state: _State, watch: Callable[[Progress], None] | None, last: Record | None) -> None:
    if watch is not None:
        watch(Progress(len(state.ids), len(state.finished), state.failed, last))


def _submit(pool: Any, work: Work, task: Task) -> Future[Record]:
    """Give a task to a pool, or compute it at once."""
    if pool is not None:
        future: Future[Record] = pool.submit(compute, work, task)
        return future
    done: Future[Record] = Future()
    done.set_result(compute(work, task))
    return done
