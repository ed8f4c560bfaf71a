# SPDX-License-Identifier: BSD-3-Clause
"""A mesh and its poses as code for python-fcl asks about them, for the benchmarks beside this file."""
import bocst.fcl as fcl
import numpy as np


def bvh(mesh):
    """FCL's own BVHModel<OBBRSS> of a mesh."""
    model = fcl.BVHModelOBBRSS()
    model.beginModel()
    model.addSubModel(mesh.vertices, mesh.triangles)
    model.endModel()
    return model


def loop(fixed, moving, X):
    """One call a pose: an object is moved to X, (N, 4, 4), and asked about; whether it collides, (N,)."""
    a, b = fcl.CollisionObject(fixed), fcl.CollisionObject(moving)
    request = fcl.CollisionRequest()
    hits = []
    for x in X:
        b.setTransform(fcl.Transform(x[:3, :3], x[:3, 3]))
        hits.append(fcl.collide(a, b, request, fcl.CollisionResult()) > 0)
    return np.array(hits)
