#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: PYTHONPATH=build/python test/benchmark/python_benchmark.py MESH [POSES]
Many poses of one pair in one call of collide_poses, beside a loop of single calls through FCL's own BVHModel<OBBRSS> and
through a model, all from Python; for translations within so many radii of the mesh. The column `in place` has the poses as
C++ has them, so it is the rate of C++. Prints nanoseconds of the processor's time for each pose (with two threads: of the
wall's), and ratios (above 1: collide_poses is faster)."""
import sys
import time

import bocst
import bocst.fcl as fcl
import numpy as np


def random_poses(count, spread, middle, generator):
    q = generator.normal(size=(count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    X = np.zeros((count, 4, 4))
    X[:, :3, :3] = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                             [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                             [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1)
    X[:, :3, 3] = middle + generator.uniform(-spread, spread, (count, 3)) - X[:, :3, :3] @ middle
    X[:, 3, 3] = 1
    return X


def seconds(work, clock=time.process_time):
    begin = clock()
    result = work()
    return clock() - begin, result


def loop(geometry, X):
    """As python-fcl is used: an object is moved and asked about."""
    fixed, moving = fcl.CollisionObject(geometry), fcl.CollisionObject(geometry)
    request = fcl.CollisionRequest()
    hits = []
    for x in X:
        moving.setTransform(fcl.Transform(x[:3, :3], x[:3, 3]))
        hits.append(fcl.collide(fixed, moving, request, fcl.CollisionResult()) > 0)
    return np.array(hits)


mesh = bocst.load_mesh(sys.argv[1])
count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000000
radius, middle = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]) / 2, mesh.bounds.mean(axis=0)
bvh = fcl.BVHModelOBBRSS()
bvh.beginModel()
bvh.addSubModel(mesh.vertices, mesh.triangles)
bvh.endModel()
single = max(count // 50, 1)
print(f"{mesh}, {count} poses a call, {single} single calls")
print("radii   hits  one call  in place  2 threads  FCL's loop  model's loop  of C++  FCL's loop  the same, 2 threads")
for spread in (0.5, 1, 2, 4, 8, 30):
    X = random_poses(count, spread * radius, middle, np.random.default_rng(1))
    columns = np.swapaxes(np.ascontiguousarray(np.swapaxes(X, 1, 2)), 1, 2)
    a, b = bocst.Model(mesh), bocst.Model(mesh)
    expected = bocst.collide_poses(a, b, X)
    best = [min(times) for times in zip(*(
        [seconds(lambda: bocst.collide_poses(a, b, poses, threads=threads), clock)[0] for poses, threads, clock in
         ((X, 1, time.process_time), (columns, 1, time.process_time), (X, 2, time.perf_counter))] for _ in range(5)))]
    call, in_place, two = (t / count for t in best)
    (t_fcl, hits_fcl), (t_model, hits_model) = seconds(lambda: loop(bvh, X[:single])), seconds(lambda: loop(a, X[:single]))
    assert np.array_equal(hits_fcl, expected[:single]) and np.array_equal(hits_model, expected[:single])
    fcl_one, model_one = t_fcl / single, t_model / single
    print(f"{spread:5g} {expected.mean():6.3f} {1e9 * call:9.0f} {1e9 * in_place:9.0f} {1e9 * two:10.0f} {1e9 * fcl_one:11.0f}"
          f" {1e9 * model_one:13.0f} {in_place / call:7.2f} {fcl_one / call:11.1f} {fcl_one / two:20.1f}")
