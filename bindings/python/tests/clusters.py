"""Local clusters for tests: the scheduler and the workers are separate processes, which can be killed."""

import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import splatsim

#: Processes use the tested package. The scheduler tolerates no death of a worker, so that tasks must be submitted again.
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": str(Path(splatsim.__file__).parents[1]),
    "PYTHONDONTWRITEBYTECODE": "1",
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
}


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Cluster:
    """A scheduler on a port, and workers, as processes that only this class restarts."""

    def __init__(self, folder):
        self.folder, self.port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler, self.workers, self.killed = None, [], 0

    def _start(self, name, *arguments):
        log = open(self.folder / f"{name}.log", "ab")
        command = [sys.executable, "-m", "distributed.cli." + arguments[0], *map(str, arguments[1:])]
        return subprocess.Popen(command, cwd=self.folder, env=ENVIRONMENT, stdout=log, stderr=log)

    def start_scheduler(self):
        self.scheduler = self._start("scheduler", "dask_scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard")

    def start_workers(self, count=2):
        for _ in range(count):
            arguments = ["--nthreads", 1, "--no-nanny", "--no-dashboard", "--memory-limit", 0, "--death-timeout", 20]
            self.workers.append(self._start("workers", "dask_worker", self.address, *arguments))

    def kill_worker(self):
        """Kills one with SIGKILL, and starts another."""
        living = [worker for worker in self.workers if worker.poll() is None]
        if living:
            random.choice(living).kill()
            self.killed += 1
            self.start_workers(1)

    def kill_scheduler(self):
        self.scheduler.send_signal(signal.SIGKILL)
        self.scheduler.wait()

    def close(self):
        for process in [self.scheduler, *self.workers]:
            process.kill()
            process.wait()

    def __enter__(self):
        self.start_scheduler()
        self.start_workers()
        return self

    def __exit__(self, *_):
        self.close()


def repeatedly(seconds, act):
    """Calls a function repeatedly on another thread; returns a function that stops it."""
    is_over = threading.Event()

    def work():
        while not is_over.wait(seconds * random.uniform(0.5, 1.5)):
            act()

    thread = threading.Thread(target=work)
    thread.start()

    def end():
        is_over.set()
        thread.join()

    return end


def wait_for(what, seconds=30):
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline, "the condition was never met"
        time.sleep(0.02)
