# SPDX-License-Identifier: BSD-3-Clause
"""Models, many poses of a pair, scenes, and what inspect says."""
import contextlib
import copy
import pathlib
import pickle
import signal

import bocst
import bocst._bocst
import bocst.fcl as fcl
import numpy as np
import pytest
from shapes import box, poses, shift, torus


def touches(a, X, b):
    """One query of FCL's kind."""
    tf = fcl.Transform(X[:3, :3], X[:3, 3])
    return fcl.collide(fcl.CollisionObject(a), fcl.CollisionObject(b, tf)) > 0


def obbrss(vertices, triangles):
    bvh = fcl.BVHModelOBBRSS()
    bvh.beginModel(len(triangles), len(vertices))
    bvh.addSubModel(vertices, triangles)
    bvh.endModel()
    return bvh


@pytest.mark.parametrize("options", [{}, dict(subdivision="octree"), dict(answer="conservative", depth=5),
                                     dict(margin=0.1), dict(solid=True)])
def test_poses_have_the_verdicts_of_collide(options):
    a, b = bocst.Model(bocst.Mesh(*torus()), **options), bocst.Model(bocst.Mesh(*torus(10)), **options)
    X = poses(3000, 2.2)
    expected = np.array([touches(a, x, b) for x in X])
    assert 300 < expected.sum() < 2700
    for threads in (1, 2, 0):
        assert np.array_equal(bocst.collide_poses(a, b, X, threads=threads), expected)


def test_exact_answers_are_those_of_fcls_own_tree():
    mesh_a, mesh_b = torus(), torus(10)
    X = poses(2000, 1.8, seed=5)
    hits = bocst.collide_poses(bocst.Model(bocst.Mesh(*mesh_a)), bocst.Model(bocst.Mesh(*mesh_b)), X)
    bvh_a, bvh_b = obbrss(*mesh_a), obbrss(*mesh_b)
    assert np.array_equal(hits, [touches(bvh_a, x, bvh_b) for x in X])


def test_a_model_grows_and_says_so():
    a, b = bocst.Model(bocst.Mesh(*torus())), bocst.Model(bocst.Mesh(*torus()))
    assert a.statistics().resident_nodes == 1
    assert a.oracle_name in ("cpu", "occlusion", "compute")
    bocst.collide_poses(a, b, poses(50, 1.0))
    after = a.statistics()
    assert after.resident_nodes > 1 and after.expansions > 0 and after.resident_bytes > 0
    assert sum(after.nodes_per_level) <= after.resident_nodes
    nodes = a.nodes()
    assert len(nodes["radius"]) == len(nodes["center"]) == len(nodes["parent"])
    parent, level = nodes["parent"], nodes["level"]
    assert parent[0] == -1 and level[0] == 1
    assert np.all(parent[1:] >= 0) and np.all(parent[1:] < np.arange(1, len(parent)))
    assert np.array_equal(level[1:], level[parent[1:]] + 1)
    assert np.array_equal(np.bincount(parent[1:], minlength=len(parent)), nodes["children"])


def test_options_come_back():
    options = bocst.Options(subdivision="octree", answer="conservative", depth=4, dimension=100.0, oracle="cpu", ttl=0.5,
                            memory_budget=1 << 20, margin=0.25, solid=False, build_ahead=True)
    model = bocst.Model(bocst.Mesh(*box()), options)
    assert model.options == options and options != bocst.Options()
    assert bocst.Options(ttl=1e-9).ttl == 0.001, "0 would be never"
    assert model.options.ttl == 0.5 and model.options.margin == 0.25 and model.options.oracle == "cpu"
    assert "depth=4" in repr(options)
    with pytest.raises(AttributeError):
        options.depth = 5


def test_deforming():
    a, b = bocst.Model(bocst.Mesh(*box())), bocst.Model(bocst.Mesh(*box()))
    X = shift(3)[None]
    assert not bocst.collide_poses(a, b, X)[0]
    a.update_vertices(2.5 * box()[0])
    assert bocst.collide_poses(a, b, X)[0]
    assert np.array_equal(a.mesh.vertices, 2.5 * box()[0])
    with pytest.raises(ValueError):
        a.update_vertices(box()[0][:5])
    with pytest.raises(ValueError):
        a.update_vertices(np.full((8, 3), np.nan))
    assert bocst.collide_poses(a, b, X)[0]
    a.build_tree()
    assert a.statistics().built_triangles >= len(a.mesh.triangles)
    a.prune()
    with pytest.raises(RuntimeError):
        a.release_mesh()


def test_spheres_hold_the_surface():
    mesh = bocst.Mesh(*torus())
    inside = mesh.vertices[mesh.triangles].mean(axis=1)
    for subdivision in ("bono", "octree"):
        for depth in (1, 4):
            centers, radii = bocst.spheres(mesh, depth, subdivision)
            gap = np.linalg.norm(inside[:, None] - centers[None], axis=2) - radii
            assert gap.min(axis=1).max() <= 1e-12
            assert len(radii) == (1 if depth == 1 else len(centers))
    assert len(bocst.spheres(mesh, 6)[1]) > len(bocst.spheres(mesh, 4)[1])


def test_health():
    health = bocst.Mesh(*box()).health()
    assert health.watertight and health.oriented and health.components == 1
    assert health.area == pytest.approx(24) and abs(health.volume) == pytest.approx(8)
    vertices, triangles = box()
    health = bocst.Mesh(vertices, np.concatenate([triangles[1:], triangles[-1:]])).health()
    assert not health.watertight and health.volume is None and health.duplicate_triangles == 1


def test_files(tmp_path):
    file = tmp_path / "triangle.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for name in (file, str(file), str(file).encode()):
        mesh = bocst.load_mesh(name)
        assert np.array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert np.array_equal(mesh.bounds, [[0, 0, 0], [1, 1, 0]])
    file.write_text("v 0 0 0\nf 1 2 3\n")
    with pytest.raises(RuntimeError, match="triangle.obj"):
        bocst.load_mesh(file)
    assert mesh.with_vertices(2 * mesh.vertices).bounds[1, 0] == 2


def test_oracles():
    assert "cpu" in [o.name for o in bocst.available_oracles() if not o.why_not]
    for oracle in bocst.available_oracles():
        if oracle.why_not:
            with pytest.raises(bocst.OracleError):
                bocst.Model(bocst.Mesh(*box()), oracle=oracle.kind)


def robot():
    """A scene of fixed shapes and two moving ones, and the pairs as fcl.collide sees them."""
    scene = bocst.Scene(threads=2)
    fixed = [(bocst.Model(bocst.Mesh(*torus())), shift(2)), (fcl.Box(1, 1, 1), shift(-2)), (fcl.Sphere(0.5), shift(0, 2))]
    moving = [bocst.Model(bocst.Mesh(*box(0.2))), fcl.Capsule(0.2, 1.0)]
    ids = [scene.add_fixed(g, X) for g, X in fixed], [scene.add_moving(g) for g in moving]

    def collides(state, ignored=()):
        placed = [(g, X, id) for (g, X), id in zip(fixed, ids[0])] + list(zip(moving, state, ids[1]))
        objects = [(fcl.CollisionObject(g, fcl.Transform(X[:3, :3], X[:3, 3])), id) for g, X, id in placed]
        return any(fcl.collide(objects[i][0], objects[j][0]) > 0
                   for i in range(3, 5) for j in range(i) if {objects[i][1], objects[j][1]} not in ignored)

    return scene, ids, collides


def test_scene():
    scene, (fixed, moving), collides = robot()
    assert (scene.fixed_count, scene.moving_count, scene.pair_count) == (3, 2, 7)
    X = poses(1200, 2.5).reshape(600, 2, 4, 4)
    expected = np.array([collides(state) for state in X])
    assert 60 < expected.sum() < 540
    assert np.array_equal(scene.collisions(X), expected)
    assert scene.first_collision(X) == np.argmax(expected) and scene.any_collision(X)
    assert scene.first_collision(X[:0]) == 0 and not scene.any_collision(X[:0]) and scene.collisions(X[:0]).size == 0
    assert scene.first_collision(X[~expected]) == (~expected).sum() and not scene.any_collision(X[~expected])
    for state, hit in zip(X[:100], expected):
        assert scene.collides(state) == hit
        pair = scene.colliding_pair(state)
        assert (pair is not None) == hit and (not hit or set(pair) & set(moving))
        assert (scene.clearance(state) <= 0) == hit
        assert len(scene.nearest_pair(state)) == 2
        touching = scene.colliding_pairs(state)
        assert bool(touching) == hit and (not hit or pair in touching)
        pairs, distances, points = scene.pairs_within(state, 1.0)
        assert (scene.clearance(state) <= 1) == bool(pairs) and (np.diff(distances) >= 0).all()
        assert set(touching) == {p for p, d in zip(pairs, distances) if d == 0}
        if pairs:
            assert distances[0] == scene.clearance(state) and scene.nearest_pair(state) in pairs
            apart = distances > 0
            gaps = np.linalg.norm(points[:, 0] - points[:, 1], axis=1)
            assert points.shape == (len(pairs), 2, 3) and np.allclose(gaps[apart], distances[apart], atol=1e-5)
    assert np.array_equal(scene.clearances(X[:100]), [scene.clearance(state) for state in X[:100]])
    assert scene.clearances(X[:0]).shape == (0,)
    assert np.array_equal(scene.clearances(X[:100], at_most=0.3), np.minimum(scene.clearances(X[:100]), 0.3))
    assert scene.clearance(X[0], 0.0) == 0
    with pytest.raises(ValueError, match="at_most is -1"):
        scene.clearances(X[:1], at_most=-1)
    with pytest.raises(ValueError, match="distance is -1"):
        scene.pairs_within(X[0], -1.0)
    scene.build_trees()
    assert np.array_equal(scene.collisions(X), expected)
    scene.ignore(moving[0], fixed[0])
    assert scene.pair_count == 6
    ignored = [{moving[0], fixed[0]}]
    assert np.array_equal(scene.collisions(X), [collides(state, ignored) for state in X])
    scene.ignore(moving[0], fixed[0], False)
    assert np.array_equal(scene.collisions(X), expected)


def test_scene_changes():
    scene, (fixed, moving), _ = robot()
    state = np.stack([shift(0, 0, 3), shift(0, 0, -3)])
    assert not scene.collides(state)
    scene.set_pose(fixed[0], shift(0, 0, 3))
    assert scene.colliding_pair(state) is None, "the torus has a hole"
    scene.set_pose(fixed[1], shift(0, 0, 3))
    assert scene.colliding_pair(state) == (moving[0], fixed[1])
    scene.remove(fixed[1])
    assert not scene.collides(state)
    assert scene.edge_is_free(state, state)
    far = state.copy()
    far[0, :3, 3] = 4, 0, 3
    assert not scene.edge_is_free(state, far)
    for motion in ("translation", "screw", "spline"):
        assert not scene.edge_is_free(state, far, motion)
    with pytest.raises(ValueError, match="motion is 'walk'"):
        scene.edge_is_free(state, far, "walk")
    assert scene.moving_index(moving[1]) == 1
    scene.remove(moving[0])
    assert scene.moving_index(moving[1]) == 0
    with pytest.raises(ValueError, match="removed"):
        scene.remove(moving[0])
    with pytest.raises(ValueError, match="another scene"):
        bocst.Scene().remove(fixed[0])
    with pytest.raises(ValueError, match="Scene::setPose: X_WG has the rotation"):
        scene.set_pose(fixed[0], np.diag([2.0, 1, 1, 1]))


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_meshes_options_and_models_are_pickled(protocol):
    mesh = bocst.Mesh(*torus())
    options = bocst.Options(margin=0.25, answer="conservative", depth=5, ttl=0.5)
    model = bocst.Model(mesh, options)
    for again in (lambda x: pickle.loads(pickle.dumps(x, protocol)), copy.deepcopy, copy.copy):
        other = again(mesh)
        assert np.array_equal(other.vertices, mesh.vertices) and np.array_equal(other.triangles, mesh.triangles)
        assert again(options) == options
        assert again(model).options == options and np.array_equal(again(model).mesh.vertices, mesh.vertices)
    together = pickle.loads(pickle.dumps((mesh, model), protocol))
    assert np.array_equal(together[1].mesh.vertices, together[0].vertices)
    with contextlib.suppress(bocst.OracleError):  # only a device can keep the mesh
        model.release_mesh()
    if model.mesh is None:
        with pytest.raises(ValueError, match="without its mesh"):
            pickle.dumps(model, protocol)


def test_signals_are_handled_during_long_calls():
    """A handler runs several times in one call; without a check, once at its end."""
    a = bocst.Model(bocst.Mesh(*torus(40)))
    scene = bocst.Scene()
    scene.add_fixed(a, np.eye(4))
    scene.add_moving(a)
    X = np.tile(shift(1.3, 0.2, 0.1), (1000, 1, 1))
    X[:, 0, 3] += np.linspace(0, 0.1, 1000)
    for call in (lambda Y: bocst.collide_poses(a, a, Y, threads=1), scene.collisions, scene.clearances):
        handled, before = [], signal.signal(signal.SIGALRM, lambda *_: handled.append(1))
        Y = X
        try:
            while len(handled) < 3 and len(Y) < 1 << 21:
                Y = np.tile(Y, (4, 1, 1))
                signal.setitimer(signal.ITIMER_REAL, 0.05, 0.05)
                handled.clear()
                call(Y)
                signal.setitimer(signal.ITIMER_REAL, 0)
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
        assert len(handled) >= 3


def test_scene_keeps_its_geometries():
    scene = bocst.Scene()
    scene.add_fixed(bocst.Model(bocst.Mesh(*box())), np.eye(4))
    scene.add_moving(fcl.Sphere(0.2))
    assert scene.collides(shift(1)[None]) and not scene.collides(shift(3)[None])


def test_every_field_says_what_it_is():
    for module in (bocst._bocst, bocst._bocst.fcl):
        for cls in vars(module).values():
            if not isinstance(cls, type):
                continue
            assert cls.__doc__, cls
            for name, member in vars(cls).items():
                if isinstance(member, property) and not hasattr(cls, "__members__"):
                    assert len(member.__doc__ or "") > 10 and "self" not in member.__doc__, (cls, name)


def test_reprs_are_a_line_of_what_counts():
    mesh = bocst.Mesh(*box())
    model = bocst.Model(mesh)
    scene = bocst.Scene()
    first, second = scene.add_fixed(model, np.eye(4)), scene.add_moving(fcl.Sphere(0.5))
    request, result = fcl.CollisionRequest(enable_contact=True), fcl.CollisionResult()
    nearest, time = fcl.DistanceResult(), fcl.ContinuousCollisionResult()
    a, b = fcl.CollisionObject(model), fcl.CollisionObject(fcl.Sphere(0.5), fcl.Transform(np.array([1, 0.25, 0.1])))
    fcl.collide(a, b, request, result)
    fcl.distance(a, b, fcl.DistanceRequest(True), nearest)
    manager, bvh = fcl.DynamicAABBTreeCollisionManager(), fcl.BVHModel()
    manager.registerObject(a)
    expected = {
        "Mesh(8 vertices, 12 triangles)": mesh,
        "Model(12 triangles, conservative, 1 node)": bocst.Model(mesh, answer="conservative"),
        "Scene(1 fixed, 1 moving, 1 pair)": scene,
        "CollisionResult(collision, 1 contact, 0 cost sources)": result,
        "ContinuousCollisionResult(is_collide=False, time_of_contact=1.0)": time,
        "Sphere(radius=0.5)": fcl.Sphere(0.5),
        "Box(side=[1.0, 2.0, 3.0])": fcl.Box(1, 2, 3),
        "BVHModel(0 triangles)": bvh,
        "DynamicAABBTreeCollisionManager(1 object)": manager,
        "Transform(q=[1.0, 0.0, 0.0, 0.0], t=[1.0, 0.0, 0.0])": fcl.Transform(np.array([1.0, 0, 0])),
    }
    for text, thing in expected.items():
        assert repr(thing) == text
    assert repr(first) != repr(second) and repr(first).startswith("Id(")
    begins = {"Health(components=1, open_edges=0, ": mesh.health(), "Statistics(resident_nodes=": model.statistics(),
              "OracleInfo(kind='": bocst.available_oracles()[0], "Contact(o1=Model(": result.contacts[0],
              "DistanceResult(min_distance=": nearest, "CollisionObject(Sphere(radius=0.5), Transform(": b,
              "CollisionRequest(num_max_contacts=1, enable_contact=True, ": request}
    for text, thing in begins.items():
        assert repr(thing).startswith(text) and "\n" not in repr(thing)
    assert "gjk_solver_type='GST_LIBCCD'" in repr(request)


def test_a_star_import_has_what_the_stub_has():
    import ast
    tree = ast.parse((pathlib.Path(bocst.__file__).parent / "fcl.pyi").read_text())
    names = {node.name for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))} | {"Model"}
    absent = set() if hasattr(fcl, "OcTree") else {"OcTree"}
    assert set(fcl.__all__) == {name for name in names if not name.startswith("_")} - absent


def test_the_stubs_know_the_package():
    """What the .pyi files say is there, is there; and the other way round."""
    import ast
    for module, file in ((bocst, "__init__.pyi"), (fcl, "fcl.pyi")):
        tree = ast.parse((pathlib.Path(bocst.__file__).parent / file).read_text())
        said = {}
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                said[node.name] = {n.name if isinstance(n, ast.FunctionDef) else n.target.id for n in node.body
                                   if isinstance(n, (ast.FunctionDef, ast.AnnAssign))}
            elif isinstance(node, (ast.FunctionDef, ast.AnnAssign)):
                said[node.name if isinstance(node, ast.FunctionDef) else node.target.id] = set()
            elif isinstance(node, ast.Assign):
                assert all(target.id.startswith("_") for target in node.targets), "a type that no program can import"
        public = {name for name in vars(module) if not name.startswith("_")} - {"fcl"}
        assert public - set(said) - {"Model" if module is fcl else ""} == set(), module
        for name, members in said.items():
            if name == "_Enum":
                continue
            assert hasattr(module, name), name
            thing = getattr(module, name)
            if not isinstance(thing, type):
                assert thing.__doc__, name
                continue
            there = {m for m in vars(thing) if not m.startswith("_")}
            there -= {"name", "value"} if hasattr(thing, "__members__") else set()
            instance = set() if not name.endswith("Data") else {"request", "result", "done"}
            assert there | instance == {m for m in members if not m.startswith("_")}, name
    assert (pathlib.Path(bocst.__file__).parent / "py.typed").exists()
