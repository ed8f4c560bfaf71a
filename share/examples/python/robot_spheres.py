#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: robot_spheres.py SPHERES OUT.yaml LINK_MESH...
Covers each link of a robot by at most SPHERES spheres and writes them as GPU planners (cuRobo) read them: collision_spheres
of each link, in the link's frame, in its length unit. A link is named after its file."""
import pathlib
import sys

import bocst


def covering(mesh, most):
    """The spheres of the deepest level that has no more than so many; they hold the whole surface."""
    best = None
    for subdivision in ("bono", "octree"):
        for depth in range(1, 18):
            centers, radii = bocst.spheres(mesh, depth, subdivision)
            if len(radii) > most:
                break
            if best is None or radii.max() < best[1].max():
                best = centers, radii
    return best


most, out = int(sys.argv[1]), pathlib.Path(sys.argv[2])
lines = ["collision_spheres:"]
for file in sys.argv[3:]:
    centers, radii = covering(bocst.load_mesh(file), most)
    print(f"{file}: {len(radii)} spheres, the largest has the radius {radii.max():.6g}")
    lines.append(f"  {pathlib.Path(file).stem}:")
    for (x, y, z), radius in zip(centers, radii):
        lines += [f'    - "center": [{x:.9f}, {y:.9f}, {z:.9f}]', f'      "radius": {radius * (1 + 1e-6) + 1e-9:.9f}']
out.write_text("\n".join(lines) + "\n")
print("wrote", out)
