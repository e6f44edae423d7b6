"""What a cluster costs and gains on this computer: points a second of one process, and of 1, 2 and 4 workers, in one run.

    python3 tests/programs/cluster.py [POINTS]

Needs the Python package with `splatsim[cluster]`. Two sweeps: of points that take next to nothing, whose time is the overhead, and of points
that each draw a frame. Columns: points a second; milliseconds a point beyond those of one process, all workers together; what comes over the
network and into the folder for each point. Each is timed from the call to the table, with a client whose workers are up.
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


def timed(plan, folder, client):
    start = time.perf_counter()
    rows = splatsim.sweep(plan, folder, client=client).table
    return rows, time.perf_counter() - start


def own(table):
    return table.select([name for name in table.column_names if not name.startswith("host_")])


def table(name, plan, place):
    (place / "scene.json").write_text(SCENE)
    plan = {"scenes": [str(place / "scene.json")], "machine": "tiny", **plan}
    alone, alone_seconds = timed(plan, place / "alone", None)
    count = alone.num_rows
    print(f"\n{count} points, {name}\n")
    print(f"{'':14} points/s  ms a point more  bytes a point  files")
    print(f"{'one process':14} {count / alone_seconds:8.1f}  {'':15}  {'':13}  {'':5}")
    for workers in (1, 2, 4):
        settings = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
        with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
            client.wait_for_workers(workers)
            rows, seconds = timed(plan, place / str(workers), client)
        assert own(rows).equals(own(alone)), "the rows differ"
        files = [path.stat().st_size for path in (place / str(workers) / "points").iterdir()]
        more = 1000 * (seconds - alone_seconds) / count if workers == 1 else None
        told = "" if more is None else f"{more:.2f}"
        print(f"{f'{workers} workers':14} {count / seconds:8.1f}  {told:>15}  {sum(files) / count:13.0f}  {len(files):5}", flush=True)


def main():
    points = int(sys.argv[1]) if len(sys.argv) > 1 else 2048
    for name, plan in [("one frame", cheap(points)), ("a frame and its lockstep each", drawn(max(8, points // 32)))]:
        with tempfile.TemporaryDirectory() as place:
            table(name, plan, Path(place))


if __name__ == "__main__":
    main()
