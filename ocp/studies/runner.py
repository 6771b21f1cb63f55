"""Run of a study: each case goes to the executor as soon as the case that it starts from is finished."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field, replace
from typing import Any

from ocp import checks
from ocp.studies.case_result import CaseResult
from ocp.studies.case_solver import OpenCase, SolvedCase
from ocp.studies.neighbour_check import ROUNDS, compared, open_comparisons
from ocp.studies.plan import Plan, Progress
from ocp.studies.sending import ADVICE, NotSentError, let_end_with_parent, sendable
from ocp.studies.store import LEASE, Store
from ocp.studies.sweeping import in_words
from ocp.studies.warm_start_tree import nearest
from ocp.studies.worker import compute, compute_for

AHEAD = 128  # cases submitted to an executor at a time
POLL = 0.5  # seconds between two looks at the cases of other processes
DIED = "the process that computed it died (killed, or out of memory)"

Watch = Callable[[Progress], None] | None


@dataclass(eq=False)
class _Run:
    """Cases of a study that are finished, ready, or being computed."""

    plan: Plan
    store: Store
    watch: Watch
    finished: dict[str, CaseResult]
    retried: dict[str, CaseResult]  # failed results of an earlier run, to be replaced
    ready: deque[int] = field(default_factory=deque)
    running: dict[Future[CaseResult], int] = field(default_factory=dict)
    elsewhere: set[int] = field(default_factory=set)  # computed by another process that uses the store
    failed: int = 0
    solved: Sequence[int] = ()  # cases that were solved before this run
    sent: Any = None  # the settings as they are sent to a worker process
    arrived: bool = False  # whether a worker process has returned a result

    def task(self, number: int) -> OpenCase:
        """Return a case to be computed, with the nearest solved case above it in the tree."""
        parent, neighbour, structure = self.plan.parents[number], None, None
        if self.plan.ids[number] in self.retried and self.plan.settings.neighbours:
            parent = nearest(self.plan.cases, number, self.solved)
        while parent is not None:
            result = self.finished[self.plan.ids[parent]]
            if result.ok:
                content = self.store.solution(result.id)
                if content is not None:  # a function that returns numbers leaves no solution
                    neighbour = SolvedCase(result.id, self.plan.cases[parent], content)
                    structure = self._structure(result, neighbour)
                break
            parent = self.plan.parents[parent]
        name = self.plan.ids[number]
        return OpenCase(
            name, self.plan.cases[number], neighbour, structure, self._attempts(number), name in self.retried
        )

    def _structure(self, result: CaseResult, neighbour: SolvedCase) -> SolvedCase | None:
        if result.structure is None or result.structure == neighbour.id:
            return neighbour if result.structure else None
        content = self.store.solution(result.structure)
        if content is None:
            return None
        origin = self.finished.get(result.structure) or self.store.records([result.structure])[result.structure]
        return SolvedCase(result.structure, dict(origin.parameters), content)

    def _attempts(self, number: int) -> int:
        earlier = self.retried.get(self.plan.ids[number])
        return earlier.attempts + 1 if earlier else 1

    def is_ours(self, number: int) -> bool:
        """Return whether this process computes a case; a result that another process has stored is taken over."""
        name = self.plan.ids[number]
        if not self.store.claim(name):
            self.elsewhere.add(number)
            return False
        result = self.store.records([name]).get(name)
        if result is None or (name in self.retried and result.attempts <= self.retried[name].attempts):
            return True
        self.take(number, result)
        return False

    def finish(self, number: int, result: CaseResult) -> None:
        """Store a result and make the cases ready that start from it."""
        self.store.finish(self.plan.settings.identity, result)
        self.take(number, result)

    def take(self, number: int, result: CaseResult) -> None:
        """Note a result that is stored and make the cases ready that start from it."""
        self.finished[result.id] = replace(result, solutions={})
        self.failed += not result.ok
        children = self.plan.children.get(number, ())
        self.ready.extend(k for k in children if self.plan.ids[k] not in self.finished)
        self.tell(result)

    def tell(self, last: CaseResult | None = None) -> None:
        """Call the watcher with the progress."""
        if self.watch is not None:
            self.watch(Progress(len(self.plan.ids), len(self.finished), self.failed, last))

    def look_elsewhere(self) -> None:
        """Take over what other processes have finished, and the cases of processes that are gone."""
        if not self.running and not self.ready:
            time.sleep(POLL)
        numbers, self.elsewhere = sorted(self.elsewhere), set()
        self.ready.extend(number for number in numbers if self.is_ours(number))

    def failure(self, number: int, message: str) -> CaseResult:
        """Return the result of a case whose process returned none."""
        name, case = self.plan.ids[number], self.plan.cases[number]
        return CaseResult(name, case, "failed", "", message, attempts=self._attempts(number))


def carry_out(
    plan: Plan, store: Store, executor: Executor | Callable[[], Executor] | None, retry_failed: bool, watch: Watch
) -> None:
    """Compute all cases that are not stored.

    Args:
        plan: the cases.
        store: open for writing.
        executor: an executor, a function that makes one, or None.
        retry_failed: whether failed cases are tried again.
        watch: called after every case.

    Raises:
        StoreError: the store cannot be written.
        RuntimeError: the given executor broke.
        TypeError: the function that should make an executor returned something else.
        NotSentError: the settings cannot be sent to the processes of the executor; nothing is stored.
    """
    stored = store.records(plan.ids)
    retried = {name: result for name, result in stored.items() if retry_failed and not result.ok}
    finished = {name: result for name, result in stored.items() if name not in retried}
    run = _Run(plan, store, watch, finished, retried)
    run.solved = [k for k, name in enumerate(plan.ids) if name in stored and stored[name].ok]
    run.failed = sum(not result.ok for result in finished.values())
    for number, parent in enumerate(plan.parents):
        if plan.ids[number] not in finished and (parent is None or plan.ids[parent] in finished):
            run.ready.append(number)
    run.tell()
    make: Callable[[], Executor] | None = None if isinstance(executor, Executor) else executor
    pool = executor if isinstance(executor, Executor) else _made(make) if make else None
    run.sent = sendable(plan.settings, pool)
    if run.ready:
        let_end_with_parent(pool)
    try:
        pool = _loop(run, pool, make)
        if plan.settings.neighbours:
            _compare_neighbours(run, pool)
    finally:
        for future in run.running:
            future.cancel()
        store.release()
        if make and pool is not None:
            pool.shutdown(wait=False, cancel_futures=True)


def _loop(run: _Run, pool: Any, make: Callable[[], Executor] | None) -> Any:
    """Compute all cases; returns the pool, which may be another one than before."""
    suspects: deque[int] = deque()  # being computed when a process died; tried again one by one
    renewed = time.monotonic()
    while run.ready or run.running or run.elsewhere or suspects:
        alone = bool(suspects)
        _submit(run, pool, suspects)
        done, _ = wait(run.running, timeout=POLL, return_when=FIRST_COMPLETED) if run.running else ((), ())
        broken = False
        for future in done:
            number = run.running.pop(future)
            try:
                result = future.result()
                run.arrived = True
            except BrokenExecutor as error:
                if make is None:
                    raise _broken(run, error) from None
                broken = True
                if not alone or run.running:
                    suspects.append(number)
                    continue
                result = run.failure(number, DIED)
            except Exception as error:  # of the executor, or of sending the case and its result
                if not run.arrived and type(error).__name__ != "KilledWorker":
                    raise NotSentError(f"no case could be sent to the executor ({in_words(error)}); {ADVICE}") from None
                result = run.failure(number, in_words(error))
            # Not within the try: an error of the store is no failure of the case.
            run.finish(number, result)
        if broken and make is not None:
            suspects += [number for number in run.running.values() if number not in suspects]
            run.running.clear()
            pool.shutdown(wait=False, cancel_futures=True)
            pool = _made(make)
            let_end_with_parent(pool)
        if time.monotonic() - renewed > LEASE / 4.0:
            run.store.renew()
            renewed = time.monotonic()
        if run.elsewhere:
            run.look_elsewhere()
    return pool


def _compare_neighbours(run: _Run, pool: Any) -> None:
    """Solve neighbours between which the cost jumps from each other, and keep the better solution of each case."""
    plan = run.plan
    for _ in range(ROUNDS):
        results = [run.finished.get(name) for name in plan.ids]
        futures = []
        for number, other in open_comparisons(plan.cases, results):
            content = run.store.solution(plan.ids[other])
            if content is not None:
                neighbour = SolvedCase(plan.ids[other], plan.cases[other], content)
                task = OpenCase(plan.ids[number], plan.cases[number], neighbour, compare=True)
                near = run.finished[plan.ids[other]]  # as it is now; a later comparison may replace it
                futures.append((number, near, _started(run, pool, task)))
        if not futures:
            return
        for number, near, future in futures:
            old = run.finished[plan.ids[number]]
            try:
                new = future.result()
            except Exception as error:
                raise _broken(run, error) from None
            files = {"solution": run.store.solution(old.id) or b""}
            kept = compared(old, new, near, files)
            run.store.finish(plan.settings.identity, kept)
            run.finished[old.id] = replace(kept, solutions={})


def _started(run: _Run, pool: Any, task: OpenCase) -> Future[CaseResult]:
    """Submit a case to the pool, or compute it at once if there is none."""
    if pool is not None:
        future: Future[CaseResult] = pool.submit(compute_for, os.getpid(), run.sent, task)
        return future
    done: Future[CaseResult] = Future()
    done.set_result(compute(run.plan.settings, task))
    return done


def _submit(run: _Run, pool: Any, suspects: deque[int]) -> None:
    """Submit cases until enough are in flight; without an executor compute one."""
    limit = 1 if suspects or pool is None else AHEAD
    while len(run.running) < limit and (suspects or run.ready):
        number = (suspects if suspects else run.ready).popleft()
        if not run.is_ours(number):
            continue
        run.running[_started(run, pool, run.task(number))] = number
        if limit == 1:
            break


def _made(make: Callable[[], Executor]) -> Executor:
    """Return a new executor."""
    pool = make()
    checks.instance(f"executor: {checks.shown(make)} made", pool, Executor, "a concurrent.futures.Executor")
    return pool


def _broken(run: _Run, error: Exception) -> RuntimeError:
    count = sum(name in run.finished for name in run.plan.ids)
    return RuntimeError(
        f"the executor broke ({in_words(error)}); {count} of {len(run.plan.ids)} cases are stored, "
        "run again with a new executor to go on"
    )
