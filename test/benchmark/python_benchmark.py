#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: PYTHONPATH=build/python test/benchmark/python_benchmark.py MESH [POSES]
Many poses of one pair in one call of collide_poses, beside a loop of single calls through FCL's own BVHModel<OBBRSS> and
through a model, all from Python; for translations within so many radii of the mesh. `columns` has the poses as Eigen has
them, so it is the rate of C++. Prints nanoseconds of the processor's time for each pose; where two threads work, those of
the call (threads=2) or of concurrent.futures, of the wall's, beside one thread's. The least of many turns counts. Then
ratios: how many times as fast as FCL's loop one call is, with one and with two threads."""
import concurrent.futures
import sys
import time

import bocst
import numpy as np
from single_calls import bvh, loop


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


mesh = bocst.load_mesh(sys.argv[1])
count = int(sys.argv[2]) if len(sys.argv) > 2 else 1000000
radius, middle = np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]) / 2, mesh.bounds.mean(axis=0)
tree = bvh(mesh)
single = max(count // 50, 1)
futures = concurrent.futures.ThreadPoolExecutor(2)
print(f"{mesh}, {count} poses a call, {single} single calls")
print("radii   hits |  rows columns | wall: 1      2  futures |  FCL's  model's loop | of C++  as fast  2 threads")
for spread in (1, 2, 4, 8, 30):
    X = random_poses(count, spread * radius, middle, np.random.default_rng(1))
    columns = np.swapaxes(np.ascontiguousarray(np.swapaxes(X, 1, 2)), 1, 2)
    a, b = bocst.Model(mesh), bocst.Model(mesh)
    expected = bocst.collide_poses(a, b, X)
    parts = np.array_split(X, 16)
    ways = (
        (lambda: bocst.collide_poses(a, b, X, threads=1), time.process_time),
        (lambda: bocst.collide_poses(a, b, columns, threads=1), time.process_time),
        (lambda: bocst.collide_poses(a, b, X, threads=1), time.perf_counter),
        (lambda: bocst.collide_poses(a, b, X, threads=2), time.perf_counter),
        (lambda: np.concatenate(list(futures.map(lambda part: bocst.collide_poses(a, b, part, threads=1), parts))), time.perf_counter))
    turns = []
    end = time.perf_counter() + 5
    while len(turns) < 2 or time.perf_counter() < end:
        turns.append([seconds(*way) for way in ways])
        assert all(np.array_equal(hits, expected) for _, hits in turns[-1])
        turns[-1] = [t for t, _ in turns[-1]]
    rows, cols, one, two, shared = (min(times) / count for times in zip(*turns))
    (t_fcl, hits_fcl), (t_model, hits_model) = seconds(lambda: loop(tree, tree, X[:single])), seconds(lambda: loop(a, b, X[:single]))
    assert np.array_equal(hits_fcl, expected[:single]) and np.array_equal(hits_model, expected[:single])
    fcl_one, model_one = t_fcl / single, t_model / single
    print(f"{spread:5g} {expected.mean():6.4f} | {1e9 * rows:5.0f} {1e9 * cols:7.0f} | {1e9 * one:7.0f} {1e9 * two:6.0f} "
          f"{1e9 * shared:8.0f} | {1e9 * fcl_one:6.0f} {1e9 * model_one:13.0f} | {cols / rows:6.2f} {fcl_one / rows:8.1f} "
          f"{fcl_one / rows * one / two:10.1f}", flush=True)
