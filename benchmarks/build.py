"""Build time and quality of the tree: seconds and SAH cost for growing meshes.

Run: python benchmarks/build.py [--sizes 1280,20480,...]

"cost" is the expected number of boxes of the tree met by a random line that meets the root's box.
"""

from __future__ import annotations

import argparse
import time
from statistics import median

import numpy as np
import trimesh

from wavefront.accel.build import build_tree
from wavefront.accel.numpy_accel import leaf_size_for
from wavefront.accel.search import WIDTH

f4 = np.float32


def soup(count: int) -> np.ndarray:
    """Small random triangles in a cube (m, 3, 3)."""
    rng = np.random.default_rng(0)
    return (rng.random((count, 1, 3)) + rng.normal(size=(count, 3, 3)) / count ** (1 / 2)).astype(f4)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="1280,20480,327680,1000000,2000000")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    print(f"{'mesh':>10} {'triangles':>9} {'seconds':>8} {'cost':>7} {'leaves':>7} {'filled':>7}")
    for size in map(int, options.sizes.split(",")):
        level = round(np.log(size / 20) / np.log(4))
        meshes = {"soup": soup(size)}
        if level <= 7:
            meshes["icosphere"] = np.asarray(trimesh.creation.icosphere(subdivisions=level).triangles, f4)
        for name, triangles in meshes.items():
            low, high = (np.ascontiguousarray(v.T) for v in (triangles.min(1), triangles.max(1)))
            times = []
            for _ in range(options.repeats):
                start = time.thread_time()
                tree = build_tree(low, high, leaf_size_for(low.shape[1]), WIDTH)
                times.append(time.thread_time() - start)
            filled = (tree.prim >= 0).mean()
            row = f"{name:>10} {len(triangles):9} {median(times):8.3f} {tree.cost:7.2f}"
            print(f"{row} {len(tree.prim):7} {filled:7.1%}")


if __name__ == "__main__":
    main()
