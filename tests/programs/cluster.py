"""What a cluster costs and gains on this computer: points a second of one process, and of 1, 2 and 4 workers, in one run.

    python3 tests/programs/cluster.py [POINTS]

Needs the Python package with `splatsim[cluster]`. Two sweeps: of points that take next to nothing, whose time is the overhead, and of points
that draw a frame each. Columns: points a second, and milliseconds a point, by the clock; processor milliseconds a point, of all processes
together, and how many more than in one process; bytes of rows a point, and files. Timed from the call to the table, the workers being up.
"""

import sys
import tempfile
import time
from pathlib import Path

import distributed

import splatsim

SCENE = '{"splats": {"builtin": "glass-spheres", "count": 300}}'


def cheap(points):
    """One frame, and its time with many FIFOs and latencies."""
    rows = -(-points // 64)
    axes = [{"field": "timing.raster.fifo", "range": [1, 64, 1]}, {"field": "timing.shade.latency", "range": [10, 9 + rows, 1]}]
    return {"size": [16, 12], "axes": axes, "lockstep": False}


def drawn(points):
    """A frame and its lockstep for each."""
    axes = [{"field": "gauss.weight", "add_frac_bits": list(range(-7, 1))}, {"field": "splat.rgb", "add_frac_bits": list(range(0, -(-points // 8)))}]
    return {"size": [160, 120], "axes": axes}


def spent(client):
    """Processor seconds of this process, which the scheduler is in, and of all workers."""
    return time.process_time() + (0 if client is None else sum(client.run(time.process_time).values()))


def timed(plan, folder, client=None):
    """The rows, seconds, and processor seconds."""
    before, start = spent(client), time.perf_counter()
    rows = splatsim.sweep(plan, folder, client=client).table
    seconds = time.perf_counter() - start
    return own(rows), seconds, spent(client) - before


def own(table):
    """Without what differs from run to run."""
    return table.select([name for name in table.column_names if not name.startswith("host_")])


def table(name, plan, place):
    (place / "scene.json").write_text(SCENE)
    plan = {"scenes": [str(place / "scene.json")], "machine": "tiny", **plan}
    alone, alone_seconds, alone_spent = timed(plan, place / "alone")
    count = alone.num_rows
    print(f"{count} points, {name}")
    print(f"{'':12} {'points/s':>10} {'ms a point':>10} {'CPU ms':>8} {'more':>6} {'bytes':>7} {'files':>6}")

    def line(what, seconds, cpu, files):
        told = [f"{count / seconds:10.1f}", f"{1000 * seconds / count:10.2f}", f"{1000 * cpu / count:8.2f}"]
        if files:
            told += [f"{1000 * (cpu - alone_spent) / count:6.2f}", f"{sum(files) / count:7.0f}", f"{len(files):6}"]
        print(f"{what:12}", *told, flush=True)

    line("one process", alone_seconds, alone_spent, [])
    for workers in (1, 2, 4):
        settings = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
        with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
            client.wait_for_workers(workers)
            rows, seconds, cpu = timed(plan, place / str(workers), client)
        assert rows.equals(alone), "the rows differ"
        line(f"{workers} worker" + "s" * (workers > 1), seconds, cpu, [path.stat().st_size for path in (place / str(workers) / "points").iterdir()])
    print()


def main():
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 2048
    for name, plan in [("one frame", cheap(points)), ("a frame and its lockstep each", drawn(max(8, points // 32)))]:
        with tempfile.TemporaryDirectory() as place:
            table(name, plan, Path(place))


if __name__ == "__main__":
    main()
