"""The two databases of a soak: how large they are, and whether their tables agree at the end."""

import contextlib
import sqlite3

import programs
from sampling import COUNTED, COUNTED_SHARED, by_unit, count_rows

# What must hold when all jobs have ended and upkeep has finished: a name, and a statement that counts exceptions.
RULES = [
    ("unfinished runs", "SELECT count(*) FROM run WHERE finished IS NULL"),
    ("unfinished jobs", "SELECT count(*) FROM job WHERE finished IS NULL"),
    ("runs without jobs", "SELECT count(*) FROM run WHERE NOT EXISTS (SELECT 1 FROM job WHERE job.run = run.id)"),
    ("jobs whose run is missing",
     "SELECT count(*) FROM job WHERE run IS NOT NULL AND NOT EXISTS (SELECT 1 FROM run WHERE run.id = job.run)"),
    ("chunks without a study",
     "SELECT count(*) FROM chunk WHERE NOT EXISTS (SELECT 1 FROM study WHERE study.run = chunk.run)"),
    ("results without a body", "SELECT count(*) FROM result WHERE evicted IS NULL"
     " AND NOT EXISTS (SELECT 1 FROM result_blob WHERE result_blob.key = result.key)"),
    ("bodies of evicted results",
     "SELECT count(*) FROM result_blob JOIN result USING (key) WHERE evicted IS NOT NULL"),
    ("results without a scenario", "SELECT count(*) FROM result"
     " WHERE NOT EXISTS (SELECT 1 FROM result_task WHERE result_task.key = result.key)"),
]
# The tables of PostgreSQL that keep evicted results for a year, and all that are watched.
FOR_A_YEAR = {"result", "result_task", "outline"}
WATCHED = FOR_A_YEAR | {"job", "run", "result_blob", "study", "chunk", "lease", "turn", "job_tag", "upkeep"}
# How many pieces of ended studies upkeep has not deleted yet.
LEFT = "SELECT count(*) FROM study LEFT JOIN run ON run.id = study.run WHERE run.id IS NULL OR finished IS NOT NULL"


class Sqlite(programs.Sqlite):
    """The database of one server."""

    # `--keep-results` bounds the whole database, and deletes jobs, too. It must be reached in the first minutes.
    evicts_jobs = True
    keep_results = 96 << 20

    def query(self, sql):
        """The rows of a statement."""
        with contextlib.closing(sqlite3.connect(f"file:{self.file}?mode=ro", uri=True, timeout=30)) as db:
            return db.execute(sql).fetchall()

    def value(self, sql):
        """The first number of the answer."""
        return self.query(sql)[0][0]

    def sizes(self):
        """Rows of each table, and the sizes of the files."""
        rows = by_unit(COUNTED, self.query(count_rows(COUNTED)))
        file, log = (path.stat().st_size if path.exists() else 0
                     for path in (self.file, self.file.with_name("fretwork.db-wal")))
        return rows | {("MiB on disk", "database"): file / 2**20, ("MiB on disk", "log"): log / 2**20}

    def room(self, sample):
        """The bytes that --keep-results limits."""
        return sample["MiB on disk", "database"] * 2**20

    def faults(self):
        """What is wrong with the tables after the server has ended."""
        sound = self.query("PRAGMA integrity_check"), self.query("PRAGMA foreign_key_check")
        found = [] if sound == ([("ok",)], []) else [f"integrity and foreign keys: {sound}"]
        stored = "SELECT coalesce(sum(stored), 0) FROM result WHERE evicted IS NULL"
        used, counted = self.value("SELECT used FROM room"), self.value(stored)
        found += [] if used == counted else [f"the bodies have {counted} bytes, but {used} are counted"]
        return found + broken_rules(self, RULES)


class Postgres(programs.Postgres):
    """The database of several servers."""

    # `--keep-results` bounds the bodies of results.
    evicts_jobs = False
    keep_results = 32 << 20

    def sizes(self):
        """Rows, dead rows and size of each table with its indexes."""
        counted = COUNTED | COUNTED_SHARED
        rows = by_unit(counted, self.query(count_rows(counted)))
        results = rows["rows", "result"] + rows["rows for a year", "evicted result"]
        found = [(table, int(dead), int(size)) for table, dead, size in self.query(
            "SELECT relname, n_dead_tup, pg_total_relation_size(relid) FROM pg_stat_user_tables")]
        dead = {("dead rows", table): dead for table, dead, _ in found if table in WATCHED}
        size = {("MiB on disk", table): size / 2**20 for table, _, size in found if table in WATCHED - FOR_A_YEAR}
        size |= {("bytes per row", table): size / max(results, 1) for table, _, size in found if table in FOR_A_YEAR}
        whole = {("MiB in total", "database"): self.value("SELECT pg_database_size(current_database())") / 2**20}
        connections = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database()"
        return rows | dead | size | whole | {("connections", "database"): self.value(connections)}

    def room(self, _):
        """The bytes that --keep-results limits."""
        return self.value("SELECT coalesce(sum(stored), 0) FROM result WHERE evicted IS NULL")

    def faults(self):
        """What is wrong with the tables after the servers have ended."""
        more = [
            ("leases", "SELECT count(*) FROM lease"),
            ("claimable jobs", "SELECT count(*) FROM job WHERE claimable IS NOT NULL"),
            ("open transactions", "SELECT count(*) FROM pg_stat_activity WHERE state LIKE 'idle in transaction%'"),
            ("deadlocks", "SELECT deadlocks FROM pg_stat_database WHERE datname = current_database()"),
        ]
        return broken_rules(self, RULES + more)


def broken_rules(database, rules):
    """The rules that do not hold."""
    counted = [(what, database.value(sql)) for what, sql in rules]
    return [f"{count:.0f} {what}" for what, count in counted if count]
