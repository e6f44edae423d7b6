"""Does a cluster find what one process finds, row for row, whatever is killed meanwhile?"""

import json
import signal
import subprocess
import sys

import numpy as np
import pyarrow.dataset
import pyarrow.parquet as parquet
import pytest
from clusters import ENVIRONMENT, Cluster, now_and_then, wait_for

import splatsim

distributed = pytest.importorskip("distributed")

SCENE = {"splats": {"builtin": "glass-spheres", "count": 3000}}
#: Two scenes, one of them a file beside the plan; machines that share frames, some that cannot be built.
AXES = [
    {"field": "gauss.weight", "add_frac_bits": [-3, -2, -1, 0]},
    {"field": "fragment.layers", "range": [1, 4, 1]},
    {"field": "timing.raster.fifo", "range": [1, 8, 1]},
]


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "spheres.json").write_text(json.dumps(SCENE))
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"scenes": ["spheres.json", "torus-knot"], "size": [32, 24], "machine": "tiny", "lockstep": False, "axes": AXES}))
    return path


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    with Cluster(tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster


def own(table):
    """Without what differs from run to run."""
    return table.select([name for name in table.column_names if not name.startswith("host_")])


def check_is_whole(plan, folder, rows):
    """The rows of one process, in memory, in the folder's tables, and each once in its files."""
    alone = splatsim.sweep(plan)
    assert own(rows.table).equals(own(alone.table)) and own(alone.table).num_columns > 20
    assert own(parquet.read_table(folder / "sweep.parquet")).equals(own(alone.table))
    points = pyarrow.dataset.dataset(folder / "points").to_table()
    assert sorted(points["point"].to_pylist()) == list(range(alone.table.num_rows))
    assert own(points.sort_by("point").cast(alone.table.schema)).equals(own(alone.table))


def test_a_cluster_s_sweep_is_one_process_s(plan, cluster, tmp_path):
    told = []
    with distributed.Client(cluster.address) as client:
        rows = splatsim.sweep(plan, tmp_path / "out", client=client, progress=lambda *state: told.append(state))
    check_is_whole(plan, tmp_path / "out", rows)
    assert told[-1][:2] == (256, 256)
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/points").iterdir()}
    # The text is the same too, and what is there is not drawn again, by no client and no process.
    alone = splatsim.sweep(plan, tmp_path / "alone")
    names = (tmp_path / "alone/sweep.csv").read_text().split("\n")[0].split(",")
    kept = [nth for nth, name in enumerate(names) if not name.startswith("host_")]
    texts = [np.genfromtxt(tmp_path / way / "sweep.csv", str, delimiter=",", comments=None)[:, kept] for way in ("out", "alone")]
    assert (texts[0] == texts[1]).all() and len(texts[0]) == 257
    assert rows.summary().split("\n")[1:] == alone.summary().split("\n")[1:]
    assert splatsim.sweep(plan, tmp_path / "out").table.equals(rows.table)
    assert splatsim.sweep(plan, tmp_path / "out", client=cluster.address).table.equals(rows.table)
    assert files == {path: path.stat().st_mtime_ns for path in (tmp_path / "out/points").iterdir()}


def test_points_are_drawn_without_a_folder(plan):
    alone = splatsim.sweep(plan).table
    some = splatsim.draw(plan, [200, 3, 77])
    assert own(some).equals(own(alone.take([3, 77, 200])))
    for points, says in [([256], "no point 256: the plan has 256"), ([], "no points are asked for")]:
        with pytest.raises(splatsim.InputError, match=says):
            splatsim.draw(plan, points)


def test_workers_that_are_killed_lose_nothing(plan, cluster, tmp_path):
    slow_down(plan)
    with distributed.Client(cluster.address) as client:
        end = now_and_then(1.0, cluster.kill_worker)
        try:
            rows = splatsim.sweep(plan, tmp_path / "out", client=client)
        finally:
            killed = end()
    assert killed >= 3
    check_is_whole(plan, tmp_path / "out", rows)


def slow_down(plan):
    """Makes points take so long that there is time to kill somebody."""
    slow = {**json.loads(plan.read_text()), "size": [160, 120], "lockstep": True}
    slow["axes"] = [AXES[0], AXES[1], {"field": "timing.raster.fifo", "values": [1, 4]}]
    plan.write_text(json.dumps(slow))


def test_a_cluster_s_search_is_one_process_s(cluster, tmp_path):
    scene = splatsim.Scene(SCENE, size=(24, 16))
    aim = {"target_psnr": 40, "only": ["gauss", "splat.rgb"], "views": 2, "tries": 20}
    alone = splatsim.search(scene, "tiny", tmp_path / "alone", **aim)
    found = splatsim.search(scene, "tiny", tmp_path / "found", client=cluster.address, **aim)
    assert found.dict() == alone.dict() and len(alone.path) >= 5
    assert own(found.table).equals(own(alone.table)) and alone.table.num_rows > 30
    assert found.summary() == alone.summary()


def test_what_cannot_be_a_client_is_refused(plan, cluster):
    for wrong in [7, distributed.Client(cluster.address, asynchronous=True)]:
        with pytest.raises(splatsim.InputError, match="client: a distributed.Client"):
            splatsim.sweep(plan, client=wrong)
    with pytest.raises(splatsim.InputError, match="shard: with a client"):
        splatsim.sweep(plan, client=cluster.address, shard="1/2")


def test_the_scheduler_that_is_killed_loses_nothing(plan, tmp_path):
    slow_down(plan)
    with Cluster(tmp_path) as cluster, distributed.Client(cluster.address, timeout=60) as client:

        def kill():
            cluster.kill_scheduler()
            cluster.start_scheduler()
            cluster.start_workers()

        end = now_and_then(4.0, kill)
        try:
            rows = splatsim.sweep(plan, tmp_path / "out", client=client)
        finally:
            killed = end()
    assert killed >= 1
    check_is_whole(plan, tmp_path / "out", rows)


SWEEP = """
import sys, splatsim
splatsim.sweep(sys.argv[1], sys.argv[2], client=sys.argv[3])
"""


def test_the_client_that_is_killed_goes_on_where_it_was(plan, cluster, tmp_path):
    slow_down(plan)
    points = tmp_path / "out/points"
    seen = {}
    for files in [2, 4]:
        client = subprocess.Popen([sys.executable, "-c", SWEEP, plan, tmp_path / "out", cluster.address], env=ENVIRONMENT)
        wait_for(lambda: client.poll() is not None or len(list(points.glob("*.parquet"))) >= files, 60)
        assert client.poll() is None, "it was over before it was killed"
        client.send_signal(signal.SIGKILL)
        client.wait()
        now = {path: path.stat().st_mtime_ns for path in points.glob("*.parquet")}
        assert seen.items() <= now.items() and seen != now, "what is there is not drawn again"
        seen = now
    with distributed.Client(cluster.address) as client:
        rows = splatsim.sweep(plan, tmp_path / "out", client=client)
    assert seen.items() <= {path: path.stat().st_mtime_ns for path in points.glob("*.parquet")}.items()
    check_is_whole(plan, tmp_path / "out", rows)


def test_a_batch_that_was_changed_is_refused(plan, cluster, tmp_path):
    with distributed.Client(cluster.address) as client:
        splatsim.sweep(plan, tmp_path / "out", client=client)
        path = min((tmp_path / "out/points").iterdir())
        table = parquet.read_table(path)
        parquet.write_table(table.set_column(1, "key", table["key"].combine_chunks().fill_null("").cast("string")), path)
        with pytest.raises(splatsim.InputError, match=f"{path.name}: is not as it was written: take the file away"):
            splatsim.sweep(plan, tmp_path / "out", client=client)
        path.unlink()
        rows = splatsim.sweep(plan, tmp_path / "out", client=client)
    check_is_whole(plan, tmp_path / "out", rows)
