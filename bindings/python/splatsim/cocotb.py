"""splatsim for cocotb: drivers, monitors with back-pressure, a scoreboard and coverage for a device's streams, made from a trace's manifest.

    bench = Bench(dut, "gauss", trace="traces/knot", stalls=0.3)
    await bench.reset()
    await bench.send_random(1000)
    await bench.finish()

A stream is three signals, valid, ready and data, with a prefix: s for the input of a unit, m for its output.
"""

import json
import random as _random
from collections import Counter
from pathlib import Path

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ReadOnly, RisingEdge
from cocotb.utils import get_sim_time

from splatsim import Unit

# Number of faults that a bench keeps: the first ones, because later ones often follow from them.
FAULTS = 10


class Manifest:
    """A trace's manifest: its streams by name, its constants, its folder."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.text = json.loads((self.folder / "manifest.json").read_text())
        self.streams = {of["name"]: Stream(of, self.text["enums"]) for of in self.text["streams"] + self.text["constants"]}

    def numbers(self, name):
        """The records of a stream or a constant, each as one number."""
        return [int(line, 16) for line in (self.folder / self.streams[name].file).read_text().split()]

    def side_by_side(self, name):
        """All records of a constant, concatenated, the first in the low bits: for the RTL ports lights, materials, reflections."""
        width = self.streams[name].width
        return sum(number << (place * width) for place, number in enumerate(self.numbers(name)))


class Stream:
    """A stream's records: words by field, and back."""

    def __init__(self, described, enums):
        self.name, self.width, self.file = described["name"], described["width"], described["file"]
        self.fields = described["fields"]
        self.enums = enums

    def pack(self, record):
        """The number on the wires for a record."""
        return sum((record[field["name"]] & ((1 << field["width"]) - 1)) << field["lsb"] for field in self.fields)

    def unpack(self, number):
        """The words of a number."""
        return {field["name"]: _word(number >> field["lsb"], field) for field in self.fields}

    def coverage(self):
        """Empty bins for each field."""
        return Coverage(self)


def _word(bits, field):
    word = bits & ((1 << field["width"]) - 1)
    return word - (1 << field["width"]) if field["signed"] and word >> (field["width"] - 1) else word


class Coverage:
    """Coverage of the bins of a stream's fields: codes by name, flags, and for words least, below 0, 0, above 0 and greatest."""

    def __init__(self, stream):
        self.stream, self.met = stream, Counter()
        self.bins = [(field["name"], name) for field in stream.fields for name in self._names(field)]

    def _names(self, field):
        if "enum" in field:
            return list(self.stream.enums[field["enum"]]["codes"])
        if field["width"] == 1:
            return ["0", "1"]
        return (["least", "below 0"] if field["signed"] else []) + ["0", "above 0", "greatest"]

    def sample(self, record):
        """Counts a record."""
        for field in self.stream.fields:
            word, width, signed = record[field["name"]], field["width"], field["signed"]
            if "enum" in field:
                codes = self.stream.enums[field["enum"]]["codes"]
                names = [name for name, code in codes.items() if code == word]
            elif width == 1:
                names = [str(word & 1)]
            else:
                greatest = (1 << (width - signed)) - 1
                names = ["0" if word == 0 else "below 0" if word < 0 else "above 0"]
                names += ["greatest"] * (word == greatest) + ["least"] * (signed and word == -greatest - 1)
            self.met.update((field["name"], name) for name in names)

    def missed(self):
        """Bins that no record met."""
        return [bin for bin in self.bins if bin not in self.met]

    def __str__(self):
        return f"{self.stream.name}: {len(self.bins) - len(self.missed())} of {len(self.bins)} bins met"


class Driver:
    """Offers records, each until it is taken, with idle cycles between."""

    def __init__(self, dut, clock, prefix, stream, stalls=0.0, seed=1):
        self.valid, self.ready, self.data = (getattr(dut, f"{prefix}_{end}") for end in ("valid", "ready", "data"))
        self.clock, self.stream, self.stalls, self.chance = clock, stream, stalls, _random.Random(seed)
        self.valid.value = 0
        self.data.value = 0

    async def send(self, record):
        """Offers a record until it is taken."""
        while self.chance.random() < self.stalls:
            await RisingEdge(self.clock)
        self.data.value = self.stream.pack(record)
        self.valid.value = 1
        while True:
            await ReadOnly()
            taken = bool(self.ready.value)
            await RisingEdge(self.clock)
            if taken:
                break
        self.valid.value = 0


class Monitor:
    """Takes records, except in stall cycles, and passes each to the listeners. An offer must stay until it is taken."""

    def __init__(self, dut, clock, prefix, stream, stalls=0.0, seed=2):
        self.valid, self.ready, self.data = (getattr(dut, f"{prefix}_{end}") for end in ("valid", "ready", "data"))
        self.clock, self.stream, self.stalls, self.chance = clock, stream, stalls, _random.Random(seed)
        self.listeners, self.count = [], 0
        self.ready.value = 0
        cocotb.start_soon(self._run())

    async def _run(self):
        waiting = None
        while True:
            self.ready.value = int(self.chance.random() >= self.stalls)
            await ReadOnly()
            offered = int(self.data.value) if str(self.valid.value) == "1" else None
            assert waiting is None or offered == waiting, f"{self.stream.name}: an offer that was not taken has changed"
            taken = offered is not None and bool(self.ready.value)
            waiting = offered if not taken else None
            await RisingEdge(self.clock)
            if taken:
                self.count += 1
                for listener in self.listeners:
                    listener(self.stream.unpack(offered))


class Bench:
    """A device with one input and one output stream, checked against the live model of a unit.

    dut: with clk, rst, s and m, and optional ports for the constants; unit: its name; trace: a folder written by `splatsim trace`, with
    machine.json and scene.json; stalls: share of cycles without an offer, and without a taker; seed: for stalls and random records.
    """

    def __init__(self, dut, unit, trace, stalls=0.0, seed=1):
        self.dut, self.manifest = dut, Manifest(trace)
        folder = self.manifest.folder
        self.model = Unit(unit, folder / "machine.json", folder / "scene.json", seed=seed)
        streams = [self.manifest.streams[f"{unit}.{end}"] for end in ("in", "out")]
        self.driver = Driver(dut, dut.clk, "s", streams[0], stalls, seed)
        self.monitor = Monitor(dut, dut.clk, "m", streams[1], stalls, seed + 1)
        self.coverage = [stream.coverage() for stream in streams]
        self.faults = []
        self.monitor.listeners.append(self._compare)
        self._constants()

    def _constants(self):
        if hasattr(self.dut, "frame"):
            self.dut.frame.value = self.manifest.side_by_side("frame")
        for port, name in [("lights", "light"), ("materials", "material"), ("reflections", "reflection")]:
            if hasattr(self.dut, port):
                getattr(self.dut, port).value = self.manifest.side_by_side(name)
        if hasattr(self.dut, "least"):
            self.dut.least.value = 0

    def _compare(self, record):
        self.coverage[1].sample(record)
        fault = self.model.compare(record)
        if fault and len(self.faults) < FAULTS:
            self.faults.append(f"at {get_sim_time('ns'):.0f} ns: {fault}")

    async def reset(self, cycles=3):
        """Starts the clock and resets the device."""
        cocotb.start_soon(Clock(self.dut.clk, 10, "ns").start())
        self.dut.rst.value = 1
        for _ in range(cycles):
            await RisingEdge(self.dut.clk)
        self.dut.rst.value = 0

    async def send(self, record):
        """Passes a record to the model and to the device."""
        self.model.give(record)
        self.coverage[0].sample(record)
        await self.driver.send(record)

    async def send_random(self, count):
        """Sends this many random records, corner cases and thresholds first."""
        for _ in range(count):
            await self.send(self.model.random())

    async def finish(self, patience=1000):
        """Waits until all records have come; fails if one is different, missing or surplus."""
        idle, seen = 0, self.monitor.count
        while idle < (patience if self.model.waiting() else 20):
            await RisingEdge(self.dut.clk)
            idle, seen = (idle + 1, seen) if self.monitor.count == seen else (0, self.monitor.count)
        assert not self.faults, self.faults[0]
        assert self.model.waiting() == 0, f"{self.model.waiting()} records of the model never came"
        assert self.monitor.count > 0, "no record came"
