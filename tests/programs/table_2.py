#!/usr/bin/env python3
"""Draws three scenes of the sizes of Surface Splatting's Table 2 and prints that table again (docs/book/speed.md).

    cargo build --release
    python3 tests/programs/table_2.py target/release/splatsim ../shared/data [FOLDER]

A scanned head, a textured terrain and a helicopter with panes, each as a mesh from which `sample` makes as many points as the paper had.
Frames a second of this computer are those of one thread; the simulated machine's are of `reference`, three fragments a pixel.
"""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

# Points, and the paper's frames a second at 256×256 and 512×512.
HEAD = (429_075, 1.3, 0.7)
TERRAIN = (4_782_011, 0.2, 0.1)
HELICOPTER = (987_552, 0.6, 0.3)
# A bust that lies on its back for a camera that takes y as up.
FACE = {"eye": [0, -1100, 0], "target": [0, 0, -15], "up": [0, 0, 1], "fov_y_degrees": 30}
# Bytes of the paper's fragment: 6.375 MiB at 256×256 with three.
PAPERS_FRAGMENT = 34


def terrain(data: Path, path: Path) -> None:
    """Heights as a mesh with texture coordinates, a tenth of a unit from sample to sample."""
    rows = [[float(cell) for cell in row if cell] for row in csv.reader(open(data / "terrain/vtkjs_dem.csv")) if row]
    height, width = len(rows), len(rows[0])
    with open(path, "w") as file:
        for y, row in enumerate(rows):
            for x, z in enumerate(row):
                file.write(f"v {x / 10} {z} {y / 10}\nvt {x / (width - 1)} {1 - y / (height - 1)}\n")
        for y in range(height - 1):
            for x in range(width - 1):
                a, b = y * width + x + 1, (y + 1) * width + x + 1
                file.write(f"f {a}/{a} {b}/{b} {a + 1}/{a + 1}\nf {b}/{b} {b + 1}/{b + 1} {a + 1}/{a + 1}\n")


def scene(cloud: Path, camera: dict | None) -> Path:
    """What is drawn: the cloud, from where the program puts the eye or from where it is told."""
    if camera is None:
        return cloud
    path = cloud.with_suffix(".json")
    path.write_text(json.dumps({"splats": {"file": cloud.name}, "camera": camera}))
    return path


def run(program: str, cloud: Path, side: int, folder: Path) -> tuple[dict, float, float]:
    """The report of a run, its seconds in all, and the most memory that it held, GB."""
    out = folder / f"{cloud.stem}-{side}"
    command = [program, "run", str(cloud), "--size", f"{side}x{side}", "--threads", "1", "--out", str(out), "--quiet"]
    started = os.times().elapsed
    child = subprocess.Popen(command)
    _, status, usage = os.wait4(child.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)} failed")
    return json.loads((out / "report.json").read_text()), os.times().elapsed - started, usage.ru_maxrss * 1024 / 1e9


def main() -> None:
    program, data = sys.argv[1], Path(sys.argv[2])
    folder = Path(sys.argv[3] if len(sys.argv) > 3 else "out/table-2")
    folder.mkdir(parents=True, exist_ok=True)
    terrain(data, folder / "terrain.obj")
    scenes = [
        ("head", HEAD, [data / "scans/nefertiti.obj"]),
        ("helicopter", HELICOPTER, [data / "models/helicopter/helicopter.obj"]),
        ("terrain", TERRAIN, [folder / "terrain.obj", "--texture-image", data / "terrain/vtkjs_dem.jpg"]),
    ]
    print("| scene | points | size | the paper, frames/s | fixed | golden | simulated, frames/s | layers, the paper, MiB | here, MiB | memory, GB | s a run |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")

    def row(name: str, cloud: Path, points: int, side: int, paper: str) -> None:
        report, seconds, most = run(program, cloud, side, folder)
        host, pixels = report["host"], side * side
        rate = [1 / host[key] for key in ("fixed_seconds", "golden_seconds")]
        machine = report["machine"]
        layers = [3 * PAPERS_FRAGMENT * pixels, 3 * machine["fragment_bits"] / 8 * pixels]
        cells = [name, f"{points:,}", f"{side}²", paper, *(f"{of:.2f}" for of in rate)]
        cells += [f"{report['cycles']['frames_per_second']:.1f}", *(f"{bytes_ / 2**20:.2f}" for bytes_ in layers)]
        print(f"| {' | '.join([*cells, f'{most:.2f}', f'{seconds:.1f}'])} |", flush=True)

    for name, (points, *papers), mesh in scenes:
        cloud = folder / f"{name}.ply"
        sample = [program, "sample", *mesh, "--points", points, "--pattern", "stratified", "--out", cloud, "--quiet"]
        subprocess.run([str(of) for of in sample], check=True)
        for side, paper in zip((256, 512), papers):
            row(name, scene(cloud, FACE if name == "head" else None), points, side, f"{paper}")
    # Does time grow with the points, and no faster?
    for part in (4, 2):
        points = TERRAIN[0] // part
        cloud = folder / f"terrain-{part}.ply"
        sample = [program, "sample", *scenes[2][2], "--points", points, "--pattern", "stratified", "--out", cloud, "--quiet"]
        subprocess.run([str(of) for of in sample], check=True)
        row(f"terrain, 1/{part}", cloud, points, 512, "–")


main()
