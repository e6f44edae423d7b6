"""A second implementation of the raster, written only from the description in a trace.

    python3 tests/programs/raster.py traces/knot

Reads raster.in and the frame's constants, follows the steps under "raster" in the trace's
README.md, and compares with raster.out, record by record. It uses only that text and
manifest.json, and so tests that they are complete. Values are integers; a pair (e, p) is e / 2^p.
Exit status: 0 equal, 1 different, 2 the folder cannot be read.
"""

import json
import sys
from pathlib import Path


class Trace:
    def __init__(self, folder):
        self.folder = Path(folder)
        self.manifest = json.loads((self.folder / "manifest.json").read_text())
        self.words = self.manifest["words"]
        self.numbers = self.manifest["numbers"]

    def records(self, name):
        """Records of a stream or constant: a dictionary from field names to pairs."""
        for stream in self.manifest["constants"] + self.manifest["streams"]:
            if stream["name"] == name:
                break
        else:
            raise KeyError(f"the trace has no {name}")
        lines = (self.folder / stream["file"]).read_text().split("\n")
        if lines.pop() != "" or len(lines) != stream["records"] or any(len(line) != stream["digits"] for line in lines):
            raise ValueError(f"{name} has not {stream['records']} lines of {stream['digits']} digits")
        return [{field["name"]: field_of(int(line, 16), field) for field in stream["fields"]} for line in lines]

    def fit(self, exact, name):
        """Fit: quantises an exact value to a word."""
        (e, p), word = exact, self.words[name]
        d = p - word["frac_bits"]
        if d <= 0:
            v = e << -d
        elif word["round"] == "truncate":
            v = e >> d
        elif word["round"] == "nearest":
            v = (e + (1 << (d - 1))) >> d
        else:
            v = (e + (1 << (d - 1)) - 1 + ((e >> d) & 1)) >> d
        width = self.width(name)
        if word["overflow"] == "wrap":
            v = wrapped(v, width) if word["signed"] else v % (1 << width)
        elif word["signed"]:
            v = min(max(v, -(1 << (width - 1))), (1 << (width - 1)) - 1)
        else:
            v = min(max(v, 0), (1 << width) - 1)
        return v, word["frac_bits"]

    def width(self, name):
        return self.words[name]["int_bits"] + self.words[name]["frac_bits"]


def field_of(record, field):
    value = (record >> field["lsb"]) % (1 << field["width"])
    return (wrapped(value, field["width"]) if field["signed"] else value), field["frac_bits"]


def wrapped(value, width):
    """The low bits, in two's complement."""
    value %= 1 << width
    return value - (1 << width) if value >> (width - 1) else value


def places(value, p):
    """The same value with p fraction bits, without loss."""
    e, q = value
    if q > p and e % (1 << (q - p)) != 0:
        raise ValueError(f"{e} / 2^{q} has more than {p} fraction bits")
    return e << (p - q) if p >= q else e >> (q - p)


def plus(*values):
    p = max(p for _, p in values)
    return sum(places(value, p) for value in values), p


def minus(value):
    return -value[0], value[1]


def times(a, b):
    return a[0] * b[0], a[1] + b[1]


def half(whole):
    return whole, 1


TWO = (2, 0)


def offset(trace, frame, splat, x, y):
    """Step 1."""
    dx = plus(half(2 * x + 1 - frame["width"][0]), minus(splat["pixel_x"]))
    dy = plus(half(2 * y + 1 - frame["height"][0]), minus(splat["pixel_y"]))
    return [trace.fit(d, "raster.offset") for d in (dx, dy)]


def evaluated(trace, frame, splat, x, y):
    """Steps 9 and 10."""
    dx, dy = offset(trace, frame, splat, x, y)
    xx, xy, yy = (trace.fit(times(*pair), "raster.square") for pair in ((dx, dx), (dx, dy), (dy, dy)))
    terms = times(splat["conic_xx"], xx), times(TWO, times(splat["conic_xy"], xy)), times(splat["conic_yy"], yy)
    return trace.fit(plus(*terms), "raster.radial")[0]


class Seed:
    """Steps 1 to 6 at a pixel, and 7 and 8 where the box is seeded once."""

    def __init__(self, trace, frame, splat, x, y):
        fit = trace.fit
        xx, xy, yy = (splat["conic_" + name] for name in ("xx", "xy", "yy"))
        dx, dy = offset(trace, frame, splat, x, y)
        by_x = fit(plus(times(xx, dx), times(TWO, times(xy, dy))), "raster.gradient")
        by_y = fit(times(yy, dy), "raster.gradient")
        self.radial = fit(plus(times(dx, by_x), times(dy, by_y)), "raster.radial")
        self.first = fit(plus(times(TWO, times(xx, dx)), xx, times(TWO, times(xy, dy))), "raster.first")
        self.z = fit(plus(times(splat["depth_slope_x"], dx), times(splat["depth_slope_y"], dy), splat["depth"]), "raster.depth")
        self.second = fit(times(TWO, xx), "raster.second")
        self.down = fit(plus(times(TWO, plus(times(yy, dy), times(xy, dx))), yy), "raster.first")
        self.down_second = fit(times(TWO, yy), "raster.second")
        self.both = fit(times(TWO, xy), "raster.second")


def rows(trace, frame, splat):
    """Per row of the box: y, and radial, first, second, z at its first pixel, with the fraction
        bits of radial and of z."""
    radial_f, z_f = (trace.words[name]["frac_bits"] for name in ("raster.radial", "raster.depth"))
    radial_w, z_w = (trace.width(name) for name in ("raster.radial", "raster.depth"))
    left, top, bottom = (splat[name][0] for name in ("first_column", "first_row", "last_row"))
    if not trace.numbers["RASTER_DIFFERENCED"]:
        for y in range(top, bottom + 1):
            seed = Seed(trace, frame, splat, left, y)
            yield y, *(places(value, radial_f) for value in (seed.radial, seed.first, seed.second)), places(seed.z, z_f)
        return
    seed = Seed(trace, frame, splat, left, top)
    of_radial = (seed.radial, seed.first, seed.second, seed.down, seed.down_second, seed.both)
    radial, first, second, down, down_second, both = (places(value, radial_f) for value in of_radial)
    z, slope = places(seed.z, z_f), places(splat["depth_slope_y"], z_f)
    for y in range(top, bottom + 1):
        yield y, radial, first, second, z
        radial = wrapped(radial + down, radial_w)
        down = wrapped(down + down_second, radial_w)
        first = wrapped(first + both, radial_w)
        z = wrapped(z + slope, z_w)


def raster(trace, frame, splat):
    """Output records of a splat: tag, x, y, radial, depth, as integers."""
    radial_f, z_f = (trace.words[name]["frac_bits"] for name in ("raster.radial", "raster.depth"))
    radial_w, z_w = (trace.width(name) for name in ("raster.radial", "raster.depth"))
    left, right = splat["first_column"][0], splat["last_column"][0]
    nearest = plus(splat["depth"], minus(splat["depth_range"]))
    farthest = plus(splat["depth"], splat["depth_range"])
    exact_f = trace.numbers["RASTER_EXACT_DEPTH_F"]
    slope = places(splat["depth_slope_x"], z_f)
    cutoff_e, cutoff_f = frame["cutoff"]
    direct = trace.numbers.get("RASTER_DIRECT", 0)
    for y, radial, first, second, z in rows(trace, frame, splat):
        for x in range(left, right + 1):
            if direct:
                radial = evaluated(trace, frame, splat, x, y)
            if radial << cutoff_f < cutoff_e << radial_f and (radial >= 0 or not direct):
                depth = min(max(places((z, z_f), exact_f), places(nearest, exact_f)), places(farthest, exact_f))
                yield splat["tag"][0], x, y, max(radial, 0), depth
            radial = wrapped(radial + first, radial_w)
            first = wrapped(first + second, radial_w)
            z = wrapped(z + slope, z_w)


def main(folder):
    trace = Trace(folder)
    (frame,) = trace.records("frame")
    ours = [record for splat in trace.records("raster.in") for record in raster(trace, frame, splat)]
    names = ("tag", "x", "y", "radial", "depth")
    theirs = [tuple(record[name][0] for name in names) for record in trace.records("raster.out")]
    for number, (our, their) in enumerate(zip(ours, theirs)):
        if our != their:
            print(f"record {number}: the trace has {dict(zip(names, their))}, raster.py {dict(zip(names, our))}")
            return 1
    if len(ours) != len(theirs):
        print(f"the trace has {len(theirs)} records, raster.py {len(ours)}")
        return 1
    print(f"{len(theirs)} records equal")
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print("usage: raster.py TRACE", file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(sys.argv[1]))
    except (OSError, ValueError, KeyError) as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        sys.exit(2)
