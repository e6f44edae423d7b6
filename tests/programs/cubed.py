"""cubed, from its published rules alone: pixels of a trace of the machine, from the records of its setup.

    python3 tests/programs/cubed.py TRACE

Takes of each Gaussian its centre, conic, box, opacity and colour, and its place in the order of
drawing. The rest is worked out from the rules of docs/book/machine-cubed.md in integers: d², the
weight and the blend. Compares with every pixel of the frame, bit for bit. It uses no other number
of the trace than the widths of its fields.
Exit status: 0 equal, 1 different, 2 the folder cannot be read.
"""

import json
import sys
from decimal import ROUND_HALF_UP, Decimal, getcontext
from pathlib import Path

getcontext().prec = 40
# exp(-i/512), of which 65535 is the greatest word.
TABLE = [int((65535 * (Decimal(-i) / 512).exp()).to_integral_value(ROUND_HALF_UP)) for i in range(2048)]
EIGHT = 8 << 18


def records(folder, manifest, name):
    """Records of a stream or constant, as dictionaries of integers."""
    (stream,) = (one for one in manifest["constants"] + manifest["streams"] if one["name"] == name)
    lines = (folder / stream["file"]).read_text().split()
    if len(lines) != stream["records"]:
        raise ValueError(f"{name} has {len(lines)} lines instead of {stream['records']}")
    return [{field["name"]: word(int(line, 16), field) for field in stream["fields"]} for line in lines]


def word(record, field):
    value = record >> field["lsb"] & (1 << field["width"]) - 1
    return value - (1 << field["width"]) if field["signed"] and value >> field["width"] - 1 else value


def scaled(manifest, name, field, places):
    """Checks the fraction bits of a field: the rules are about integers."""
    for stream in manifest["constants"] + manifest["streams"]:
        for own in stream["fields"]:
            if stream["name"] == name and own["name"] == field and own["frac_bits"] != places:
                raise ValueError(f"{name}.{field} has {own['frac_bits']} fraction bits instead of {places}")


def draw(pixels, size, splat, opacity, colour):
    """Blends a Gaussian into the pixels of its box."""
    width, height = size
    # 2b has 14 fraction bits, and so twice the b of the record, which has 15.
    a, b2, c = splat["conic_xx"], splat["conic_xy"], splat["conic_yy"]
    drawn = 0
    for y in range(splat["first_row"], splat["last_row"] + 1):
        # Centres of pixels, from the middle of the picture, in sixteenths.
        dy = 8 * (2 * y + 1 - height) - splat["pixel_y"]
        of_row = c * (dy * dy >> 4)
        for x in range(splat["first_column"], splat["last_column"] + 1):
            dx = 8 * (2 * x + 1 - width) - splat["pixel_x"]
            d2 = a * (dx * dx >> 4) + b2 * (dx * dy >> 4) + of_row
            if not 0 <= d2 < EIGHT:
                continue
            weight = TABLE[d2 >> 10] * opacity >> 17
            if weight == 0:
                continue
            drawn += 1
            pixel = pixels[y * width + x]
            for channel in range(3):
                pixel[channel] = ((colour[channel] << 2) * weight + pixel[channel] * (128 - weight)) >> 7
    return drawn


def main(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    for name, field, places in [
        ("raster.in", "pixel_x", 4),
        ("raster.in", "conic_xx", 14),
        ("raster.in", "conic_xy", 15),
        ("pipeline.in", "opacity", 8),
        ("pipeline.in", "red", 8),
        ("resolve.out", "red", 10),
    ]:
        scaled(manifest, name, field, places)
    (frame,) = records(folder, manifest, "frame")
    size = frame["width"], frame["height"]
    splats = records(folder, manifest, "pipeline.in")
    pixels = [[0, 0, 0] for _ in range(size[0] * size[1])]
    drawn = 0
    boxes = records(folder, manifest, "raster.in")
    for box in boxes:
        splat = splats[box["tag"]]
        drawn += draw(pixels, size, box, splat["opacity"], [splat["red"], splat["green"], splat["blue"]])
    # The farthest first; equal keys in the order of arrival.
    order = [(-record["key"], record["tag"]) for record in records(folder, manifest, "sort.out")]
    if order != sorted(order) or [tag for _, tag in order] != [box["tag"] for box in boxes]:
        print("the Gaussians are not drawn back to front")
        return 1
    frames = records(folder, manifest, "resolve.out")
    for record in frames:
        own = pixels[record["y"] * size[0] + record["x"]]
        theirs = [record["red"], record["green"], record["blue"]]
        if own != theirs:
            print(f"pixel {record['x']}, {record['y']}: the trace has {theirs}, cubed {own}")
            return 1
    print(f"{len(boxes)} Gaussians, {drawn} blends, {len(frames)} pixels equal")
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print("usage: cubed.py TRACE", file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(Path(sys.argv[1])))
    except (OSError, ValueError, KeyError) as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        sys.exit(2)
