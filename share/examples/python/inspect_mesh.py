#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: inspect_mesh.py MESH [DEPTH] [PICTURE.png]
Is a mesh healthy, and what does its sphere-tree look like? Prints both, and draws the spheres of three levels with
matplotlib if a picture is asked for."""
import sys

import bocst
import numpy as np

mesh = bocst.load_mesh(sys.argv[1])
depth = int(sys.argv[2]) if len(sys.argv) > 2 else 5
print(mesh, "from", mesh.bounds[0], "to", mesh.bounds[1])

health = mesh.health()
print("watertight:", health.watertight, " oriented:", health.oriented, " pieces:", health.components)
print("open edges:", health.open_edges, " degenerate triangles:", health.degenerate_triangles)
print("area:", health.area, " volume:", health.volume)

model = bocst.Model(mesh, depth=depth, ttl=0)
model.expand_all(depth)
nodes = model.nodes()
print("level  spheres  mean radius")
for level in range(1, depth + 1):
    radii = nodes["radius"][nodes["level"] == level]
    print(f"{level:5d} {len(radii):8d}  {radii.mean() if len(radii) else float('nan'):.6g}")
print(model.statistics().resident_bytes, "bytes of tree")

if len(sys.argv) > 3:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(15, 5))
    u, v = np.mgrid[0 : 2 * np.pi : 13j, 0 : np.pi : 7j]
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    for place, level in enumerate(np.linspace(max(depth - 2, 1), depth, 3).astype(int), 1):
        axes = figure.add_subplot(1, 3, place, projection="3d")
        centers, radii = bocst.spheres(mesh, int(level))
        chosen = np.random.default_rng(1).permutation(len(radii))[:400]  # matplotlib is no renderer
        for center, radius in zip(centers[chosen], radii[chosen]):
            axes.plot_surface(*(center[:, None, None] + radius * ball), color="tab:orange", alpha=0.3, linewidth=0)
        triangles = mesh.triangles[:: max(len(mesh.triangles) // 2000, 1)]
        axes.plot_trisurf(*mesh.vertices.T, triangles=triangles, color="tab:gray", alpha=0.6)
        axes.set_title(f"level {level}: {len(radii)} spheres")
        axes.set_box_aspect(mesh.bounds[1] - mesh.bounds[0] + 1e-9)
    figure.savefig(sys.argv[3], dpi=100)
    print("wrote", sys.argv[3])
