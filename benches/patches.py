"""Distances and routes through ground of two costs in random patches, against an eighth of the cell, as a Markdown table.

    python3 -m venv /tmp/patches
    /tmp/patches/bin/pip install numpy rasterio
    cargo build --release
    /tmp/patches/bin/python benches/patches.py target/release/ridgeway

The ground is level, 129 × 129 nodes; costs between the nodes are bilinear, and the finer grids sample them. The truth is the lesser of the distance
and the cost of the route on the finest grid. Ranges are over four pairs of places, each on patches of its own.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import rasterio
from rasterio.transform import from_origin

NODES = 129
FINER = (1, 2, 4, 8)


def write(path, values, spacing):
    transform = from_origin(5e5 - spacing / 2, 5e6 + spacing / 2, spacing, spacing)
    height, width = values.shape
    form = dict(driver="GTiff", count=1, dtype="float32", crs="EPSG:32633", transform=transform)
    with rasterio.open(path, "w", height=height, width=width, **form) as file:
        file.write(values.astype("float32"), 1)


def bilinear(costs, finer):
    """The costs at `finer` times as many nodes per cell."""
    at = np.arange((NODES - 1) * finer + 1) / finer
    before = np.minimum(np.floor(at).astype(int), NODES - 2)
    share = at - before
    rows = costs[before] * (1 - share)[:, None] + costs[before + 1] * share[:, None]
    return rows[:, before] * (1 - share) + rows[:, before + 1] * share


def distance_and_route(command, folder, costs, finer, start, goal):
    """What the distance at the goal and the route to it cost."""
    fine = bilinear(costs, finer)
    write(folder / "dem.tif", np.zeros_like(fine), 10 / finer)
    write(folder / "cost.tif", fine, 10 / finer)
    places = ["--start", "pixel:%d,%d" % tuple(start * finer)]
    common = ["--metric", "isotropic", "--cost", folder / "cost.tif", "--quiet"]
    ask = [command, "distance", folder / "dem.tif", *places, *common]
    subprocess.run([*ask, "-o", folder / "d.tif", "--overwrite"], check=True)
    col, row = goal * finer
    with rasterio.open(folder / "d.tif") as file:
        distance = float(file.read(1)[row, col])
    ask = [command, "route", folder / "dem.tif", *places, "--goal", f"pixel:{col},{row}", *common]
    answer = subprocess.run([*ask, "--json"], check=True, capture_output=True, text=True)
    return distance, cost_in(json.loads(answer.stdout))


def cost_in(report):
    """The first `cost` in a report."""
    if isinstance(report, dict):
        if isinstance(report.get("cost"), (int, float)):
            return report["cost"]
        report = list(report.values())
    found = (cost_in(part) for part in report) if isinstance(report, list) else ()
    return next((cost for cost in found if cost is not None), None)


def pair(command, folder, patch, jump, seed):
    rng = np.random.default_rng(100 * patch + jump + seed)
    count = NODES // patch + 2
    patches = np.where(rng.random((count, count)) < 0.5, jump, 1.0)
    start, goal = rng.integers(8, 40, 2), rng.integers(90, 121, 2)
    place = np.floor((np.arange(NODES) + 0.5) / patch).astype(int)
    costs = patches[np.ix_(place, place)]
    found = [distance_and_route(command, folder, costs, f, start, goal) for f in FINER]
    truth = min(found[-1])
    return [d / truth for d, _ in found[:-1]] + [found[0][1] / truth]


def main():
    command = pathlib.Path(sys.argv[1]).resolve()
    print("| patches | jump | distance / truth | at half the cell | at a quarter | route / truth |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for patch in (16, 8, 4):
            for jump in (10, 50, 1000):
                rows = [pair(command, pathlib.Path(folder), patch, jump, s) for s in range(4)]
                ranges = zip(np.min(rows, 0), np.max(rows, 0))
                cells = " | ".join("%.3f–%.3f" % both for both in ranges)
                print(f"| {patch} cells | 1 : {jump} | {cells} |", flush=True)


main()
