"""Store of studies: one SQLite file with cases, results and solutions, written in transactions."""

from __future__ import annotations

import contextlib
import os
import socket
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ocp import checks
from ocp.studies.case_result import COLUMNS, CaseResult, from_json, from_row, to_json, to_row

APPLICATION = 0x48414D4C  # "HAML", the application id in the header of the file
SCHEMA = 1
MAGIC = b"SQLite format 3\0"
BUSY = 60.0  # seconds to wait while another process writes
LEASE = 60.0  # seconds after which a case claimed on another host is free again
CHUNK = 500  # identities in one query
TABLES = """
create table studies (id text primary key, created text not null, about text not null);
create table cases (
    id text primary key,         -- hash of the content: problem, values, settings, versions
    study text not null,
    parameters text not null,    -- JSON
    status text not null,        -- 'solved', 'failed', or the status of a solution
    way text not null,           -- how it was found
    message text not null,
    origin text,                 -- id of the case it started from
    structure text,              -- id of the case whose switching structure it has
    results text not null,       -- JSON, name -> number
    timings text not null,       -- JSON, name -> seconds
    attempts integer not null,
    finished text not null,      -- UTC
    host text not null
);
create table solutions (id text not null, name text not null, content blob not null, primary key (id, name));
create table claims (id text primary key, host text not null, pid integer not null, until real not null);
"""


class StoreError(OSError):
    """A store cannot be read or written; the message is one sentence with the file and the reason."""


class Store:
    """An open store of study results; several processes may have the same file open at once.

    Args:
        path: of the file; created if there is none. None for a store in memory, which is lost with this object.
        write: False to read only.

    Raises:
        TypeError, ValueError: path is no path of a file, or write neither True nor False.
        StoreError: the file is no store, is damaged, of a newer version, or cannot be written; it is left unchanged.
    """

    def __init__(self, path: str | os.PathLike[str] | None, write: bool = True) -> None:
        checks.truth("write", write)
        self.path = Path("memory") if path is None else checks.path("path", path)
        self._host, self._pid = socket.gethostname(), os.getpid()
        if path is None:
            self._connection = sqlite3.connect(":memory:", isolation_level=None)
            self._set_up()
            return
        with self._as_store_error("cannot be opened"):
            fresh = not self.path.exists() or self.path.stat().st_size == 0
            if fresh and not write:
                raise StoreError(f"{self.path}: there is no such store")
            if not fresh:
                self._examine()
            self._connection = self._connect("rwc" if write else "rw")
        try:
            if write:
                self._set_up()
            else:
                self._read_only()
        except BaseException:
            self._connection.close()
            raise

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def begin(self, study: str, about: Mapping[str, Any]) -> None:
        """Store the settings of a study, unless they are stored already."""
        checks.text("study", study)
        words = to_json("about", about)
        with self._transaction() as connection:
            connection.execute("insert or ignore into studies values (?, ?, ?)", (study, now(), words))

    def studies(self) -> dict[str, dict[str, Any]]:
        """Return identity -> settings of the studies in the store, oldest first."""
        with self._as_store_error("cannot be read"):
            rows = self._connection.execute("select id, about from studies order by rowid").fetchall()
            return {name: from_json("about", about) for name, about in rows}

    def records(self, ids: Iterable[str]) -> dict[str, CaseResult]:
        """Return identity -> result of those cases that are finished, without their solutions."""
        results: dict[str, CaseResult] = {}
        wanted = checks.several("ids", ids, "a list of identities")
        for one in wanted:
            checks.text("ids, each", one)
        with self._as_store_error("cannot be read"):
            for first in range(0, len(wanted), CHUNK):
                part = wanted[first : first + CHUNK]
                marks = ", ".join("?" * len(part))
                for row in self._connection.execute(f"select {COLUMNS} from cases where id in ({marks})", part):
                    results[row[0]] = from_row(row)
        return results

    def of_study(self, study: str) -> list[str]:
        """Return the identities of the finished cases that were computed for a study, oldest first."""
        checks.text("study", study)
        with self._as_store_error("cannot be read"):
            rows = self._connection.execute("select id from cases where study = ? order by rowid", (study,)).fetchall()
        return [row[0] for row in rows]

    def solution(self, case: str, name: str = "solution") -> bytes | None:
        """Return the content of a stored solution file, or None if there is none."""
        checks.text("case", case)
        checks.text("name", name)
        with self._as_store_error("cannot be read"):
            row = self._connection.execute(
                "select content from solutions where id = ? and name = ?", (case, name)
            ).fetchone()
            if row is not None:
                checks.instance("solution", row[0], bytes, "the content of a solution file")
        return None if row is None else bytes(row[0])

    def finish(self, study: str, record: CaseResult) -> None:
        """Store the result of a case with its solutions and delete the claim on it, in one transaction."""
        checks.text("study", study)
        checks.instance("record", record, CaseResult, "the CaseResult of a case")
        row = to_row(replace(record, finished=record.finished or now(), host=record.host or self._host))
        marks = ", ".join("?" * len(row))
        with self._transaction() as connection:
            connection.execute(f"insert or replace into cases (study, {COLUMNS}) values (?, {marks})", (study, *row))
            connection.execute("delete from solutions where id = ?", (record.id,))
            connection.executemany(
                "insert into solutions values (?, ?, ?)", [(record.id, n, c) for n, c in record.solutions.items()]
            )
            connection.execute("delete from claims where id = ?", (record.id,))

    def claim(self, case: str) -> bool:
        """Reserve a case for this process; False if another living process has reserved it."""
        checks.text("case", case)
        with self._transaction() as connection:
            row = connection.execute("select host, pid, until from claims where id = ?", (case,)).fetchone()
            if row is not None and (row[0], row[1]) != (self._host, self._pid) and self._lives(*row):
                return False
            connection.execute(
                "insert or replace into claims values (?, ?, ?, ?)", (case, self._host, self._pid, time.time() + LEASE)
            )
        return True

    def renew(self) -> None:
        """Extend the reservations of this process by another lease."""
        with self._transaction() as connection:
            connection.execute(
                "update claims set until = ? where host = ? and pid = ?", (time.time() + LEASE, self._host, self._pid)
            )

    def release(self) -> None:
        """Delete the reservations of this process for cases that it has not finished."""
        with self._transaction() as connection:
            connection.execute("delete from claims where host = ? and pid = ?", (self._host, self._pid))

    def _lives(self, host: str, pid: int, until: float) -> bool:
        if host != self._host:
            return until > time.time()
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        except PermissionError:
            return True
        return True

    def _examine(self) -> None:
        """Raise StoreError for a file that is no store, without writing to it."""
        with self.path.open("rb") as file:
            head = file.read(100)
        if not head.startswith(MAGIC) or len(head) < 100:
            raise StoreError(f"{self.path}: is no store of studies (no SQLite file); it is left unchanged")
        application, schema = int.from_bytes(head[68:72], "big"), int.from_bytes(head[60:64], "big")
        if application != APPLICATION:
            raise StoreError(f"{self.path}: is an SQLite file of another program; it is left unchanged")
        if schema > SCHEMA:
            raise StoreError(f"{self.path}: has schema version {schema}, expected up to {SCHEMA}; update the program")

    def _connect(self, mode: str) -> sqlite3.Connection:
        address = f"{self.path.absolute().as_uri()}?mode={mode}"
        return sqlite3.connect(address, uri=True, timeout=BUSY, isolation_level=None)

    def _read_only(self) -> None:
        """Open for reading only, also on a medium that cannot be written to."""
        try:
            with self._as_store_error("cannot be read", sqlite3.OperationalError):
                # A connection that may write deletes the write-ahead log when it closes.
                self._connection.execute("pragma query_only = on")
                self._connection.execute("select count(*) from studies")
        except sqlite3.OperationalError:
            self._connection.close()
            with self._as_store_error("cannot be read"):
                self._connection = self._connect("ro&immutable=1")
                self._connection.execute("select count(*) from studies")

    def _set_up(self) -> None:
        with self._as_store_error("cannot be used"):
            connection = self._connection
            result = connection.execute("pragma quick_check(1)").fetchone()
            if result is None or result[0] != "ok":
                reason = " ".join(str(result[0] if result else "unreadable").split())
                raise StoreError(f"{self.path}: is damaged ({reason}); it is left unchanged")
            if connection.execute("pragma application_id").fetchone()[0] != APPLICATION:
                connection.execute("begin immediate")
                # Another process may have been faster.
                if connection.execute("pragma application_id").fetchone()[0] != APPLICATION:
                    for statement in TABLES.split(";"):
                        connection.execute(statement)
                    connection.execute(f"pragma user_version = {SCHEMA}")
                    connection.execute(f"pragma application_id = {APPLICATION}")
                connection.execute("commit")
            # Only now, so that the file has its application id even if the process is killed here.
            connection.execute("pragma journal_mode = wal")
            connection.execute("pragma synchronous = normal")
        with self._transaction() as connection:
            # A store that cannot be written is refused before the first case is computed, not after it.
            connection.execute("delete from claims where until < ?", (time.time() - 100.0 * LEASE,))

    @contextlib.contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._as_store_error("cannot be written"):
            self._connection.execute("begin immediate")
            try:
                yield self._connection
                self._connection.execute("commit")
            except BaseException:
                with contextlib.suppress(sqlite3.Error):
                    self._connection.execute("rollback")
                raise

    @contextlib.contextmanager
    def _as_store_error(self, what: str, *but: type[sqlite3.Error]) -> Iterator[None]:
        """Turn errors of SQLite, of the file system and of unreadable rows into a StoreError."""
        try:
            yield
        except but:
            raise
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {what}: {error}; what was stored before is kept") from error
        except StoreError:
            raise
        except OSError as error:
            raise StoreError(f"{self.path}: {what}: {error.strerror or error}") from error
        except (TypeError, ValueError) as error:
            raise StoreError(f"{self.path}: is damaged: {error}") from error


def now() -> str:
    """Return the time in UTC, to the second."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
