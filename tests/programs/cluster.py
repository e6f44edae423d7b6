"""Measures a sweep on a cluster of this computer: one process, and 1, 2 and 4 workers, in one run.

    python3 tests/programs/cluster.py [POINTS]

Needs the Python package with `splatsim[cluster]`. There are two sweeps: one with very short points,
whose time is the overhead, and one with points that draw a frame each. Columns: points per second
and milliseconds per point, elapsed; processor milliseconds per point of all processes together, and
how many more than in one process; bytes of rows per point, and files. The time is measured from the
call to the table, with workers already started. The last lines are the client's cost per batch and
per row.
"""

import json
import resource
import sys
import tempfile
import time
from pathlib import Path

import distributed

import splatsim
from splatsim import _cluster, _native

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
    """Processor seconds of this process, which includes the scheduler, and of all workers."""
    return time.process_time() + (0 if client is None else sum(client.run(time.process_time).values()))


def timed(plan, folder, client=None):
    """Returns rows, elapsed seconds and processor seconds."""
    before, start = spent(client), time.perf_counter()
    rows = splatsim.sweep(plan, folder, client=client).table
    seconds = time.perf_counter() - start
    return own(rows), seconds, spent(client) - before


def own(table):
    """Rows without the columns that differ from run to run."""
    return table.select([name for name in table.column_names if not name.startswith("host_")])


def table(name, plan, place):
    (place / "scene.json").write_text(SCENE)
    plan = {"scenes": [str(place / "scene.json")], "machine": "tiny", **plan}
    alone, alone_seconds, alone_spent = timed(plan, place / "alone")
    count = alone.num_rows
    print(f"{count} points, {name}")
    print(f"{'':12} {'points/s':>10} {'ms/point':>10} {'CPU ms':>8} {'more':>6} {'bytes':>7} {'files':>6}")

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


def kept(place, plan, points):
    """Processor milliseconds, bytes and bytes of memory that a batch of `points` points costs the
    client, and milliseconds per row at the end."""
    own = _native.Sweep.open("plan", json.dumps(plan), str(place), 10**6, None)
    stage = _native.Stage(own.plan(), 0, own.scene(0), 1)
    lists = [list(range(first, first + points)) for first in range(0, 1000 - points + 1, points)]
    batches = [stage.draw(numbers, 1) for numbers in lists]
    before, memory = time.process_time(), resident()
    for numbers, batch in zip(lists, batches, strict=True):
        own.keep(numbers, batch)
    spent, more = time.process_time() - before, resident() - memory
    before = time.process_time()
    own.finish()
    rows = len(lists) * points
    return 1000 * spent / len(lists), sum(map(len, batches)) / len(lists), more / rows, 1000 * (time.process_time() - before) / rows


def resident():
    """Resident memory of this process, bytes."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def client(place):
    """Prints the cost of batches and rows for scheduler and client, which are one process here."""
    (place / "scene.json").write_text(SCENE)
    plan = {"scenes": [str(place / "scene.json")], "machine": "tiny", **cheap(1024)}
    few, many = kept(place / "few", plan, 5), kept(place / "many", plan, 200)
    by_row = [(more - less) / 195 for more, less in zip(many[:2], few[:2], strict=True)]
    print(f"kept by the client: {few[0] - 5 * by_row[0]:.2f} CPU ms per batch and {1000 * by_row[0]:.0f} CPU µs per row")
    print(f"sent and written:   {few[1] - 5 * by_row[1]:.0f} bytes per batch and {by_row[1]:.0f} per row")
    print(f"until the end:      {many[2]:.0f} bytes of memory per row, and {1000 * many[3]:.0f} CPU µs to write its tables")
    _cluster.BATCH_SECONDS = _cluster.SECONDS_A_THREAD = 0.0
    settings = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as own_client:
        own_client.wait_for_workers(1)
        before = time.process_time()
        splatsim.sweep(plan, place / "one by one", client=own_client)
        print(f"in all:             {1000 * (time.process_time() - before) / 1024:.1f} CPU ms per batch of one point, in scheduler and client together")
    before = time.process_time()
    own = _native.Sweep.open("plan", json.dumps(plan), str(place / "one by one"), 10**6, None)
    print(f"restart:            {1000 * (time.process_time() - before) / 1024:.2f} CPU ms per existing row")
    own.close()
    plan = {"scenes": ["glass-spheres"], "axes": [{"field": "fragment.layers", "values": [1]}]}
    scene = _native.Sweep.open("plan", json.dumps(plan), str(place / "scene"), 1, None).scene(0)
    print(f"a scene:            {len(scene)} bytes of glass-spheres, which has {len(splatsim.Scene('glass-spheres'))} splats")


def main():
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 2048
    for name, plan in [("one frame", cheap(points)), ("a frame and its lockstep each", drawn(max(8, points // 32)))]:
        with tempfile.TemporaryDirectory() as place:
            table(name, plan, Path(place))
    with tempfile.TemporaryDirectory() as place:
        client(Path(place))


if __name__ == "__main__":
    main()
