# SPDX-License-Identifier: BSD-3-Clause
"""Arrays of any dtype and layout are read right, or refused by name."""
import re

import bocst
import bocst.fcl as fcl
import numpy as np
import pytest
from shapes import box, poses, shift, torus

V, T = torus(6)


def layouts(a):
    """The same values in other memory: name, array."""
    wide = np.zeros((2 * len(a), 2 * a.shape[1]), a.dtype)
    wide[::2, ::2] = a
    frozen = a.copy()
    frozen.flags.writeable = False
    unaligned = np.frombuffer(b"x" + a.tobytes(), a.dtype, offset=1).reshape(a.shape)
    yield "C", np.ascontiguousarray(a)
    yield "Fortran", np.asfortranarray(a)
    yield "strided", wide[::2, ::2]
    yield "reversed", a[::-1, ::-1].copy()[::-1, ::-1]
    yield "read-only", frozen
    yield "other byte order", a.astype(a.dtype.newbyteorder())
    yield "unaligned", unaligned
    yield "a list", a.tolist()


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.longdouble])
def test_vertices_of_any_layout(dtype):
    expected = V.astype(dtype).astype(np.float64)
    for name, vertices in layouts(V.astype(dtype)):
        mesh = bocst.Mesh(vertices, T)
        assert np.array_equal(mesh.vertices, expected), name
    assert np.array_equal(bocst.Mesh(np.arange(9, dtype=np.int16).reshape(3, 3), [[0, 1, 2]]).vertices,
                          np.arange(9.0).reshape(3, 3))


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint32, np.uint64, np.uint16, np.int8])
def test_triangles_of_any_layout(dtype):
    for name, triangles in layouts(T.astype(dtype)):
        assert np.array_equal(bocst.Mesh(V, triangles).triangles, T), name


def test_views_share_the_mesh_and_keep_it():
    mesh = bocst.Mesh(V, T)
    v, t = mesh.vertices, mesh.triangles
    assert v.dtype == np.float64 and t.dtype == np.uint32
    assert np.shares_memory(v, mesh.vertices) and not v.flags.owndata
    for a in (v, t):
        assert not a.flags.writeable
        with pytest.raises(ValueError):
            a[0, 0] = 1
    del mesh
    assert np.array_equal(v, V) and np.array_equal(t, T)


def test_a_mesh_has_its_own_copy():
    v, t = V.copy(), T.copy()
    mesh = bocst.Mesh(v, t)
    v[:], t[:] = 7, 0
    assert np.array_equal(mesh.vertices, V) and np.array_equal(mesh.triangles, T)


def nan_in(a, at, value=np.nan):
    a = np.array(a, dtype=float)
    a[at] = value
    return a


@pytest.mark.parametrize("vertices, triangles, error, words", [
    (V[:, :2], T, ValueError, r"vertices has the shape \(36, 2\); \(n, 3\) is expected"),
    (V.ravel(), T, ValueError, r"vertices has the shape \(108,\)"),
    (V[None], T, ValueError, r"vertices has the shape"),
    (V.astype(complex), T, TypeError, "vertices must be an array of real numbers, not dtype complex128"),
    (V.astype(bool), T, TypeError, "vertices must be .* not dtype bool"),
    (V.astype(object), T, TypeError, "vertices must be .* not dtype object"),
    (V.astype(str), T, TypeError, "vertices must be .* not dtype <U"),
    ("cube.obj", T, TypeError, "vertices must be"),
    (None, T, TypeError, "vertices must be"),
    ([[1, 2, 3], [4, 5]], T, TypeError, "vertices must be"),
    (nan_in(V, (3, 1)), T, ValueError, "vertex 3"),
    (nan_in(V, (4, 2), np.inf), T, ValueError, "vertex 4"),
    (V, T.astype(float), TypeError, "triangles must be an array of integers, not dtype float64"),
    (V, T[:, :2], ValueError, r"triangles has the shape \(72, 2\)"),
    (V, [[0, 1, -1]], ValueError, "triangles has the index -1 in row 0"),
    (V, [[0, 1, 2], [0, 1, 2**40]], ValueError, "triangles has the index 1099511627776 in row 1"),
    (V, np.array([[0, 1, 2**64 - 1]], np.uint64), ValueError,
     "triangles has the index 18446744073709551615 in row 0"),
    (V, [[0, 1, 36]], ValueError, "triangle 0"),
    (V, np.zeros((0, 3), int), ValueError, "no triangles"),
])
def test_what_is_no_mesh(vertices, triangles, error, words):
    with pytest.raises(error, match=words):
        bocst.Mesh(vertices, triangles)


def models():
    return bocst.Model(bocst.Mesh(*torus(12))), bocst.Model(bocst.Mesh(*box(0.5)))


def pose_layouts(X):
    rows = np.zeros((len(X), 2, 8, 4))
    rows[:, 0, ::2] = X
    frozen = X.copy()
    frozen.flags.writeable = False
    columns = np.swapaxes(np.swapaxes(X, 1, 2).copy(), 1, 2)
    yield "C", X
    yield "columns, which are read in place", columns
    yield "columns, read-only", frozen.swapaxes(1, 2).copy().swapaxes(1, 2)
    yield "Fortran", np.asfortranarray(X)
    yield "strided", rows[:, 0, ::2]
    yield "read-only", frozen
    yield "other byte order", X.astype(X.dtype.newbyteorder())
    yield "unaligned", np.frombuffer(b"x" + X.tobytes(), X.dtype, offset=1).reshape(X.shape)
    yield "unaligned columns", np.frombuffer(b"x" + X.swapaxes(1, 2).tobytes(), X.dtype, offset=1).reshape(
        X.shape).swapaxes(1, 2)
    yield "list", X.tolist()
    yield "reversed", X[::-1].copy()[::-1]


def test_poses_of_any_layout():
    a, b = models()
    X = poses(500, 1.5)
    expected = bocst.collide_poses(a, b, X)
    assert 50 < expected.sum() < 450
    scene = bocst.Scene()
    scene.add_fixed(a, np.eye(4))
    scene.add_moving(b)
    for name, Y in pose_layouts(X):
        hits = bocst.collide_poses(a, b, Y)
        assert hits.dtype == bool and np.array_equal(hits, expected), name
        assert np.array_equal(scene.collisions(Y), expected), name
    single = X.astype(np.float32)
    assert np.array_equal(bocst.collide_poses(a, b, single), bocst.collide_poses(a, b, single.astype(np.float64)))
    assert np.array_equal(bocst.collide_poses(a, b, np.eye(4, dtype=int)[None]), [True])
    assert bocst.collide_poses(a, b, np.zeros((0, 4, 4))).shape == (0,)


def test_states_of_any_layout():
    a, b = models()
    scene = bocst.Scene()
    scene.add_fixed(a, np.eye(4))
    for _ in range(2):
        scene.add_moving(b)
    X = poses(9000, 2.5).reshape(4500, 2, 4, 4)  # more than a part
    expected, distances = scene.collisions(X), scene.clearances(X[:50])
    assert 450 < expected.sum() < 4050
    wide = np.zeros((4500, 3, 5, 8), X.dtype)
    wide[:, ::2, :4, ::2] = X
    columns = X.swapaxes(2, 3).copy().swapaxes(2, 3)
    for Y in (wide[:, ::2, :4, ::2], X[::-1].copy()[::-1], columns, np.asfortranarray(X), X.tolist()):
        assert np.array_equal(scene.collisions(Y), expected)
        assert np.array_equal(scene.clearances(Y[:50]), distances)
        assert scene.first_collision(Y) == np.argmax(expected) and scene.any_collision(Y)
    assert np.array_equal(scene.collisions(wide.astype(np.float32)[:, ::2, :4, ::2]),
                          scene.collisions(X.astype(np.float32).astype(np.float64)))
    # One of several objects, and one pose for all.
    first, both = X[:, 0], np.broadcast_to(X[:1], X.shape)
    assert np.array_equal(bocst.collide_poses(a, b, first), bocst.collide_poses(a, b, first.copy()))
    assert np.array_equal(bocst.collide_poses(a, b, first.astype(np.float32)[::3]),
                          bocst.collide_poses(a, b, first.astype(np.float32)[::3].astype(np.float64)))
    assert np.array_equal(scene.collisions(both), np.full(4500, expected[0]))
    free = X[~expected]
    assert scene.first_collision(free) == len(free) and not scene.any_collision(free)


@pytest.mark.parametrize("bad", [10, 40000])
def test_bad_poses_have_the_numbers_of_the_whole_array(bad):
    a, b = models()
    X = np.tile(np.eye(4), (50000, 2, 1, 1))
    X[:, :, 0, 3] = 9
    X[bad, 0, 1, 1] = 2
    with pytest.raises(ValueError, match=f"pose {bad} "):
        bocst.collide_poses(a, b, X[:, 0])
    scene = bocst.Scene()
    scene.add_fixed(a, np.eye(4))
    scene.add_moving(b)
    for Y in (X[:, :1], X[:, :1].copy(), X[:, :1].swapaxes(2, 3).copy().swapaxes(2, 3)):
        for call in (scene.collisions, scene.first_collision, scene.clearances):
            with pytest.raises(ValueError, match=f"state {bad} "):
                call(Y)


class Refusing:
    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("call detach() first")


def test_why_an_object_is_no_array_is_told():
    a, b = models()
    with pytest.raises(TypeError, match="X_AB must be an array of real numbers, not .*Refusing") as info:
        bocst.collide_poses(a, b, Refusing())
    assert "call detach() first" in str(info.value.__cause__)
    with pytest.raises(TypeError) as info:
        bocst.Mesh([[0, 0, 0], [1, 0]], T)
    assert "inhomogeneous" in str(info.value.__cause__)


def reflected():
    X = np.eye(4)
    X[0, 0] = -1
    return X


@pytest.mark.parametrize("X, error, words", [
    (np.eye(4), ValueError, r"X_AB has the shape \(4, 4\); \(n, 4, 4\) is expected"),
    (np.zeros((5, 3, 4)), ValueError, r"X_AB has the shape \(5, 3, 4\)"),
    (np.zeros((2, 5, 4, 4)), ValueError, r"X_AB has the shape \(2, 5, 4, 4\)"),
    (4.0, ValueError, "X_AB has the shape"),
    (np.tile(np.eye(4), (3, 1, 1)).astype(complex), TypeError, "X_AB must be an array of real numbers"),
    (nan_in(np.tile(np.eye(4), (9000, 1, 1)), (7000, 0, 3)), ValueError, "pose .*has the translation .*not finite"),
    (nan_in(np.tile(np.eye(4), (3, 1, 1)), (2, 0, 0)), ValueError, "pose 2 has the rotation .*not finite"),
    (np.stack([np.eye(4), np.diag([2.0, 2, 2, 1])]), ValueError, "pose 1 has the rotation"),
    (np.stack([np.eye(4), reflected()]), ValueError, "pose 1 has the rotation .* a reflection"),
    (np.stack([np.eye(4), shift(1, 2, 3).T]), ValueError, "pose 1 has the last row 1 2 3 1 "),
    (np.diag([1, 1, 1, 1 + 1e-9])[None], ValueError, "pose 0 has the last row 0 0 0 1.0000000010"),
])
def test_what_is_no_pose(X, error, words):
    a, b = models()
    with pytest.raises(error, match=words):
        bocst.collide_poses(a, b, X)


def test_the_first_bad_pose_is_named_also_among_many():
    a, b = models()
    X = np.tile(np.eye(4), (200000, 1, 1))
    X[123456, 0, 0] = X[150000, 0, 0] = 2
    for threads in (1, 2):
        with pytest.raises(ValueError, match="pose 123456 "):
            bocst.collide_poses(a, b, X, threads=threads)


@pytest.mark.parametrize("call", [
    lambda s: s.collides(np.eye(4)[None]),
    lambda s: s.collides(np.zeros((3, 4, 4))),
    lambda s: s.collides(np.zeros((1, 2, 4, 4))),
    lambda s: s.collisions(np.zeros((5, 4, 4))),
    lambda s: s.collisions(np.zeros((5, 3, 4, 4))),
    lambda s: s.edge_is_free(np.tile(np.eye(4), (2, 1, 1)), np.eye(4)[None]),
])
def test_states_of_another_number_of_objects(call):
    scene = bocst.Scene()
    for model in models():
        scene.add_moving(model)
    with pytest.raises(ValueError, match=r"has the shape .*\(.*2, 4, 4\) is expected"):
        call(scene)


@pytest.mark.parametrize("begin, end, name", [
    (np.zeros((3, 3)), np.eye(4), "X_WM_begin"),
    (np.eye(4), np.zeros((3, 3)), "X_WM_end"),
    (np.tile(np.eye(4), (2, 1, 1)), np.eye(4), "X_WM_begin"),
    (np.eye(4), np.tile(np.eye(4), (2, 1, 1)), "X_WM_end"),
    (np.ones((4, 4)), np.eye(4), "X_WM_begin"),
    (np.eye(4), np.ones((4, 4)), "X_WM_end"),
])
def test_edges_name_the_argument(begin, end, name):
    scene = bocst.Scene()
    scene.add_moving(models()[0])
    with pytest.raises(ValueError, match=name):
        scene.edge_is_free(begin, end)


@pytest.mark.parametrize("order", [lambda X: X, lambda X: np.swapaxes(np.swapaxes(X, -1, -2).copy(), -1, -2)])
def test_a_bad_last_row_is_named_by_its_place_in_the_array(order):
    scene = bocst.Scene()
    fixed = scene.add_fixed(models()[0], np.eye(4))
    for model in models():
        scene.add_moving(model)
    X = np.tile(np.eye(4), (5, 2, 1, 1))
    X[3, 1, 3] = 0, 0.5, 0, 1
    for call, words in ((lambda: scene.collisions(order(X)), r"X_WM\[3, 1\] has the last row 0 0.5 0 1; 0 0 0 1 is"),
                        (lambda: scene.collides(order(X[3])), r"X_WM\[1\] has the last row 0 0.5 0 1; "),
                        (lambda: scene.edge_is_free(X[0], order(X[3])), r"X_WM_end\[1\] has the last row 0 0.5 0 1; "),
                        (lambda: scene.set_pose(fixed, order(X[3, 1])), r"X_WG has the last row 0 0.5 0 1; ")):
        with pytest.raises(ValueError, match=words):
            call()


def test_masked_arrays_are_refused():
    masked = np.ma.masked_array(V, mask=np.zeros_like(V))
    with pytest.raises(TypeError, match="vertices is a masked array"):
        bocst.Mesh(masked, np.array([[0, 1, 2]]))

    class Table:  # as of pandas, whose mask is a function
        mask = None

        def __array__(self, *args, **kwargs):
            return V

    assert np.array_equal(bocst.Mesh(Table(), T).vertices, V)


def test_empty_states():
    scene = bocst.Scene()
    assert not scene.collides(np.zeros((0, 4, 4)))
    assert scene.collisions(np.zeros((7, 0, 4, 4))).shape == (7,)
    scene.add_moving(models()[0])
    assert scene.collisions(np.zeros((0, 1, 4, 4))).shape == (0,)


@pytest.mark.parametrize("make, error, words", [
    (lambda: fcl.Sphere(np.nan), ValueError, "radius is not finite"),
    (lambda: fcl.Box(1, -1, 1), ValueError, "y is negative"),
    (lambda: fcl.Box("1", 1, 1), TypeError, ""),
    (lambda: fcl.TriangleP([0, 0], [0, 0, 1], [1, 0, 0]), ValueError, r"a has the shape \(2,\)"),
    (lambda: fcl.TriangleP([0, 0, 0], [0, np.inf, 1], [1, 0, 0]), ValueError, "b has the value inf"),
    (lambda: fcl.Plane(np.zeros(3), 1.0), ValueError, "n is the zero vector"),
    (lambda: fcl.Transform(np.ones((3, 3))), ValueError, "rotation"),
    (lambda: fcl.Transform(np.diag([1.0, 1, -1])), ValueError, "rotation"),
    (lambda: fcl.Transform(np.zeros(4)), ValueError, "quaternion"),
    (lambda: fcl.Transform(np.array([np.nan, 0, 0])), ValueError, "translation has the value nan"),
    (lambda: fcl.Transform(np.eye(4)), ValueError, r"rotation has the shape \(4, 4\)"),
    (lambda: fcl.Transform(np.eye(3), np.zeros(2)), ValueError, "translation"),
    (lambda: fcl.Convex(box()[0], 1, [3, 0, 1, 9]), ValueError, "face 0 .* index 9"),
    (lambda: fcl.Convex(box()[0], 2, [3, 0, 1, 2]), ValueError, "face 1"),
    (lambda: fcl.Convex(box()[0], 1, [3, 0, 1]), ValueError, "face 0"),
    (lambda: fcl.CollisionObject(None), TypeError, ""),
    (lambda: fcl.CollisionObject(fcl.BVHModel()), ValueError, "endModel"),
    (lambda: fcl.CollisionRequest(num_max_contacts=-1), TypeError, ""),
    (lambda: fcl.BVHModel().endModel(), ValueError, "beginModel"),
    (lambda: bocst.Options(subdivision="quadtree"), ValueError, "subdivision is 'quadtree'; one of octree, bono"),
    (lambda: bocst.Options(ttl=np.nan), ValueError, "ttl"),
    (lambda: bocst.Options(speed=1), TypeError, ""),
    (lambda: bocst.Model(bocst.Mesh(V, T), depth=40), ValueError, "depth"),
    (lambda: bocst.Model(bocst.Mesh(V, T), bocst.Options(), depth=4), TypeError, "not both"),
    (lambda: bocst.Model(bocst.Mesh(V, T[1:]), solid=True), ValueError, "watertight"),
    (lambda: bocst.Model(None), (TypeError, ValueError), ""),
    (lambda: bocst.load_mesh("/nowhere/cube.obj"), RuntimeError, "/nowhere/cube.obj"),
    (lambda: bocst.load_mesh(b"/nowhere/\xff.obj"), RuntimeError, "/nowhere/\udcff.obj: no such file"),
])
def test_what_is_refused(make, error, words):
    with pytest.raises(error, match=words):
        make()


def test_messages_name_the_project():
    with pytest.raises(ValueError) as caught:
        bocst.Mesh(V, [[0, 1, 99]])
    assert re.match("bocst", str(caught.value))
