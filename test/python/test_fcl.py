# SPDX-License-Identifier: BSD-3-Clause
"""python-fcl's names: what its documents show gives the same answers here, known in closed form or from FCL's own tree."""
import concurrent.futures
import gc
import os
import pickle
import signal
import threading

import bocst
import bocst.fcl as fcl
import numpy as np
import pytest
from shapes import box, poses, shift, torus


def built(kind, vertices, triangles):
    model = kind()
    model.beginModel(num_tris_=len(triangles), num_vertices_=len(vertices))
    assert model.addSubModel(verts=vertices, triangles=triangles)
    assert model.endModel() == 0
    return model


def placed(geometry, X=np.eye(4)):
    return fcl.CollisionObject(geometry, fcl.Transform(X[:3, :3], X[:3, 3]))


def at(geometry, *t):
    return fcl.CollisionObject(geometry, fcl.Transform(np.array(t or (0, 0, 0), dtype=float)))


TETRAHEDRON = np.array([[1.0, 1, 1], [2, 1, 1], [1, 2, 1], [1, 1, 2]]), np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
MESHES = [fcl.BVHModel, fcl.BVHModelOBBRSS]


def test_geometries_and_their_members():
    triangle = fcl.TriangleP(*np.eye(3))
    assert np.array_equal([triangle.a, triangle.b, triangle.c], np.eye(3))
    assert np.array_equal(fcl.Box(1, 2, 3).side, [1, 2, 3])
    assert np.array_equal(fcl.Ellipsoid(1, 2, 3).radii, [1, 2, 3])
    for kind in (fcl.Capsule, fcl.Cone, fcl.Cylinder):
        shape = kind(1.0, 3.0)
        assert (shape.radius, shape.lz) == (1, 3)
        shape.lz = 5
        assert shape.lz == 5
    for kind in (fcl.Halfspace, fcl.Plane):
        shape = kind(np.array([0.0, 3.0, 0.0]), 6.0)
        assert np.array_equal(shape.n, [0, 1, 0]) and shape.d == 2
    sphere = fcl.Sphere(1)
    sphere.radius = 2.5
    assert sphere.radius == 2.5
    with pytest.raises(ValueError):
        sphere.radius = -1
    assert sphere.radius == 2.5
    for lacking in (fcl.OcTree(0.1), fcl.Ellipsoid(0, 0, 0)):  # FCL ends the process
        for pair in ((fcl.Box(1, 1, 1), lacking), (lacking, fcl.Sphere(1)), (lacking, lacking)):
            with pytest.raises(ValueError, match="FCL knows no distance"):
                fcl.distance(*map(fcl.CollisionObject, pair))
    assert fcl.Sphere(1).getNodeType() == fcl.NODE_TYPE.GEOM_SPHERE
    cube = fcl.Convex(box()[0], 12, np.column_stack([np.full(12, 3), box()[1]]).ravel())
    assert cube.num_faces == 12
    assert isinstance(cube, fcl.CollisionGeometry) and isinstance(fcl.BVHModel(), fcl.CollisionGeometry)
    assert isinstance(bocst.Model(bocst.Mesh(*box())), fcl.CollisionGeometry)
    assert np.allclose(built(fcl.BVHModel, *TETRAHEDRON).aabb_center, 1.5)


def test_a_changed_shape_collides_as_what_it_is():
    sphere = fcl.Sphere(1)
    assert fcl.collide(at(sphere), at(fcl.Sphere(1), 3, 0, 0)) == 0
    sphere.radius = 2.5
    assert fcl.collide(at(sphere), at(fcl.Sphere(1), 3, 0, 0)) == 1


def test_transforms():
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    t, q = np.array([1.0, 2, 3]), np.array([0.707, 0, 0, 0.707])
    for transform, R, p in [(fcl.Transform(), np.eye(3), 0 * t), (fcl.Transform(q), quarter, 0 * t),
                            (fcl.Transform(quarter), quarter, 0 * t), (fcl.Transform(t), np.eye(3), t),
                            (fcl.Transform(q, t), quarter, t), (fcl.Transform(quarter, t), quarter, t),
                            (fcl.Transform(quarter, t[None]), quarter, t),
                            (fcl.Transform(fcl.Transform(quarter, t)), quarter, t),
                            (fcl.Transform(quarter.astype(np.float32).tolist(), t.tolist()), quarter, t)]:
        assert np.allclose(transform.getRotation(), R) and np.array_equal(transform.getTranslation(), p)
    transform = fcl.Transform()
    transform.setRotation(quarter)
    transform.setTranslation(t)
    assert np.allclose(np.abs(transform.getQuatRotation()), [0.5**0.5, 0, 0, 0.5**0.5])
    transform.setQuatRotation([1, 0, 0, 0])
    assert np.array_equal(transform.getRotation(), np.eye(3))
    thing = fcl.CollisionObject(fcl.Sphere(1))
    thing.setTransform(fcl.Transform(quarter, t))
    assert np.array_equal(thing.getTranslation(), t) and np.allclose(thing.getRotation(), quarter)
    thing.setRotation(np.eye(3))
    thing.setTranslation(2 * t)
    thing.setQuatRotation(q)
    assert np.array_equal(thing.getTransform().getTranslation(), 2 * t) and np.allclose(thing.getRotation(), quarter)
    assert np.allclose(np.abs(thing.getQuatRotation()), [0.5**0.5, 0, 0, 0.5**0.5])
    assert thing.isOccupied() and not thing.isFree() and not thing.isUncertain()
    with pytest.raises(TypeError):
        thing.setTransform(np.eye(4))


@pytest.mark.parametrize("kind", MESHES)
def test_building_step_by_step(kind):
    vertices, triangles = TETRAHEDRON
    model = kind()
    assert model.buildState() == 0
    with pytest.raises(ValueError):
        model.addVertex(0, 0, 0)
    model.beginModel()
    assert model.buildState() == 1
    for t in triangles:
        model.addTriangle(*vertices[t])
    model.addSubModel(vertices + 5, triangles)
    assert model.endModel() == 0 and model.num_tries_() == 8 and model.buildState() == 2
    for x in (1.1, 6.1):
        assert fcl.collide(fcl.CollisionObject(model), at(fcl.Sphere(0.2), x, x, x)) == 1
    assert fcl.collide(fcl.CollisionObject(model), at(fcl.Sphere(0.2), 4, 4, 4)) == 0
    thing = fcl.CollisionObject(model)
    model.beginModel()
    model.addSubModel(vertices - 9, triangles)
    with pytest.raises(ValueError, match="no vertex of verts"):
        model.addSubModel(vertices, [[0, 1, 4]])
    model.endModel()
    assert fcl.collide(thing, at(fcl.Sphere(0.2), 1.1, 1.1, 1.1)) == 1, "an object keeps what it was made of"
    assert fcl.collide(fcl.CollisionObject(model), at(fcl.Sphere(0.2), -7.9, -7.9, -7.9)) == 1


@pytest.mark.parametrize("kind", MESHES)
def test_pairwise_collision(kind):
    mesh = built(kind, *TETRAHEDRON)
    request, result = fcl.CollisionRequest(enable_contact=True), fcl.CollisionResult()
    assert fcl.collide(at(fcl.Box(1, 2, 3)), at(fcl.Cone(5, 6)), request, result) == 1
    assert result.is_collision and len(result.contacts) == 1
    result = fcl.CollisionResult()
    assert fcl.collide(at(fcl.Box(1, 2, 3)), at(fcl.Cylinder(2, 2), 6, 0, 0), request, result) == 0
    assert not result.is_collision and result.contacts == []
    cylinder = fcl.Cylinder(2, 2)
    assert fcl.collide(at(mesh, 0, 0, -1), at(cylinder), request, result) == 1
    contact = result.contacts[0]
    assert contact.o1 is mesh and contact.o2 is cylinder and 0 <= contact.b1 < 4 and contact.b2 == -1
    assert np.linalg.norm(contact.normal) == pytest.approx(1) and contact.penetration_depth >= 0
    assert contact.pos.shape == (3,)
    fcl.collide(at(cylinder), at(mesh, 0, 0, -1), request, result)
    assert result.is_collision and len(result.contacts) == 2, "a result gathers"
    # FCL itself puts the mesh first.
    names = [cylinder, mesh] if kind is fcl.BVHModel else [mesh, cylinder]
    assert [result.contacts[1].o1, result.contacts[1].o2] == names
    assert fcl.collide(at(mesh), at(mesh)) == 1


def test_all_contacts_equal_those_of_fcls_own_tree():
    a, b = torus(), torus(10)
    request = fcl.CollisionRequest(num_max_contacts=100000, enable_contact=True)
    found = 0
    for X in poses(40, 1.2, seed=3):
        pairs = []
        for kind in MESHES:
            result = fcl.CollisionResult()
            count = fcl.collide(placed(built(kind, *a)), placed(built(kind, *b), X), request, result)
            assert count == len(result.contacts)
            pairs.append(sorted((c.b1, c.b2) for c in result.contacts))
        assert pairs[0] == pairs[1]
        found += len(pairs[0])
    assert found > 100


@pytest.mark.parametrize("kind", MESHES)
def test_pairwise_distance(kind):
    request, result = fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult()
    cube = built(kind, *box(0.5))
    sphere = fcl.Sphere(1)
    assert fcl.distance(at(cube), at(sphere, 4, 0, 0), request, result) == pytest.approx(2.5)
    assert result.min_distance == pytest.approx(2.5) and result.o1 is cube and result.o2 is sphere
    if kind is fcl.BVHModel:  # FCL's own point on the sphere is in the sphere's frame.
        assert np.allclose(result.nearest_points, [[0.5, 0, 0], [3, 0, 0]], atol=1e-5)
    assert fcl.distance(at(cube), at(sphere, 9, 0, 0), request, result) == pytest.approx(7.5)
    assert result.min_distance == pytest.approx(2.5), "a result keeps the least"
    assert fcl.distance(at(cube), at(cube, 0, 1.75, 0), request, result) == pytest.approx(0.75)
    assert result.min_distance == pytest.approx(0.75) and result.o2 is cube
    assert fcl.distance(at(fcl.Box(1, 2, 3)), at(fcl.Box(1, 2, 3), 1.01, 0, 0)) == pytest.approx(0.01)
    if kind is fcl.BVHModel:  # Of its own mesh that overlaps a sphere, FCL may return a number that it never set.
        assert fcl.distance(at(cube), at(sphere, 1, 0, 0), request, result) <= 0


def test_continuous_collision():
    request = fcl.ContinuousCollisionRequest(num_max_iterations=1000)
    result = fcl.ContinuousCollisionResult()
    ball, cube = at(fcl.Sphere(1), -5, 0, 0), at(built(fcl.BVHModel, *box(0.5)), 5, 0, 0)
    end = fcl.Transform(np.array([5.0, 0, 0])), fcl.Transform(np.array([-5.0, 0, 0]))
    time = fcl.continuousCollide(ball, end[0], cube, end[1], request, result)
    assert result.is_collide and time == result.time_of_contact == pytest.approx(8.5 / 20, abs=2e-4)
    assert fcl.continuousCollide(ball, ball.getTransform(), cube, cube.getTransform()) == 1
    request.ccd_motion_type = fcl.CCDMotionType.CCDM_LINEAR
    assert fcl.continuousCollide(ball, end[0], cube, end[1], request) == pytest.approx(8.5 / 20, abs=2e-4)
    shapes = fcl.ContinuousCollisionResult()
    fcl.continuousCollide(at(fcl.Box(1, 2, 3)), fcl.Transform(np.array([5.0, 0, 0])), at(fcl.Cylinder(2, 2), 5, 0, 0),
                          fcl.Transform(), request, shapes)
    assert shapes.is_collide and 0 < shapes.time_of_contact < 1


def test_options_by_number_as_python_fcl_has_them():
    request = fcl.CollisionRequest(1, True, 1, False, True, 1)
    assert request.gjk_solver_type == fcl.GJKSolverType.GST_INDEP == 1
    assert fcl.collide(at(fcl.Sphere(1)), at(fcl.Sphere(1), 1, 0, 0), request) == 1
    assert fcl.DistanceRequest(True).enable_nearest_points
    assert fcl.ContinuousCollisionRequest(10, 1e-4, 1).ccd_motion_type == fcl.CCDMotionType.CCDM_LINEAR
    with pytest.raises(TypeError):
        fcl.CollisionRequest(gjk_solver_type="libccd")


def test_costs():
    request = fcl.CollisionRequest(num_max_cost_sources=5, enable_cost=True)
    result = fcl.CollisionResult()
    fcl.collide(at(built(fcl.BVHModel, *box(0.5))), at(built(fcl.BVHModel, *box(0.5)), 0.5, 0.1, 0.1), request, result)
    assert 0 < len(result.cost_sources) <= 5
    assert np.all(result.cost_sources[0].aabb_min <= result.cost_sources[0].aabb_max)


def managers():
    cube, ball, cone, mesh = fcl.Box(1, 2, 3), fcl.Sphere(4), fcl.Cone(5, 6), built(fcl.BVHModel, *TETRAHEDRON)
    groups = [[at(cube, 20, 0, 0), at(ball)], [at(cone), at(mesh)], [at(cube), at(ball)]]
    all = []
    for group in groups:
        manager = fcl.DynamicAABBTreeCollisionManager()
        manager.registerObjects(group)
        manager.setup()
        all.append(manager)
    return all, mesh, groups


def test_managed_collision():
    (first, second, third), mesh, _ = managers()

    def ask(manager, *what, request=None):
        data = fcl.CollisionData(request=request)
        manager.collide(*what, data, fcl.defaultCollisionCallback)
        return data.result

    assert not ask(first).is_collision
    assert ask(second).is_collision and ask(third).is_collision
    many = fcl.CollisionRequest(num_max_contacts=100, enable_contact=True)
    result = ask(first, fcl.CollisionObject(mesh), request=many)
    assert result.is_collision and len(result.contacts) >= 1
    assert all(mesh in (c.o1, c.o2) for c in result.contacts)
    assert ask(third, second, request=many).is_collision
    assert not ask(first, at(mesh, 100, 0, 0)).is_collision


def test_managed_distance():
    (first, second, _), mesh, _ = managers()
    data = fcl.DistanceData()
    first.distance(data, fcl.defaultDistanceCallback)
    assert data.result.min_distance == pytest.approx(20 - 0.5 - 4, abs=1e-5)
    data = fcl.DistanceData(fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult())
    first.distance(at(mesh, 10, 0, 0), data, fcl.defaultDistanceCallback)
    assert data.result.min_distance == pytest.approx(123**0.5 - 4, abs=1e-5) and mesh in (data.result.o1, data.result.o2)
    data = fcl.DistanceData()
    first.distance(second, data, fcl.defaultDistanceCallback)
    assert data.result.min_distance <= 0


def test_callbacks_of_ones_own():
    (first, second, third), _, groups = managers()
    seen = []

    def gather(o1, o2, data):
        data.append({o1, o2})
        return False

    third.collide(seen, gather)
    assert seen == [set(groups[2])], "the very objects that were registered"

    class Callable:
        def __call__(self, o1, o2, data):
            data.append((o1, o2))
            return len(data) == 1

    seen = []
    third.collide(second, seen, Callable())
    assert len(seen) == 1
    distances = []

    def least(o1, o2, data):
        data.append(fcl.distance(o1, o2))
        return False, min(data)

    first.distance(distances, least)
    assert min(distances) == pytest.approx(15.5, abs=1e-5)

    def broken(o1, o2, data):
        raise KeyError("mine")

    for query in (third.collide, first.distance):
        with pytest.raises(KeyError, match="mine"):
            query(None, broken)
    with pytest.raises(TypeError, match="neither"):
        first.distance(None, lambda *_: "neither")


def test_a_manager_is_not_changed_while_it_is_asked():
    (first, _, third), _, groups = managers()

    def meddles(o1, o2, manager):
        manager.unregisterObject(o1)

    with pytest.raises(RuntimeError, match="during a query"):
        third.collide(third, meddles)
    assert third.size() == 2
    third.unregisterObject(groups[2][0])
    assert third.size() == 1 and third.getObjects() == [groups[2][1]]


def test_a_manager_is_not_updated_while_it_is_asked():
    (_, _, third), _, groups = managers()
    inside, leave = threading.Event(), threading.Event()

    def waits(o1, o2, data):
        inside.set()
        leave.wait(20)
        return True

    with concurrent.futures.ThreadPoolExecutor(1) as thread:
        def moved():
            thread.submit(third.collide, third, None, waits)
            inside.wait(20)
            yield groups[2][0]

        try:
            with pytest.raises(RuntimeError, match="during a query"):
                third.update(moved())
        finally:
            leave.set()
    third.update(groups[2])
    third.update(iter(groups[0]))  # of another manager: left out, as before


def test_moving_objects_of_a_manager():
    manager = fcl.DynamicAABBTreeCollisionManager()
    things = [at(built(fcl.BVHModel, *box(0.5)), 3 * i, 0, 0) for i in range(10)]
    for thing in things:
        manager.registerObject(thing)
    manager.setup()

    def collides():
        data = fcl.CollisionData()
        manager.collide(data, fcl.defaultCollisionCallback)
        return data.result.is_collision

    assert not collides() and manager.size() == 10 and not manager.empty()
    for update in (lambda: manager.update(things[3]), lambda: manager.update([things[3]]), manager.update):
        things[3].setTranslation(np.array([6.5, 0, 0]))
        update()
        assert collides()
        things[3].setTranslation(np.array([9.0, 0, 0]))
        update()
        assert not collides()
    with pytest.raises(ValueError, match="already"):
        manager.registerObject(things[0])
    with pytest.raises(ValueError, match="twice"):
        manager.registerObjects([at(fcl.Sphere(1))] * 2)
    with pytest.raises(TypeError, match="CollisionObject"):
        manager.update([3])
    other = at(fcl.Sphere(1))
    manager.update(other)  # what is not registered is ignored, as by python-fcl
    manager.unregisterObject(other)
    manager.unregisterObject({"obj": other})
    assert manager.size() == 10
    manager.clear()
    assert manager.empty() and manager.getObjects() == []
    manager.max_tree_nonbalanced_level = 7
    assert manager.max_tree_nonbalanced_level == 7


def test_a_manager_keeps_what_it_has():
    manager = fcl.DynamicAABBTreeCollisionManager()
    for i in range(20):
        manager.registerObject(at(built(fcl.BVHModel, *box(0.5)), 0.9 * i, 0, 0))
    manager.setup()
    gc.collect()
    data = fcl.CollisionData(request=fcl.CollisionRequest(num_max_contacts=1000))
    manager.collide(data, fcl.defaultCollisionCallback)
    assert len(data.result.contacts) > 19
    assert all(isinstance(c.o1, fcl.BVHModel) for c in data.result.contacts)
    contacts = data.result.contacts
    del manager, data
    gc.collect()
    assert contacts[0].o1.num_tries_() == 12


def test_octrees():
    points = 0.05 + 0.1 * np.stack(np.meshgrid(*3 * [np.arange(-3, 3)]), -1).reshape(-1, 3)
    tree = fcl.OcTree(0.1, points=points, origin=np.array([0.05, 0.05, 5.0]))
    assert fcl.collide(at(tree), at(fcl.Sphere(0.1))) == 1
    assert fcl.collide(at(tree), at(fcl.Sphere(0.1), 2, 0, 0)) == 0
    mesh = bocst.Model(bocst.Mesh(*box(0.2)))
    assert fcl.collide(at(tree), at(mesh)) == 1
    assert fcl.collide(at(tree), at(mesh, 1, 0, 0)) == 0
    # A scene and a manager that have it see what is inserted later.
    scene = bocst.Scene()
    fixed = scene.add_fixed(tree, np.eye(4))
    scene.add_moving(fcl.Sphere(0.1))
    manager, ball = fcl.DynamicAABBTreeCollisionManager(), at(fcl.Sphere(0.1), 2, 0, 0)
    objects = [at(tree), ball]
    manager.registerObjects(objects)
    manager.setup()
    state = np.eye(4)[None]
    state[0, :3, 3] = 2, 0, 0
    for seen in (False, True):
        data = fcl.CollisionData()
        manager.collide(data, fcl.defaultCollisionCallback)
        assert data.result.is_collision == seen
        assert scene.collides(state) == seen
        if not seen:
            tree.insertPointCloud(np.array([[2.0, 0, 0]]), np.array([0.05, 0.05, 5.0]))
            objects[0].computeAABB()
            manager.update()
            scene.update(fixed)
    near = fcl.DistanceData()
    manager.distance(near, fcl.defaultDistanceCallback)
    assert near.result.min_distance <= 0 and isinstance(near.result.o1, fcl.CollisionGeometry)
    manager.octree_as_geometry_collide = True
    with pytest.raises(ValueError):
        manager.octree_as_geometry_collide = False


# The root has one child, which is occupied: two bits for each child, 10 is an occupied leaf.
ONE_CELL = bytes([0b10, 0])
HEADER = b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.1\ndata\n"


def test_octrees_from_bytes():
    tree = fcl.OcTree(0.1, data=ONE_CELL)
    with_header = fcl.OcTree(0.1, data=HEADER + ONE_CELL)
    for x in (-100, 100):
        hits = [fcl.collide(at(t), at(fcl.Sphere(0.1), x, x, x)) for t in (tree, with_header)]
        assert hits[0] == hits[1]
    assert fcl.collide(at(tree), at(fcl.Sphere(0.1), -100, -100, -100)) \
        + fcl.collide(at(tree), at(fcl.Sphere(0.1), 100, 100, 100)) == 1
    deep = b"\x03\0" * 15 + ONE_CELL
    fcl.OcTree(0.1, data=deep)
    for bad in (b"", b"no octree", b"\xff" * 10**6, b"\xff", ONE_CELL[:1], ONE_CELL + b"\0", b"\x03\0" * 16 + ONE_CELL,
                deep[:-1], HEADER, HEADER[:-5] + ONE_CELL, HEADER.replace(b"0.1", b"0.2") + ONE_CELL):
        with pytest.raises(ValueError):
            fcl.OcTree(0.1, data=bad)
        with pytest.raises(ValueError):
            tree.readBinaryData(bad)
    assert fcl.collide(at(tree), at(fcl.Sphere(0.1), -100, -100, -100)) \
        + fcl.collide(at(tree), at(fcl.Sphere(0.1), 100, 100, 100)) == 1


def test_what_is_no_array_is_refused():
    ragged = [[1.0, 0, 0], [0, 1.0], [0, 0, 1.0]]
    for wrong in (lambda: fcl.Transform(ragged, np.zeros(3)), lambda: fcl.Transform(ragged),
                  lambda: fcl.Convex(box()[0], 2, [[3, 0, 1, 2], [3, 0]])):
        with pytest.raises((TypeError, ValueError), match='bocst|array'):
            wrong()
    manager = fcl.DynamicAABBTreeCollisionManager()
    ball = at(fcl.Sphere(1))
    with pytest.raises(TypeError):
        manager.registerObjects([ball, None])
    assert manager.size() == 0


def test_normals_of_half_spaces_stay_unit_vectors():
    cube = bocst.Model(bocst.Mesh(*box(1.0)))
    for kind in (fcl.Halfspace, fcl.Plane):
        shape = kind(np.array([0.0, 1.0, 0.0]), -0.5)
        shape.n = np.array([0.0, 0.0, 2.0])
        assert np.array_equal(shape.n, [0, 0, 1]) and shape.d == -0.5
        assert fcl.collide(at(shape), at(cube)) == 1
        shape.d = -1.5
        assert fcl.collide(at(shape), at(cube)) == 0


# What trimesh's CollisionManager does with python-fcl, written anew.

class Collisions:
    """Names meshes and asks one manager about them, telling geometries apart by id()."""

    def __init__(self):
        self.objects, self.names = {}, {}
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.manager.setup()

    def add(self, name, mesh, X=np.eye(4)):
        geometry = built(fcl.BVHModel, *mesh)
        if name in self.objects:
            self.manager.unregisterObject(self.objects[name])  # the tuple, as trimesh does
            self.manager.unregisterObject(self.objects[name][0])
        X = np.asanyarray(X, dtype=np.float32)
        thing = fcl.CollisionObject(geometry, fcl.Transform(X[:3, :3], X[:3, 3]))
        self.objects[name] = thing, geometry
        self.names[id(geometry)] = name
        self.manager.registerObject(thing)
        self.manager.update()

    def remove(self, name):
        self.manager.unregisterObject(self.objects[name][0])
        self.manager.update(self.objects[name][0])
        del self.names[id(self.objects.pop(name)[1])]

    def move(self, name, X):
        thing = self.objects[name][0]
        thing.setRotation(X[:3, :3])
        thing.setTranslation(X[:3, 3])
        self.manager.update(thing)

    def name(self, geometry):
        return self.names[id(geometry)]

    def internal(self):
        data = fcl.CollisionData(request=fcl.CollisionRequest(num_max_contacts=100000, enable_contact=True))
        self.manager.collide(data, fcl.defaultCollisionCallback)
        pairs = {tuple(sorted((self.name(c.o1), self.name(c.o2)))) for c in data.result.contacts}
        assert data.result.is_collision == bool(pairs)
        return pairs, data.result.contacts

    def single(self, mesh, X):
        geometry = built(fcl.BVHModel, *mesh)
        thing = fcl.CollisionObject(geometry, fcl.Transform(X[:3, :3], X[:3, 3]))
        data = fcl.CollisionData(request=fcl.CollisionRequest(num_max_contacts=100000, enable_contact=True))
        self.manager.collide(thing, data, fcl.defaultCollisionCallback)
        return {self.name(c.o2 if c.o1 == geometry else c.o1) for c in data.result.contacts}

    def nearest(self, mesh, X):
        geometry = built(fcl.BVHModel, *mesh)
        thing = fcl.CollisionObject(geometry, fcl.Transform(X[:3, :3], X[:3, 3]))
        data = fcl.DistanceData(fcl.DistanceRequest(enable_nearest_points=True), fcl.DistanceResult())
        self.manager.distance(thing, data, fcl.defaultDistanceCallback)
        result = data.result
        return result.min_distance, self.name(result.o2 if result.o1 == geometry else result.o1), result

    def nearest_other(self, other):
        data = fcl.DistanceData()
        self.manager.distance(other.manager, data, fcl.defaultDistanceCallback)
        return data.result.min_distance

    def other(self, other):
        data = fcl.CollisionData()
        self.manager.collide(other.manager, data, fcl.defaultCollisionCallback)
        return data.result.is_collision


def test_as_trimesh_uses_it():
    scene = Collisions()
    scene.add("torus", torus())
    scene.add("far", box(0.5), shift(5))
    assert scene.internal()[0] == set()
    scene.add("near", box(0.5), shift(0.8))
    pairs, contacts = scene.internal()
    assert pairs == {("near", "torus")}
    for contact in contacts:
        assert contact.b1 >= 0 and contact.b2 >= 0 and np.isfinite(contact.pos).all() and contact.penetration_depth >= 0
    assert scene.single(box(0.6), shift(4.5)) == {"far"} and scene.single(box(9), np.eye(4)) == set()
    assert scene.single(box(2.25), shift(2.75)) == {"torus", "near", "far"}
    distance, name, result = scene.nearest(box(0.5), shift(8))
    assert distance == pytest.approx(2) and name == "far"
    assert sorted(p[0] for p in result.nearest_points) == pytest.approx([5.5, 7.5])
    scene.move("near", shift(5, 0.5))
    assert scene.internal()[0] == {("far", "near")}
    scene.remove("far")
    assert scene.internal()[0] == set()
    scene.add("near", box(0.5), shift(-0.8))
    assert scene.internal()[0] == {("near", "torus")}
    other = Collisions()
    other.add("cube", box(0.5), shift(0, 4))
    assert not scene.other(other) and scene.nearest_other(other) == pytest.approx(4 - 0.5 - torus()[0][:, 1].max(), abs=0.05)
    other.move("cube", shift(-0.9))
    assert scene.other(other)


def test_octree_files_with_other_headers():
    header = b'# Octomap OcTree binary file\n# (a comment)\n#\nid OcTree\nsize 1\nres 0.1\ndata\n'
    tree = fcl.OcTree(0.1, data=header + b'\x00\x00')
    assert tree.getNodeType() == fcl.NODE_TYPE.GEOM_OCTREE
    for bad in (header[:-5] + b'\x00\x00',  # no data
                header.replace(b'id OcTree', b'id ColorOcTree') + b'\x00\x00',
                header.replace(b'res 0.1\n', b'') + b'\x00\x00',
                header.replace(b'res 0.1', b'res 0.2') + b'\x00\x00',
                header.replace(b'res 0.1\ndata\n', b'res 0.1 data\n') + b'\xff\xff' * 200000 + b'\ndata\n\x00\x00',
                header + b'\xff\xff' * 200000):
        with pytest.raises(ValueError):
            fcl.OcTree(0.1, data=bad)


def test_octrees_change_while_other_queries_run():
    rng = np.random.default_rng(1)
    c = rng.uniform(-1, 1, (500, 1, 3))
    soup = bocst.Model(bocst.Mesh((c + rng.uniform(-.05, .05, (500, 3, 3))).reshape(-1, 3),
                                  np.arange(1500).reshape(500, 3)))
    tree = fcl.OcTree(0.1, points=np.zeros((1, 3)))
    stop = threading.Event()

    def ask():
        while not stop.is_set():
            fcl.collide(at(soup), at(tree))
    threads = [threading.Thread(target=ask) for _ in range(4)]
    for t in threads:
        t.start()
    for k in range(20):
        tree.insertPointCloud(np.full((1, 3), 0.01 * k))
    stop.set()
    for t in threads:
        t.join()


def test_managers_hold_what_a_sequence_makes():
    class Lazy:
        def __len__(self):
            return 30

        def __getitem__(self, i):
            if i >= 30:
                raise IndexError
            return fcl.CollisionObject(fcl.Box(1, 1, 1))

    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(Lazy())
    junk = [bytearray(b'\xff' * n) for n in range(150, 500) for _ in range(10)]
    manager.setup()
    hits = []
    manager.collide(None, lambda a, b, d: hits.append(fcl.collide(a, b)))
    assert hits == [1] * (30 * 29 // 2) and len(junk) == 3500
    assert {type(o.collisionGeometry()) for o in manager.getObjects()} == {fcl.Box}

    class Odd(fcl.CollisionObject):
        def __hash__(self):
            raise ValueError("hash")

    manager = fcl.DynamicAABBTreeCollisionManager()
    for _ in range(10):
        manager.registerObject(Odd(fcl.Box(1, 1, 1)))
    manager.setup()
    hits.clear()
    manager.collide(None, lambda a, b, d: hits.append(1))
    assert len(hits) == 10 * 9 // 2 and manager.size() == 10


def test_fcls_classes_and_scenes_are_not_pickled():
    for thing in (fcl.Sphere(1), fcl.Transform(), fcl.CollisionRequest(), bocst.Scene(), fcl.BVHModel()):
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
            with pytest.raises(TypeError, match='cannot pickle'):
                pickle.dumps(thing, protocol)
        with pytest.raises(TypeError):
            thing.__reduce__()
    assert pickle.loads(pickle.dumps(fcl.NODE_TYPE.GEOM_BOX)) == fcl.NODE_TYPE.GEOM_BOX


def classes(module):
    return [value for value in vars(module).values() if isinstance(value, type) and not issubclass(value, Exception)]


@pytest.mark.parametrize('cls', classes(bocst._bocst) + classes(bocst._bocst.fcl))
def test_objects_without_init_raise(cls):
    """pybind11 would hand C++ memory that holds no object."""
    thing = cls.__new__(cls)
    for name in dir(cls):
        if not name.startswith('__') and not callable(getattr(cls, name)) and not hasattr(cls, '__members__'):
            with pytest.raises(TypeError, match='__init__'):
                getattr(thing, name)
    ask = {'CollisionGeometry': fcl.CollisionObject, 'CollisionObject': fcl.DynamicAABBTreeCollisionManager().registerObject}
    for base in cls.__mro__:
        if base.__name__ in ask:
            with pytest.raises((TypeError, RuntimeError)):
                ask[base.__name__](thing)


def test_objects_without_init_as_arguments():
    with pytest.raises(TypeError):
        bocst.Model(bocst.Mesh(*box()), options=bocst.Options.__new__(bocst.Options))
    with pytest.raises((TypeError, RuntimeError)):
        bocst.Model(bocst.Mesh.__new__(bocst.Mesh))
    with pytest.raises(TypeError, match='__init__'):
        bocst.Model.__new__(bocst.Model).statistics()
    with pytest.raises(TypeError, match='__init__'):
        repr(bocst.Mesh.__new__(bocst.Mesh))
    with pytest.raises(TypeError, match='__init__'):
        bocst.Scene.__new__(bocst.Scene).collides(np.eye(4))
    scene = bocst.Scene()
    with pytest.raises((TypeError, RuntimeError)):
        scene.add_fixed(fcl.Sphere.__new__(fcl.Sphere), np.eye(4))


def test_what_callbacks_return():
    class Angry:
        def __bool__(self):
            raise KeyError('angry')

    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([fcl.CollisionObject(fcl.Sphere(1)) for _ in range(3)])
    manager.setup()
    for returned, calls in ((None, 3), (0, 3), ([], 3), ('yes', 1), (1, 1), (np.bool_(True), 1)):
        called = []
        manager.collide(None, lambda a, b, d: [called.append(1), returned][1])
        assert len(called) == calls
    with pytest.raises(KeyError):
        manager.collide(None, lambda a, b, d: Angry())
    for returned in ((True, 1.0), [1, np.float64(1)], (np.bool_(True), 1)):
        called = []
        manager.distance(None, lambda a, b, d: [called.append(1), returned][1])
        assert len(called) == 1
    for returned in (None, True, (True,), (True, 'near'), (True, 1.0, 2)):
        with pytest.raises(TypeError):
            manager.distance(None, lambda a, b, d: returned)
    with pytest.raises(KeyError):
        manager.distance(None, lambda a, b, d: (Angry(), 1.0))


def test_builders_of_two_threads():
    v = np.random.default_rng(0).uniform(-1, 1, (30000, 3))
    f = np.arange(30000).reshape(-1, 3)
    model = fcl.BVHModel()
    stop = threading.Event()

    def add():
        while not stop.is_set():
            try:
                model.addVertex(1, 2, 3)
            except ValueError:
                pass
    thread = threading.Thread(target=add)
    thread.start()
    for _ in range(30):
        model.beginModel()
        try:
            model.addSubModel(v, f)
            model.endModel()
        except ValueError:
            pass
    stop.set()
    thread.join()


def test_what_fcl_would_end_the_process_with():
    advance = fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT
    a, end = at(fcl.Box(1, 1, 1), 0.2, 0.1, 2.0), fcl.Transform(np.array([0, 0, -2.0]))
    up = np.array([0, 0, 1.0])
    for partner, request in ((fcl.Halfspace(up, 0), fcl.ContinuousCollisionRequest(ccd_solver_type=advance)),
                             (fcl.Plane(up, 0), fcl.ContinuousCollisionRequest(ccd_solver_type=advance)),
                             (fcl.Box(1, 1, 1), fcl.ContinuousCollisionRequest(
                                 ccd_motion_type=fcl.CCDMotionType.CCDM_SPLINE))):
        with pytest.raises(ValueError, match='bocst.Model'):
            fcl.continuousCollide(a, end, at(partner), fcl.Transform(), request)
    v, f = box()
    convex = fcl.Convex(v, len(f), np.concatenate([[3, *t] for t in f]))
    with pytest.raises(ValueError, match='Convex'):
        fcl.collide(at(convex), at(fcl.Plane(up, 0)))
    with pytest.raises(ValueError, match='Convex'):
        fcl.continuousCollide(at(fcl.Plane(up, 0)), fcl.Transform(), at(convex), fcl.Transform(),
                              fcl.ContinuousCollisionRequest())


def test_advancing_shapes_without_volume():
    v, f = box()
    convex = fcl.Convex(v, len(f), np.concatenate([[3, *t] for t in f]))
    advance = dict(ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT)
    end = fcl.Transform(np.array([0, 0, -2.0]))
    for thin in (fcl.Sphere(0), fcl.Box(0, 1, 1), fcl.Capsule(0, 1), fcl.Cone(1, 0), fcl.Cylinder(0, 1),
                 fcl.Ellipsoid(0, 1, 1), fcl.Convex(0 * v, len(f), np.concatenate([[3, *t] for t in f]))):
        for a, b in ((thin, convex), (convex, thin)):
            moving, fixed = at(a, 0, 0, 3.0), at(b)
            with pytest.raises(ValueError, match='shape without volume.*bocst.Model'):
                fcl.continuousCollide(moving, end, fixed, fcl.Transform(), fcl.ContinuousCollisionRequest(**advance))
            for other in (dict(advance, gjk_solver_type=fcl.GJKSolverType.GST_INDEP), {}):
                fcl.continuousCollide(moving, end, fixed, fcl.Transform(), fcl.ContinuousCollisionRequest(**other))
    triangle = fcl.TriangleP([0, 0, 0], [1, 0, 0], [0, 1, 0])
    fcl.continuousCollide(at(triangle, 0, 0, 3.0), end, at(convex), fcl.Transform(),
                          fcl.ContinuousCollisionRequest(**advance))


@pytest.mark.parametrize('signed', [False, True])
def test_distances_of_shapes_without_volume(signed):
    indep = fcl.GJKSolverType.GST_INDEP
    ask = dict(enable_signed_distance=signed)
    mesh = built(fcl.BVHModelOBBRSS, *TETRAHEDRON)
    cube = fcl.Convex(box(0.5)[0], 12, np.column_stack([np.full(12, 3), box()[1]]).ravel())
    # Without the exception, an assertion in FCL's code fails.
    for a, b, t in ((fcl.Cone(1, 1), fcl.Sphere(0), (1, 0, -0.5)), (fcl.Capsule(0, 0), fcl.Cone(0, 0), (0, 0, 0)),
                    (fcl.Box(1, 1, 1), fcl.Cone(1, 0), (0.5, -1, -0.5)) if signed else
                    (fcl.Capsule(0, 0), fcl.Cylinder(0.5, 1), (0.5, 0, 0)), (fcl.Sphere(0), cube, (0.5, 0.5, 0.5)),
                    (fcl.Ellipsoid(1, 1, 1), fcl.Cylinder(0, 0), (1, 0, 0)), (fcl.Capsule(0, 0), mesh, (-1, -1, -1))):
        for pair in ((at(a), at(b, *t)), (at(b), at(a, *(-np.array(t))))):
            with pytest.raises(ValueError, match='GST_INDEP.*bocst.Model'):
                fcl.distance(*pair, fcl.DistanceRequest(**ask))
            assert fcl.distance(*pair, fcl.DistanceRequest(**ask, gjk_solver_type=indep)) <= 0
        assert fcl.distance(at(a), at(b, 9, 9, 9), fcl.DistanceRequest(**ask)) > 0
    assert fcl.distance(at(fcl.Box(1, 1, 0)), at(fcl.Box(1, 1, 1)), fcl.DistanceRequest(**ask)) <= 0
    assert fcl.distance(at(fcl.Box(1, 1, 1)), at(fcl.Sphere(1), 0.7, 0.1, 0), fcl.DistanceRequest(**ask)) <= 0
    inside = at(fcl.Box(1, 1, 1)), at(fcl.Sphere(0), 0.2, 0.1, 0)
    if not signed:  # FCL has a formula.
        assert fcl.distance(*inside) <= 0
    model = built(fcl.BVHModel, *TETRAHEDRON)
    assert fcl.distance(at(fcl.Sphere(0)), at(model, -1, -1, -1), fcl.DistanceRequest(**ask)) <= 0


def test_nearest_points_that_fcl_takes_from_no_contact():
    for solver, a, b in ((fcl.GJKSolverType.GST_INDEP, fcl.Box(0, 0, 0), fcl.Box(1, 1, 1)),
                         (fcl.GJKSolverType.GST_LIBCCD, fcl.Box(0, 0, 0), built(fcl.BVHModelOBBRSS, *TETRAHEDRON))):
        t = (0.5, 0, 0) if solver == fcl.GJKSolverType.GST_INDEP else (-1, -1, -1)
        result = fcl.DistanceResult()
        with pytest.raises(ValueError, match='enable_nearest_points.*bocst.Model'):
            fcl.distance(at(a), at(b, *t), fcl.DistanceRequest(True, True, solver), result)
        for nearest, signed in ((True, False), (False, True)):
            assert fcl.distance(at(a), at(b, *t), fcl.DistanceRequest(nearest, signed, solver), result) <= 0
    result = fcl.DistanceResult()
    assert fcl.distance(at(fcl.Box(1, 1, 1)), at(fcl.Box(1, 1, 1), 0.7, 0.1, 0), fcl.DistanceRequest(True, True, 1), result) < 0
    assert len(result.nearest_points) == 2


def test_faces_that_are_no_numbers():
    v, f = box()
    faces = np.concatenate([[3, *t] for t in f])
    for bad in (faces.astype(float), None, 'faces', ['a', 'b']):
        with pytest.raises(TypeError, match='faces'):
            fcl.Convex(v, len(f), bad)


def test_all_objects_are_registered_or_none():
    first, second = at(fcl.Sphere(1)), at(fcl.Sphere(1), 3, 0, 0)
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObject(second)
    with pytest.raises(ValueError, match='registered'):
        manager.registerObjects([first, second])
    assert manager.size() == 1


def test_options_beside_something_else():
    import bocst
    assert bocst.Options() == bocst.Options()
    assert bocst.Options() != bocst.Options(depth=7)
    assert bocst.Options() != 3


def test_a_manager_tells_objects_apart_by_identity():
    class Equal(fcl.CollisionObject):
        def __eq__(self, other):
            return True

        def __hash__(self):
            return 1

    first, second = Equal(fcl.Sphere(1)), Equal(fcl.Sphere(1))
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([first, second])
    manager.unregisterObject(second)
    assert manager.size() == 1 and manager.getObjects()[0] is first
    data = fcl.CollisionData()
    manager.collide(second, data, fcl.defaultCollisionCallback)
    assert data.result.is_collision


def test_nearest_points_are_nan_unless_they_are_asked_for():
    result = fcl.DistanceResult()
    fcl.distance(at(fcl.Sphere(1)), at(fcl.Sphere(1), 3, 0, 0), fcl.DistanceRequest(), result)
    assert result.min_distance == pytest.approx(1) and len(result.nearest_points) == 2
    assert np.isnan(result.nearest_points).all()


def test_the_default_callback_stops_where_python_fcl_does():
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([at(fcl.Sphere(1)) for _ in range(5)])
    data = fcl.CollisionData(request=fcl.CollisionRequest(num_max_contacts=1, enable_contact=True))
    manager.collide(data, fcl.defaultCollisionCallback)
    assert len(data.result.contacts) == 2


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_enumerators_are_pickled(protocol):
    for value in (fcl.GJKSolverType.GST_LIBCCD, fcl.CCDMotionType.CCDM_SCREW, fcl.NODE_TYPE.GEOM_BOX):
        assert pickle.loads(pickle.dumps(value, protocol)) == value


def test_numbers_that_are_no_enumerators_are_refused():
    a, b = at(fcl.Sphere(1)), at(fcl.Sphere(1), 3, 0, 0)
    for name, kind in (("ccd_motion_type", fcl.CCDMotionType), ("ccd_solver_type", fcl.CCDSolverType)):
        with pytest.raises(ValueError, match=name):
            fcl.continuousCollide(a, fcl.Transform(), b, fcl.Transform(), fcl.ContinuousCollisionRequest(**{name: kind(9)}))
    with pytest.raises(ValueError, match="gjk_solver_type"):
        fcl.collide(a, b, fcl.CollisionRequest(gjk_solver_type=fcl.GJKSolverType(9)))
    with pytest.raises(ValueError, match="gjk_solver_type"):
        fcl.distance(a, b, fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType(9)))


@pytest.mark.skipif(not hasattr(fcl, "OcTree"), reason="FCL was built without octomap")
def test_a_child_has_octrees_of_its_own_after_fork():
    """While a thread of the parent changes an octree and others read it."""
    busy = fcl.OcTree(0.1)
    points = np.random.default_rng(1).uniform(-5, 5, (2000, 3))
    stop = threading.Event()

    def insert():
        while not stop.is_set():
            busy.insertPointCloud(points, np.zeros(3))

    thread = threading.Thread(target=insert)
    thread.start()
    try:
        for _ in range(10):
            child = os.fork()
            if child == 0:
                signal.alarm(20)  # a child that waits for ever ends by it
                made = fcl.CollisionObject(fcl.OcTree(0.1, points=np.zeros((1, 3))))
                is_right = fcl.collide(made, at(fcl.Sphere(1))) > 0
                try:
                    fcl.collide(fcl.CollisionObject(busy), at(fcl.Sphere(1)))
                except RuntimeError as error:
                    is_right &= "forked" in str(error)
                os._exit(0 if is_right else 1)
            assert os.waitpid(child, 0)[1] == 0
    finally:
        stop.set()
        thread.join()
