#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: PYTHONPATH=build/python test/benchmark/python_arm_benchmark.py ARM MESH...
What a planner in Python asks of one pair: poses of a link of an arm, in random states of the arm, beside a scan that
stands before it. ARM is a folder of links that `tools/make-models --arm TRIANGLES ARM` wrote; each mesh is scaled to 0.2
to 0.4 m and placed twice. For each link and scan, a million poses in one call of collide_poses, with one thread and
as many as the machine has (the default), and 4000 of them in a loop of single calls through FCL's BVHModel<OBBRSS>, as code for python-fcl does it. Prints
the share of poses that touch, nanoseconds for each pose (of the processor's time; by default, of the wall's; the
least of three) and how many times as fast as the loop the call is; at last all pairs in sum."""
import pathlib
import sys
import time

import bocst
import numpy as np
from single_calls import bvh, loop

POSES, SINGLE = 1000000, 4000
LENGTHS = (0.25, 0.2, 0.28, 0.2, 0.24, 0.14, 0.1)  # of the links, in metres, as in tools/program/planner/arm_world.cpp
MOST_TURN = 2.2  # radians, of each joint


def turns(axis, angles):
    """Rotations about z (2) or y (1)."""
    X = np.zeros((len(angles), 4, 4))
    first, second = ((0, 1), (2, 0))[axis == 1]
    X[:, first, first] = X[:, second, second] = np.cos(angles)
    X[:, second, first] = np.sin(angles)
    X[:, first, second] = -np.sin(angles)
    X[:, axis, axis] = X[:, 3, 3] = 1
    return X


def links(generator):
    """World from each link and the palm, in random states; one after the other."""
    X = np.tile(np.eye(4), (POSES, 1, 1))
    for i, length in enumerate(LENGTHS):
        X = X @ turns(1 if i % 2 else 2, generator.uniform(-MOST_TURN, MOST_TURN, POSES))
        yield f"link{i + 1}", X
        X = X @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, length], [0, 0, 0, 1]])
    yield "palm", X


def scans(names, generator):
    """Mesh and world from mesh."""
    for height in (0.15, 0.55):
        for k, name in enumerate(names):
            mesh = bocst.load_mesh(name)
            size = generator.uniform(0.2, 0.4) / (mesh.bounds[1] - mesh.bounds[0]).max()
            X = turns(2, generator.uniform(0, 2 * np.pi, 1))[0]
            beside = generator.uniform(-0.4, 0.4)
            X[:3, 3] = (0.7, beside, height) if k % 2 == 0 else (beside, 0.75, height)
            yield bocst.Mesh((mesh.vertices - mesh.bounds.mean(axis=0)) * size, mesh.triangles), X


def least(work, clock):
    times = []
    for _ in range(3):
        begin = clock()
        work()
        times.append(clock() - begin)
    return min(times) / POSES


random = np.random.default_rng(5)
things = list(scans(sys.argv[2:], random))
trees = [bvh(mesh) for mesh, _ in things]
total = np.zeros(3)
print("link    scan   touch |  threads=1   default  FCL's loop | times as fast   default")
for link_name, X_WL in links(random):
    link = bocst.load_mesh(str(pathlib.Path(sys.argv[1]) / f"{link_name}.obj"))
    link_tree = bvh(link)
    for k, (scan, X_WS) in enumerate(things):
        X = np.ascontiguousarray(np.linalg.inv(X_WS) @ X_WL)
        a, b = bocst.Model(scan), bocst.Model(link)
        expected = bocst.collide_poses(a, b, X)
        one = least(lambda: bocst.collide_poses(a, b, X, threads=1), time.process_time)
        default = least(lambda: bocst.collide_poses(a, b, X), time.perf_counter)
        begin = time.process_time()
        hits = loop(trees[k], link_tree, X[:SINGLE])
        single = (time.process_time() - begin) / SINGLE
        assert np.array_equal(hits, expected[:SINGLE])
        total += one, default, single
        print(f"{link_name} {k:6} {expected.mean():7.4f} | {1e9 * one:9.0f} {1e9 * default:9.0f} {1e9 * single:11.0f} |"
              f" {single / one:13.0f} {single / default:9.0f}", flush=True)
print(f"all pairs in sum: {total[2] / total[0]:.0f} times as fast, {total[2] / total[1]:.0f} by default")
