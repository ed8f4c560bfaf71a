# SPDX-License-Identifier: BSD-3-Clause
"""Meshes and poses that the tests make for themselves."""
import numpy as np


def torus(n=24, bumps=0.08):
    """A bumpy torus of 2 n n triangles, some two units wide: vertices, triangles."""
    u, v = (a.ravel() for a in np.meshgrid(*2 * [2 * np.pi * np.arange(n) / n], indexing="ij"))
    r = 0.35 * (1 + bumps * np.sin(5 * u) * np.cos(3 * v))
    vertices = np.column_stack([(0.7 + r * np.cos(v)) * np.cos(u), (0.7 + r * np.cos(v)) * np.sin(u), r * np.sin(v)])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    k, l = (i + 1) % n, (j + 1) % n
    a, b, c, d = i * n + j, i * n + l, k * n + j, k * n + l
    return vertices, np.concatenate([np.column_stack([a, c, b]), np.column_stack([b, c, d])])


def box(half=1.0):
    """The surface of a cube about the origin, of twelve triangles."""
    vertices = half * (2.0 * np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)]) - 1)
    return vertices, np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
                               [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]])


def rotations(count, generator):
    q = generator.normal(size=(count, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1)


def poses(count, spread, seed=1):
    """Random poses, (count, 4, 4), with translations within a cube of half side `spread`."""
    generator = np.random.default_rng(seed)
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = rotations(count, generator)
    X[:, :3, 3] = generator.uniform(-spread, spread, (count, 3))
    return X


def shift(x, y=0.0, z=0.0):
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X
