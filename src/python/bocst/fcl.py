# SPDX-License-Identifier: BSD-3-Clause
"""FCL's queries under python-fcl's names: code for python-fcl runs with `import bocst.fcl as fcl`.

BVHModel is a bocst.Model here, which builds no tree before a query needs it; BVHModelOBBRSS has FCL's own tree. A
bocst.Model is a geometry, too: fcl.CollisionObject(bocst.Model(mesh, margin=0.01)).
"""
from ._bocst import Model
from ._bocst.fcl import (
    NODE_TYPE,
    OBJECT_TYPE,
    Box,
    BVHModel,
    BVHModelOBBRSS,
    Capsule,
    CCDMotionType,
    CCDSolverType,
    CollisionGeometry,
    CollisionObject,
    CollisionRequest,
    CollisionResult,
    Cone,
    Contact,
    ContinuousCollisionRequest,
    ContinuousCollisionResult,
    Convex,
    CostSource,
    Cylinder,
    DistanceRequest,
    DistanceResult,
    DynamicAABBTreeCollisionManager,
    Ellipsoid,
    GJKSolverType,
    Halfspace,
    Plane,
    Sphere,
    Transform,
    TriangleP,
    collide,
    continuousCollide,
    distance,
)

try:
    from ._bocst.fcl import OcTree
except ImportError:  # FCL was built without octomap.
    pass


class CollisionData:
    """The data of defaultCollisionCallback: a request, a result, and whether the query is done."""

    def __init__(self, request=None, result=None):
        self.request = CollisionRequest() if request is None else request
        self.result = CollisionResult() if result is None else result
        self.done = False


class ContinuousCollisionData:
    """The same for continuousCollide()."""

    def __init__(self, request=None, result=None):
        self.request = ContinuousCollisionRequest() if request is None else request
        self.result = ContinuousCollisionResult() if result is None else result
        self.done = False


class DistanceData:
    """The same for defaultDistanceCallback."""

    def __init__(self, request=None, result=None):
        self.request = DistanceRequest() if request is None else request
        self.result = DistanceResult() if result is None else result
        self.done = False


def defaultCollisionCallback(o1, o2, cdata):
    """Adds this pair's contacts to cdata.result; returns True when there are more than the requested number.

    So does python-fcl's, while FCL's own stops when the number is reached.
    """
    if cdata.done:
        return True
    request, result = cdata.request, cdata.result
    collide(o1, o2, request, result)
    if not request.enable_cost and result.is_collision and len(result.contacts) > request.num_max_contacts:
        cdata.done = True
    return cdata.done


def defaultDistanceCallback(o1, o2, cdata):
    """Lowers cdata.result to this pair's distance; returns whether the query is done, and the minimum distance."""
    result = cdata.result
    if cdata.done:
        return True, result.min_distance
    distance(o1, o2, cdata.request, result)
    if result.min_distance <= 0:
        return True, result.min_distance
    return cdata.done, result.min_distance


__all__ = sorted(name for name in globals() if not name.startswith("_"))
