"""Reads every job and every result after a soak."""

import concurrent.futures
import datetime
import hashlib
import threading
import time

from programs import Client

READERS = 4
# Seconds in which the queue must become empty, and upkeep must have deleted what is not needed.
DRAIN, UPKEEP = 120, 240
# Seconds in which all jobs are listed. Meanwhile upkeep may delete the oldest ones.
READING = 15
# Seconds for which a result may be refused.
REFUSED = 30
UNFINISHED = ("queued", "running", "canceling")


def created(job):
    """When a job was submitted: its id is a UUID of version 7."""
    return int(job.replace("-", "")[:12], 16) / 1000


def finished(jobs):
    """When each of the finished jobs ended."""
    ends = [job["times"]["finished"] for job in jobs]
    return [datetime.datetime.fromisoformat(end).timestamp() for end in ends if end]


class Checker:
    """Checks what is left, against what the users were told."""

    def __init__(self, port, report, keep_jobs, evicts_jobs):
        self.port, self.report = port, report
        self.keep_jobs, self.evicts_jobs = keep_jobs, evicts_jobs
        self.client = Client(port)
        self.faults, self.notes = [], []
        self.local = threading.local()

    def jobs(self):
        """All jobs by id."""
        return {job["id"]: job for job in self.client.pages("/v1/jobs?limit=200", "jobs")}

    def check_jobs(self):
        """Each acknowledged job must be there, unless it was deleted, and must end."""
        stopped = time.time()
        found = self.jobs()
        oldest = stopped - self.keep_jobs + READING
        if self.evicts_jobs:
            # A job is deleted after those that had ended when it was submitted.
            oldest = max(oldest, min(finished(found.values()), default=stopped))
        expected = {job for job in self.report.jobs if created(job) > oldest} - self.report.deleted
        if missing := expected - found.keys():
            what = f"{len(missing)} of {len(expected)} acknowledged jobs are missing"
            self.faults.append(f"{what}, such as {min(missing)}")
        drained = self.drain()
        for job in [job for job in found.values() if job["state"] in UNFINISHED]:
            answer, _ = self.client.ask("GET", f"/v1/jobs/{job['id']}")
            if answer.status != 200 and created(job["id"]) > time.time() - self.keep_jobs + READING:
                self.faults.append(f"the unfinished job {job['id']} has gone")
        ended = self.jobs()
        failed = [job for job in ended.values() if job["state"] == "failed"]
        if failed:
            self.faults.append(f"{len(failed)} jobs have failed, such as {failed[0]}")
        self.notes.append(f"{len(found)} jobs were found, with the {len(expected)} that were acknowledged and are young"
                          f" enough; the queue was empty after {drained:.0f} s")
        return ended

    def drain(self):
        """Waits until all jobs have ended. Returns how long it took."""
        started = time.time()
        while any(self.client.json("GET", f"/v1/jobs?limit=1&state={state}")["jobs"] for state in UNFINISHED):
            if time.time() > started + DRAIN:
                self.faults.append(f"there are unfinished jobs {DRAIN} s after the load")
                break
            time.sleep(0.5)
        return time.time() - started

    def check_results(self, jobs):
        """Each listed result must have the digest of its provenance, and each succeeded job must have a result."""
        stored = {found["key"] for found in self.client.pages("/v1/results?limit=1000", "results")}
        evicted = {found["key"] for found in self.client.pages("/v1/results?limit=1000&evicted=true", "results")}
        with concurrent.futures.ThreadPoolExecutor(READERS) as pool:
            for fault in filter(None, pool.map(self.check_result, stored)):
                self.faults.append(fault)
        succeeded = {job["key"] for job in jobs.values() if job["state"] == "succeeded"}
        if lost := succeeded - stored - evicted:
            self.faults.append(f"{len(lost)} results of succeeded jobs are unknown, such as {min(lost)}")
        self.notes.append(f"{len(stored)} results were read, {len(evicted)} are evicted")

    def check_result(self, key):
        """The fault of a result, if it has one."""
        if not hasattr(self.local, "client"):
            self.local.client = Client(self.port)
        answer, body = self.local.client.ask("GET", f"/v1/results/{key}", Accept_Encoding="identity")
        until = time.time() + REFUSED
        while answer.status == 503 and time.time() < until:
            # Another reader has a large result, which may take the whole memory of one caller.
            time.sleep(0.1)
            answer, body = self.local.client.ask("GET", f"/v1/results/{key}", Accept_Encoding="identity")
        # Upkeep may have evicted it since it was listed.
        if answer.status == 410:
            return None
        known = self.local.client.json("GET", f"/v1/results/{key}/provenance")["body"]
        is_right = answer.status == 200 and answer.getheader("etag") == f"\"{key}\""
        is_right &= known == {"bytes": len(body), "sha256": hashlib.sha256(body).hexdigest()}
        if is_right:
            return None
        told = body[:300] if answer.status != 200 else f"{len(body)} bytes"
        return f"the result {key} is not as in its provenance: {answer.status}, {told}, {known}"

    def await_upkeep(self, database, left):
        """Waits until upkeep has deleted the pieces of all studies."""
        started = time.time()
        while count := database.value(left):
            if time.time() > started + UPKEEP:
                self.faults.append(f"upkeep has not deleted the pieces of {count:.0f} ended studies in {UPKEEP} s")
                break
            time.sleep(1)
        self.notes.append(f"upkeep had deleted the pieces of studies after {time.time() - started:.0f} s")
