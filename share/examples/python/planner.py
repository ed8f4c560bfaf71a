#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: planner.py OBSTACLE LINK [SEED]
A rapidly-exploring random tree for an arm of three links in front of an obstacle, whole edges a call of bocst.Scene. Prints
the path's joint angles (rad)."""
import sys

import bocst
import bocst.fcl as fcl
import numpy as np

STEP, RESOLUTION = 0.4, 0.02  # rad: the longest edge, and what its states are apart


def arm(joints, length):
    """Poses (n, 3, 4, 4) of the links, world from link, for joint angles (n, 3): the base turns about z, all others about y."""
    X = np.tile(np.eye(4), (len(joints), 3, 1, 1))
    at = np.tile(np.eye(4), (len(joints), 1, 1))
    for i in range(3):
        c, s, turn = np.cos(joints[:, i]), np.sin(joints[:, i]), np.tile(np.eye(4), (len(joints), 1, 1))
        k, l = ((0, 1) if i == 0 else (2, 0))
        turn[:, k, k], turn[:, k, l], turn[:, l, k], turn[:, l, l] = c, -s, s, c
        X[:, i] = at = at @ turn
        at = at @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, length], [0, 0, 0, 1.0]])
    return X


obstacle, link = (bocst.load_mesh(file) for file in sys.argv[1:3])
random = np.random.default_rng(int(sys.argv[3]) if len(sys.argv) > 3 else 1)
length = 0.3
size = link.bounds[1] - link.bounds[0]
scaled = link.with_vertices((link.vertices - [*link.bounds.mean(axis=0)[:2], link.bounds[0, 2]]) * length * 0.8 / size.max())

scene = bocst.Scene()
stand = np.eye(4)
stand[:3, 3] = [0.35, 0, 0.2] - obstacle.bounds.mean(axis=0)
scene.add_fixed(bocst.Model(obstacle), stand)
floor = scene.add_fixed(fcl.Halfspace([0, 0, 1], -0.02), np.eye(4))
links = [scene.add_moving(bocst.Model(scaled, margin=0.002)) for _ in range(3)]
scene.ignore(links[0], floor)
for a, b in zip(links, links[1:]):
    scene.ignore(a, b)  # they are joined


def is_free(a, b):
    count = int(np.ceil(np.abs(b - a).max() / RESOLUTION)) + 1
    return not scene.any_collision(arm(np.linspace(a, b, count), length))


limits = np.array([np.pi, 1.9, 2.4])
goal = next(q for q in random.uniform(-limits, limits, (10000, 3)) if is_free(q, q))
start = next(q for q in random.uniform(-limits, limits, (10000, 3)) if is_free(q, q) and not is_free(q, goal))
tree, parents = [start], [0]
for _ in range(20000):
    wanted = goal if random.random() < 0.1 else random.uniform(-limits, limits)
    nearest = int(np.argmin(np.linalg.norm(np.array(tree) - wanted, axis=1)))
    way = wanted - tree[nearest]
    reached = tree[nearest] + way * min(1, STEP / max(np.linalg.norm(way), 1e-12))
    if is_free(tree[nearest], reached):
        tree.append(reached)
        parents.append(nearest)
        if np.linalg.norm(reached - goal) < 1e-9:
            break
else:
    sys.exit("no path found")
path = [len(tree) - 1]
while path[-1] != 0:
    path.append(parents[path[-1]])
path = np.array(tree)[path[::-1]]
assert all(is_free(a, b) for a, b in zip(path, path[1:])) and not is_free(start, goal)
print(f"a path of {len(path)} states, from a tree of {len(tree)}:")
print(np.array2string(path, precision=3, suppress_small=True))
