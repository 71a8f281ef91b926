"""Compares what two builds of ridgeway compute, to the last bit.

    cargo build --release --example solve_problem --bin ridgeway     # in a checkout of each version
    python3 benches/compare_versions.py OLD/target/release NEW/target/release data/*.tif MORE-DEMS

The commands run on every DEM with both builds: the old on one thread, the new on one and on two. Distances, labels,
regions and layers of the surface are compared value by value; routes, profiles, isolines, summaries and reports number
by number, with the text between them. Command line, version and pictures are left out; provenance is a row of its own.
Places, costs, tensors and barriers are made from the DEM, so that any DEM will do. With the example `solve_problem`
in both folders the distances of all problems of benches/problems are compared too.

Prints a Markdown table and exits with 1 if anything differs. Needs Python 3.9 and nothing else.
"""

import argparse
import json
import re
import shutil
import struct
import subprocess
import sys
import zlib
from array import array
from itertools import accumulate
from math import cos, inf, isnan, sin
from pathlib import Path
from tempfile import TemporaryDirectory

THREADS = ("1", "2")
METRICS = ("isotropic", "curvature", "difference", "difference-literal", "tensor")
PROBLEMS = (
    "constant-1,constant-25,diffeomorphism,hills,linear-speed,cylinder,sphere-cap,random-speed,rotating,maze,spiral"
)
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


# Rasters ------------------------------------------------------------------------------------------------------------

TYPES = {2: "s", 3: "H", 4: "I", 12: "d", 16: "Q"}
FLOATS, UNSIGNED = {4: "f", 8: "d"}, {1: "B", 2: "H", 4: "I"}


class Raster:
    """A GeoTIFF as ridgeway writes it: little-endian, deflated tiles, a plane for every band."""

    GEOGRAPHY = (33550, 33922, 34264, 34735, 34736, 34737)

    def __init__(self, path):
        data = path.read_bytes()
        if data[:4] != b"II*\0":
            raise ValueError(f"{path} is not a TIFF as ridgeway writes it")
        self.tags = dict(self._entries(data))
        (self.cols,), (self.rows,) = self.tags[256], self.tags[257]
        self.bands = [self._band(data, k) for k in range(self.tags[277][0])]

    @staticmethod
    def _entries(data):
        (directory,) = struct.unpack_from("<I", data, 4)
        (count,) = struct.unpack_from("<H", data, directory)
        for at in range(directory + 2, directory + 2 + 12 * count, 12):
            tag, kind, length = struct.unpack_from("<HHI", data, at)
            code = f"<{length}{TYPES[kind]}"
            at = at + 8 if struct.calcsize(code) <= 4 else struct.unpack_from("<I", data, at + 8)[0]
            yield tag, struct.unpack_from(code, data, at)

    def _band(self, data, band):
        width, height = self.tags[322][0], self.tags[323][0]
        size = self.tags[258][0] // 8
        codes = FLOATS if self.tags[339][0] == 3 else UNSIGNED
        across, down = -(-self.cols // width), -(-self.rows // height)
        values = array(codes[size], bytes(size * self.cols * self.rows))
        for tile in range(across * down):
            index = band * across * down + tile
            begin = self.tags[324][index]
            packed = zlib.decompress(data[begin : begin + self.tags[325][index]])
            row, col = divmod(tile, across)
            row, col = row * height, col * width
            within = min(width, self.cols - col)
            for k in range(min(height, self.rows - row)):
                line = self._unpredict(packed[k * width * size : (k + 1) * width * size], size, codes[size])
                begin = (row + k) * self.cols + col
                values[begin : begin + within] = line[:within]
        return values

    def _unpredict(self, line, size, code):
        predictor = self.tags.get(317, (1,))[0]
        if predictor == 2:
            bits = 2 ** (8 * size) - 1
            return array(code, accumulate(array(code, line), lambda a, b: a + b & bits))
        if predictor == 3:
            planes = bytes(accumulate(line, lambda a, b: a + b & 255))
            width = len(line) // size
            line = bytearray(len(line))
            for k in range(size):
                line[size - 1 - k :: size] = planes[k * width : (k + 1) * width]
        return array(code, bytes(line))

    def place(self, x, y, most=inf):
        """The node with at most this value nearest to shares of width and height, as the command takes it."""
        col, row = round(x * (self.cols - 1)), round(y * (self.rows - 1))
        values = self.bands[0]
        for ring in range(max(self.cols, self.rows)):
            for i in range(max(col - ring, 0), min(col + ring + 1, self.cols)):
                for j in range(max(row - ring, 0), min(row + ring + 1, self.rows)):
                    if max(abs(i - col), abs(j - row)) == ring and values[j * self.cols + i] <= most:
                        return f"pixel:{i},{j}"
        raise ValueError("a DEM without heights")

    def write(self, path, bands):
        """Bands of floats on the grid of this raster, in one strip."""
        data = b"".join(struct.pack(f"<{len(bands)}f", *values) for values in zip(*bands))
        count = len(bands)
        tags = {256: ("I", self.cols), 257: ("I", self.rows), 258: ("H", *[32] * count), 259: ("H", 1), 262: ("H", 1)}
        tags |= {273: ("I", 8), 277: ("H", count), 278: ("I", self.rows), 279: ("I", len(data)), 284: ("H", 1)}
        tags |= {338: ("H", *[0] * (count - 1))} if count > 1 else {}
        tags |= {339: ("H", *[3] * count)}
        kinds = {33550: "d", 33922: "d", 34264: "d", 34735: "H", 34736: "d", 34737: "s"}
        tags |= {tag: (kinds[tag], *self.tags[tag]) for tag in self.GEOGRAPHY if tag in self.tags}
        directory = 8 + len(data)
        directory += directory % 2
        entries, beyond = b"", b""
        for tag, (code, *values) in sorted(tags.items()):
            length = len(values[0]) if code == "s" else len(values)
            packed = struct.pack(f"<{length}{code}", *values)
            if len(packed) > 4:
                at = directory + 2 + 12 * len(tags) + 4 + len(beyond)
                beyond += packed + b"\0" * (len(packed) % 2)
                packed = struct.pack("<I", at)
            kind = next(kind for kind, known in TYPES.items() if known == code)
            entries += struct.pack("<HHI", tag, kind, length) + packed.ljust(4, b"\0")
        header = struct.pack("<2sHI", b"II", 42, directory)
        body = header + data + b"\0" * (directory - 8 - len(data))
        path.write_bytes(body + struct.pack("<H", len(tags)) + entries + bytes(4) + beyond)


# Differences: None, a number, or a word -----------------------------------------------------------------------------


def differ_in_values(old, new):
    """Between arrays of numbers; the greatest relative difference."""
    if len(old) != len(new):
        return f"{len(old)} values, then {len(new)}"
    if old.tobytes() == new.tobytes():
        return None
    greatest = 0.0
    for a, b in zip(old, new):
        if isnan(a) != isnan(b):
            return "a value and none"
        if a != b and not isnan(a):
            greatest = max(greatest, relative(a, b))
    return greatest or None  # Zeros and NaNs have several bit patterns.


def relative(a, b):
    return inf if inf in (abs(a), abs(b)) else abs(a - b) / max(abs(a), abs(b))


def differ_in_rasters(old, new):
    if old.read_bytes() == new.read_bytes():
        return None
    old, new = Raster(old), Raster(new)
    if (old.cols, old.rows, len(old.bands)) != (new.cols, new.rows, len(new.bands)):
        return "another size"
    geography = [[raster.tags.get(tag) for tag in (*Raster.GEOGRAPHY, 42112)] for raster in (old, new)]
    if geography[0] != geography[1]:
        return "other tags"
    return worst(differ_in_values(a, b) for a, b in zip(old.bands, new.bands))


def differ_in_text(old, new):
    """Between texts with numbers in them."""
    if old == new:
        return None
    numbers = [NUMBER.findall(text) for text in (old, new)]
    if NUMBER.split(old) != NUMBER.split(new):
        return "other words, the same numbers" if numbers[0] == numbers[1] else "another structure"
    pairs = ((float(a), float(b)) for a, b in zip(*numbers))
    return max((relative(a, b) for a, b in pairs if a != b), default="numbers written in another way")


def worst(differences):
    """A word is worse than any number."""
    found = [difference for difference in differences if difference is not None]
    words = [difference for difference in found if isinstance(difference, str)]
    return words[0] if words else max(found, default=None)


def without_provenance(data):
    """JSON as text in two parts: results, and provenance without command line and version."""
    found = []

    def strip(value):
        if isinstance(value, list):
            return [strip(item) for item in value]
        if isinstance(value, dict):
            if "provenance" in value:
                found.append(strip(value["provenance"]))
            return {k: strip(v) for k, v in value.items() if k not in ("provenance", "command", "software")}
        return value

    results = strip(json.loads(data))
    return tuple(json.dumps(part, indent=1, sort_keys=True).encode() for part in (results, found))


def differences(old, new):
    """What two folders of outputs differ in, by file; provenance apart."""
    names = sorted({path.relative_to(folder) for folder in (old, new) for path in folder.rglob("*.*")})
    for name in names:
        a, b = old / name, new / name
        if name.suffix in (".png", ".zip"):
            continue
        if not (a.exists() and b.exists()):
            yield str(name), "one has no such file"
        elif name.suffix == ".tif":
            yield str(name), differ_in_rasters(a, b)
        elif name.suffix in (".json", ".geojson"):
            a, b = without_provenance(a.read_bytes()), without_provenance(b.read_bytes())
            yield str(name), differ_in_text(a[0], b[0])
            yield "provenance", differ_in_text(a[1], b[1])
        else:
            yield str(name), differ_in_text(a.read_bytes(), b.read_bytes())


# Commands -----------------------------------------------------------------------------------------------------------


def run(binary, arguments, folder):
    """Runs a command in a folder of its own; its report becomes a file there."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    done = subprocess.run([binary.resolve(), *arguments], cwd=folder, capture_output=True)
    if done.returncode == 0 and done.stdout:
        (folder / "report.json").write_bytes(done.stdout)
    elif done.returncode != 0:
        (folder / "failure.txt").write_bytes(b"exit code %d\n" % done.returncode + done.stderr)
    return done.returncode


class Setting:
    """Places on a DEM, and what the modifiers take, made from its slopes and heights."""

    def __init__(self, binary, dem, folder):
        if run(binary, ["surface", dem, "--layers", "slope,height", "-o", "layers.tif"], folder / "made") != 0:
            raise SystemExit((folder / "made" / "failure.txt").read_text())
        folder = (folder / "made").resolve()
        raster = Raster(folder / "layers.tif")
        slopes, heights = raster.bands
        by_slope = sorted(slope for slope in slopes if not isnan(slope))
        gentle, self.steep = by_slope[len(by_slope) // 2], by_slope[len(by_slope) * 97 // 100]
        at = [(0.2, 0.75), (0.8, 0.3), (0.5, 0.1), (0.35, 0.25), (0.65, 0.7)]
        self.start, self.goal, self.middle, *ends = [raster.place(x, y, gentle) for x, y in at]
        self.cost, self.tensor, self.barrier = (folder / name for name in ("cost.tif", "tensor.tif", "barrier.geojson"))
        raster.write(self.cost, [[1 + (slope / 10) ** 2 for slope in slopes]])
        # Speeds 2 and 1/2 along and across a direction that turns with the ground.
        angles = [slope / 7 + height / 300 for slope, height in zip(slopes, heights)]
        d11 = [1.25 + 0.75 * cos(angle) for angle in angles]
        d12 = [0.75 * sin(angle) for angle in angles]
        raster.write(self.tensor, [d11, d12, [2.5 - d for d in d11]])
        # Without a CRS there are no longitudes and latitudes for GeoJSON and GPX.
        run(binary, ["info", dem, "--json"], folder / "info")
        self.has_crs = json.loads((folder / "info" / "report.json").read_text())["crs"]["name"] != "none"
        # The route between two places is a wall that others have to go around.
        words = ["--start", ends[0], "--goal", ends[1], "--metric", "isotropic", "-o", "route.geojson"]
        if self.has_crs and run(binary, ["route", dem, *words], folder / "wall") == 0:
            collection = json.loads((folder / "wall" / "route.geojson").read_text())
            lines = [f for f in collection["features"] if f["geometry"]["type"] == "LineString"]
            self.barrier.write_text(json.dumps(collection | {"features": lines}))

    def modifiers(self):
        each = {
            "climb weight": ["--climb-weight", "0.05"],
            "max slope": ["--max-slope", f"{self.steep:.1f}"],
            "barrier": ["--barrier", self.barrier] if self.barrier.exists() else [],
            "cost": ["--cost", self.cost],
        }
        return each | {"all of these": [word for words in each.values() for word in words]}


def commands(dem, setting):
    """Name and arguments of all that is compared on a DEM."""
    start, goal = ["--start", setting.start], ["--goal", setting.goal]
    tensor = ["--tensor", setting.tensor]
    names = ("r.geojson", "r.csv", "r.gpx") if setting.has_crs else ("r.geojson", "r.csv")
    outputs = [word for name in names for word in ("-o", name)]
    modifiers = setting.modifiers()

    def metric(name):
        return ["--metric", name, *(tensor if name == "tensor" else [])]

    yield "info", ["info", dem]
    layers = ["--layers", "height,slope,gaussian,mean,k1,k2", "-o", "s.tif"]
    for form in ([], ["--degree", "quintic"], ["--smooth", "0"], ["--smooth", "auto"]):
        yield f"surface {' '.join(form)}", ["surface", dem, *form, *layers]
    for accuracy in ("fast", "high"):
        high = ["--error"] if accuracy == "high" else []
        how = ["--accuracy", accuracy]
        for name in METRICS:
            starts = [*start, "--start", setting.middle, "--direction", "--labels", "l.tif", "--isolines", "i.geojson"]
            what = [dem, *starts, *goal, *metric(name), *how, *high]
            yield f"distance {name} {accuracy}", ["distance", *what, "-o", "d.tif"]
            goals = [*start, *goal, "--goal", setting.middle]
            yield f"route {name} {accuracy}", ["route", dem, *goals, *metric(name), *how, *outputs]
        for modifier, words in modifiers.items():
            for name in ("isotropic", "curvature"):
                what = [dem, *start, *metric(name), *how, *words]
                yield f"distance {name} {accuracy}, {modifier}", ["distance", *what, *goal, *high, "-o", "d.tif"]
                yield f"route {name} {accuracy}, {modifier}", ["route", *what, *goal, *outputs]
        yield f"compare {accuracy}", ["compare", dem, *start, *goal, *how, *tensor, "-o", "compare"]
        words = modifiers["all of these"]
        yield f"compare {accuracy}, all of these", ["compare", dem, *start, *goal, *how, *words, "-o", "compare"]
    regions = ["-o", "regions.tif", "-o", "regions.geojson"]
    yield "segment curvature", ["segment", dem, *regions]
    yield "segment isotropic, 2 levels", ["segment", dem, "--metric", "isotropic", "--levels", "2", *regions]
    yield "segment curvature, merged", ["segment", dem, "--merge", "0.3", *regions]
    yield "match with itself", ["match", dem, dem, "-o", "matches"]


def compare_commands(old, new, dem, folder):
    for name, arguments in commands(dem, Setting(old, dem, folder)):
        code = run(old, [*arguments, "--json", "--threads", "1"], folder / "old")
        found = {}
        for threads in THREADS:
            run(new, [*arguments, "--json", "--threads", threads], folder / "new")
            for output, difference in differences(folder / "old", folder / "new"):
                found.setdefault(output, []).append(difference)
        for output, each in found.items():
            yield name + (" (refused)" if code else ""), output, worst(each)


def compare_problems(old, new, size, folder):
    for accuracy in ("fast", "high"):
        for problem in PROBLEMS.split(","):
            values = []
            for binary, threads in ((old, "1"), *((new, threads) for threads in THREADS)):
                what = ["--problem", problem, "--size", str(size), "--accuracy", accuracy, "--repeat", "1"]
                if run(binary, [*what, "--threads", threads, "--write", "g"], folder / "problem") != 0:
                    raise SystemExit((folder / "problem" / "failure.txt").read_text())
                values.append(array("f", (folder / "problem" / "g").read_bytes()))
            yield f"{problem} {accuracy}", "distances", worst(differ_in_values(values[0], v) for v in values[1:])


# The table ----------------------------------------------------------------------------------------------------------


def report(title, rows, everything):
    """Prints what differs, and all with `everything`; the number of differences."""
    rows = list(rows)
    equal = sum(difference is None for _, _, difference in rows)
    print(f"| **{title}** | {len(rows)} outputs | {equal} equal to the last bit |", flush=True)
    for name, output, difference in rows:
        if everything or difference is not None:
            said = "equal" if difference is None else difference if isinstance(difference, str) else f"{difference:.1e}"
            print(f"| {name} | {output} | {said} |", flush=True)
    return len(rows) - equal


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path, help="folder with the binaries of one version")
    parser.add_argument("new", type=Path, help="folder with those of the other")
    parser.add_argument("dem", type=Path, nargs="*")
    parser.add_argument("--size", type=int, default=401, help="nodes along a side of the problems")
    parser.add_argument("--all", action="store_true", help="print what is equal too")
    options = parser.parse_args()
    print("| on | output | greatest relative difference |\n|---|---|---|")
    differing = 0
    with TemporaryDirectory() as folder:
        solvers = [path / "examples" / "solve_problem" for path in (options.old, options.new)]
        if all(path.exists() for path in solvers):
            rows = compare_problems(*solvers, options.size, Path(folder))
            differing += report(f"problems at {options.size}²", rows, options.all)
        binaries = [path / "ridgeway" for path in (options.old, options.new)]
        for dem in options.dem:
            rows = compare_commands(*binaries, dem.resolve(), Path(folder))
            differing += report(dem.name, rows, options.all)
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
