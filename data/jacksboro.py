"""Writes jacksboro.tif from matplotlib's sample data: jacksboro.py jacksboro_fault_dem.npz jacksboro.tif

Needs numpy and rasterio. What the file's extent means, and why its `ymin` is not used: SOURCES.md.
"""

import sys

import numpy as np
import rasterio
from rasterio.transform import from_origin

source, target = sys.argv[1:]
dem = np.load(source)
elevation = dem["elevation"]
cell = 1 / 1200  # 3 arc seconds
west, north = float(dem["xmin"]), float(dem["ymax"])
assert elevation.dtype == np.int16 and np.isclose([dem["dx"], dem["dy"]], cell).all()
assert np.isclose(dem["xmax"] - west, elevation.shape[1] * cell)
assert np.isclose(dem["ymin"], north + elevation.shape[0] * cell)  # the wrong sign of dy

with rasterio.open(
    target,
    "w",
    driver="GTiff",
    height=elevation.shape[0],
    width=elevation.shape[1],
    count=1,
    dtype="int16",
    crs="EPSG:4269",
    transform=from_origin(west, north, cell, cell),
    compress="deflate",
    predictor=2,
    zlevel=9,
    tiled=True,
) as out:
    out.write(elevation, 1)
    out.units = ("metre",)
