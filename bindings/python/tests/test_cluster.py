"""Does a cluster give the rows of one process, even when processes are killed meanwhile?"""

import asyncio
import csv
import json
import signal
import subprocess
import sys
import threading

import pyarrow.compute
import pyarrow.dataset
import pyarrow.parquet as parquet
import pytest
from clusters import ENVIRONMENT, Cluster, repeatedly, wait_for

import splatsim
from splatsim import _cluster

distributed = pytest.importorskip("distributed")

#: Two scenes, files beside the plan; machines that share frames, and some that do not elaborate.
SCENES = {"spheres.json": {"splats": {"builtin": "glass-spheres", "count": 300}}, "knot.json": {"splats": {"builtin": "torus-knot", "count": 300}}}
PLAN = {
    "scenes": list(SCENES),
    "size": [32, 24],
    "machine": "tiny",
    "lockstep": False,
    "axes": [
        {"field": "gauss.weight", "add_frac_bits": [-3, -2, -1, 0]},
        {"field": "fragment.layers", "range": [1, 4, 1]},
        {"field": "timing.raster.fifo", "values": [1, 4]},
        {"field": "project.camera", "values": ["I8F8", "U2F8"]},
    ],
}
COUNT = 128


@pytest.fixture
def plan(tmp_path):
    for name, scene in SCENES.items():
        (tmp_path / name).write_text(json.dumps(scene))
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(PLAN))
    return path


@pytest.fixture
def one_by_one(monkeypatch):
    """Batches of one point each, so that many can be lost."""
    monkeypatch.setattr(_cluster, "BATCH_SECONDS", 0.0)
    monkeypatch.setattr(_cluster, "SECONDS_A_THREAD", 0.0)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    with Cluster(tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster


def own(table):
    """The table without columns that differ between runs."""
    return table.select([name for name in table.column_names if not name.startswith("host_")])


def text_of(path):
    """The same for a table as text."""
    with open(path, newline="") as file:
        return [{name: cell for name, cell in row.items() if not name.startswith("host_")} for row in csv.DictReader(file)]


def check_is_whole(plan, folder, rows):
    """Checks that the rows equal those of one process, in memory and in the folder's tables, and are once in its files."""
    alone = splatsim.sweep(plan)
    assert own(rows.table).equals(own(alone.table)) and own(alone.table).num_columns > 20
    assert alone.table.num_rows == COUNT and alone.table["misfit"].null_count == COUNT // 2
    assert own(parquet.read_table(folder / "sweep.parquet")).equals(own(alone.table))
    points = pyarrow.dataset.dataset(folder / "points").to_table()
    assert sorted(points["point"].to_pylist()) == list(range(alone.table.num_rows))
    assert own(points.sort_by("point").cast(alone.table.schema)).equals(own(alone.table))


def test_a_cluster_s_sweep_equals_one_process_s(plan, cluster, tmp_path):
    states = []
    with distributed.Client(cluster.address) as client:
        rows = splatsim.sweep(plan, tmp_path / "out", client=client, progress=lambda *state: states.append(state))
    check_is_whole(plan, tmp_path / "out", rows)
    assert states[-1][:2] == (COUNT, COUNT)
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/points").iterdir()}
    # The text is the same too, and finished rows are not drawn again by a client or a process.
    alone = splatsim.sweep(plan, tmp_path / "alone")
    texts = [text_of(tmp_path / folder / "sweep.csv") for folder in ("out", "alone")]
    assert texts[0] == texts[1] and len(texts[0]) == COUNT
    assert rows.summary().split("\n")[1:] == alone.summary().split("\n")[1:]
    assert splatsim.sweep(plan, tmp_path / "out").table.equals(rows.table)
    assert splatsim.sweep(plan, tmp_path / "out", client=cluster.address).table.equals(rows.table)
    assert files == {path: path.stat().st_mtime_ns for path in (tmp_path / "out/points").iterdir()}


def test_points_are_drawn_without_a_folder(plan):
    alone = splatsim.sweep(plan).table
    some = splatsim.draw(plan, [100, 3, 77])
    assert own(some).equals(own(alone.take([3, 77, 100])))
    for points, message in [([COUNT], f"no point {COUNT}: the plan has {COUNT}"), ([], "no points are given")]:
        with pytest.raises(splatsim.InputError, match=message):
            splatsim.draw(plan, points)


def test_killed_workers_lose_nothing(plan, cluster, tmp_path, one_by_one):
    with distributed.Client(cluster.address) as client:

        def kill():
            if len(client.nthreads()) > 1:
                cluster.kill_worker()

        end = repeatedly(0.3, kill)
        try:
            rows = splatsim.sweep(plan, tmp_path / "out", client=client)
        finally:
            end()
    assert cluster.killed >= 2
    check_is_whole(plan, tmp_path / "out", rows)


def test_a_cluster_s_search_equals_one_process_s(cluster, tmp_path):
    scene = splatsim.Scene(SCENES["spheres.json"], size=(24, 16))
    aim = {"target_psnr": 40, "only": ["gauss", "splat.rgb"], "views": 2, "tries": 20}
    alone = splatsim.search(scene, "reference", tmp_path / "alone", **aim)
    found = splatsim.search(scene, "reference", tmp_path / "found", client=cluster.address, **aim)
    assert found.dict() == alone.dict() and len(alone.path) >= 5
    assert own(found.table).equals(own(alone.table)) and alone.table.num_rows > 30
    assert found.summary() == alone.summary()


def test_an_invalid_client_is_refused(plan, cluster):
    async def sweep():
        async with distributed.Client(cluster.address, asynchronous=True) as client:
            splatsim.sweep(plan, client=client)

    for wrong in [lambda: splatsim.sweep(plan, client=7), lambda: asyncio.run(sweep())]:
        with pytest.raises(splatsim.InputError, match="client: a distributed.Client"):
            wrong()
    with pytest.raises(splatsim.InputError, match="shard: with a client"):
        splatsim.sweep(plan, client=cluster.address, shard="1/2")


def test_a_killed_scheduler_loses_nothing(plan, tmp_path, one_by_one):
    points = tmp_path / "out/points"
    killed = []

    def kill(cluster):
        for files in (5, 40):
            wait_for(lambda files=files: len(list(points.glob("*.parquet"))) >= files, 100)
            cluster.kill_scheduler()
            killed.append(len(list(points.glob("*.parquet"))))
            cluster.start_scheduler()
            cluster.start_workers()

    with Cluster(tmp_path) as cluster, distributed.Client(cluster.address, timeout=60) as client:
        thread = threading.Thread(target=kill, args=[cluster])
        thread.start()
        rows = splatsim.sweep(plan, tmp_path / "out", client=client)
        thread.join()
    assert len(killed) == 2 and killed[1] < COUNT
    check_is_whole(plan, tmp_path / "out", rows)


SWEEP = """
import sys, splatsim
from splatsim import _cluster
_cluster.BATCH_SECONDS = _cluster.SECONDS_A_THREAD = 0.0
splatsim.sweep(sys.argv[1], sys.argv[2], client=sys.argv[3])
"""


def test_a_killed_client_continues_where_it_was(plan, cluster, tmp_path):
    points = tmp_path / "out/points"
    seen = {}
    for files in [3, 40]:
        client = subprocess.Popen([sys.executable, "-c", SWEEP, plan, tmp_path / "out", cluster.address], env=ENVIRONMENT)
        wait_for(lambda: client.poll() is not None or len(list(points.glob("*.parquet"))) >= files, 60)
        assert client.poll() is None, "the client ended before it was killed"
        client.send_signal(signal.SIGKILL)
        client.wait()
        now = {path: path.stat().st_mtime_ns for path in points.glob("*.parquet")}
        assert seen.items() <= now.items() and seen != now, "finished rows were drawn again"
        seen = now
    with distributed.Client(cluster.address) as client:
        rows = splatsim.sweep(plan, tmp_path / "out", client=client)
    assert seen.items() <= {path: path.stat().st_mtime_ns for path in points.glob("*.parquet")}.items()
    check_is_whole(plan, tmp_path / "out", rows)


def test_a_changed_batch_is_refused(plan, cluster, tmp_path):
    with distributed.Client(cluster.address) as client:
        splatsim.sweep(plan, tmp_path / "out", client=client)
        path = max((tmp_path / "out/points").iterdir(), key=lambda path: path.stat().st_size)
        table, at = parquet.read_table(path), parquet.read_table(path).column_names.index("cycles")
        more = pyarrow.compute.add(table["cycles"], 1)
        parquet.write_table(table.set_column(at, "cycles", more), path, compression="none")
        with pytest.raises(splatsim.InputError, match=f"{path.name}: is not as it was written: take the file away"):
            splatsim.sweep(plan, tmp_path / "out", client=client)
        path.unlink()
        rows = splatsim.sweep(plan, tmp_path / "out", client=client)
    check_is_whole(plan, tmp_path / "out", rows)


def test_two_clients_do_not_write_into_one_folder(plan, cluster, tmp_path):
    first = splatsim._native.Sweep.open(str(plan), None, str(tmp_path / "out"), 1000, None)
    with pytest.raises(splatsim.InputError, match="another process is writing there"):
        splatsim.sweep(plan, tmp_path / "out", client=cluster.address)
    first.close()
    with pytest.raises(splatsim.InputError, match="the sweep is closed"):
        first.finish()
