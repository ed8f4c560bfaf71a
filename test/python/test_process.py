# SPDX-License-Identifier: BSD-3-Clause
"""Threads, memory, and other libraries in the same process."""
import concurrent.futures
import ctypes
import gc
import re
import resource
import subprocess
import sys
import threading

import bocst
import bocst._bocst
import bocst.fcl as fcl
import numpy as np
import pytest
from shapes import box, poses, shift, torus


def test_threads_have_the_answers_of_one():
    a, b = bocst.Model(bocst.Mesh(*torus())), bocst.Model(bocst.Mesh(*torus(12)), ttl=0.05)
    parts = poses(8000, 1.5).reshape(16, 500, 4, 4)
    expected = [bocst.collide_poses(bocst.Model(a.mesh), bocst.Model(b.mesh), part) for part in parts]
    request = fcl.CollisionRequest()

    def objects(part):
        o1, o2 = fcl.CollisionObject(a), fcl.CollisionObject(b)
        hits = []
        for X in part:
            o2.setTransform(fcl.Transform(X[:3, :3], X[:3, 3]))
            hits.append(fcl.collide(o1, o2, request) > 0)
        return hits

    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for ask in (lambda part: bocst.collide_poses(a, b, part), objects):
            for got, hits in zip(pool.map(ask, parts), expected):
                assert np.array_equal(got, hits)


def test_queries_let_go_of_the_gil():
    """Another thread runs while one is inside a query: it counts, which needs the GIL."""
    model = bocst.Model(bocst.Mesh(*torus(64)))
    X = poses(200000, 1.2)
    begun, done = threading.Event(), threading.Event()

    def query():
        begun.set()
        bocst.collide_poses(model, model, X)
        done.set()

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)  # From now on nobody gives it up but who lets go of it.
    try:
        thread = threading.Thread(target=query)
        thread.start()
        begun.wait()
        seen = done.is_set()
        thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert not seen


def test_a_scene_changes_while_it_is_asked():
    """States of another number of objects are refused, and never read beyond their end."""
    scene = bocst.Scene()
    scene.add_fixed(bocst.Model(bocst.Mesh(*torus())), np.eye(4))
    scene.add_moving(fcl.Sphere(0.2))
    stop = threading.Event()
    refused = []

    def change():
        while not stop.is_set():
            scene.remove(scene.add_moving(fcl.Sphere(0.1)))

    changer = threading.Thread(target=change)
    changer.start()
    try:
        X = poses(300, 1.5)[:, None]
        expected = None
        for _ in range(60):
            try:
                hits = scene.collisions(X)
            except (ValueError, RuntimeError) as error:  # before the first state, or between two
                refused.append(str(error))
                continue
            expected = hits if expected is None else expected
            assert np.array_equal(hits, expected)
    finally:
        stop.set()
        changer.join()
    assert all("(n, 2, 4, 4) is expected" in words or "came or went" in words for words in refused)


def resident():
    """Bytes of this process that are in memory."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def leaks(make, count):
    """Bytes that each call of make() leaves behind."""
    for _ in range(count // 5):
        make()
    gc.collect()
    before = resident()
    for _ in range(count):
        make()
    gc.collect()
    return (resident() - before) / count


MESH = bocst.Mesh(*box(0.5))
X = poses(4, 0.5)


def a_model():
    model = bocst.Model(MESH)
    bocst.collide_poses(model, model, X)


def some_objects():
    bvh = fcl.BVHModel()
    bvh.beginModel()
    bvh.addSubModel(*box(0.5))
    bvh.endModel()
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([fcl.CollisionObject(bvh), fcl.CollisionObject(bvh), fcl.CollisionObject(fcl.Sphere(1))])
    manager.setup()
    data = fcl.CollisionData(request=fcl.CollisionRequest(100, True))
    manager.collide(data, fcl.defaultCollisionCallback)
    assert data.result.is_collision


def a_scene():
    scene = bocst.Scene()
    scene.add_fixed(bocst.Model(MESH), np.eye(4))
    scene.add_moving(fcl.Sphere(0.3))
    scene.collisions(X)


def a_mistake():
    for mistake in (lambda: bocst.Mesh([[0, 0, 0]], [[0, 0, 1]]), lambda: bocst.collide_poses(0, 0, 0),
                    lambda: fcl.BVHModel().endModel(), lambda: bocst.Model(MESH, depth=99)):
        with pytest.raises((ValueError, TypeError)):
            mistake()


def arrays():
    mesh = bocst.Mesh(*box(0.5))
    mesh.vertices, mesh.triangles, mesh.bounds, mesh.health()
    bocst.spheres(mesh, 3)


def leaked_allocations(leak_check, capfd):
    """What LeakSanitizer sees that nobody refers to: the interpreter has some of its own, this module has none."""
    gc.collect()
    capfd.readouterr()
    if not leak_check():
        return 0
    report = capfd.readouterr().err
    assert not re.search("bocst|pybind11|fcl", report), report
    return int(re.search(r"leaked in (\d+) allocation", report).group(1))


@pytest.mark.parametrize("make", [a_model, some_objects, a_scene, a_mistake, arrays])
def test_nothing_is_left_behind(make, capfd):
    try:
        leak_check = ctypes.CDLL(None).__lsan_do_recoverable_leak_check
    except AttributeError:
        # A leak of one object, or of one array, a call would be 50 bytes at least, each time. What the allocator takes once
        # in a while is no leak.
        assert any(leaks(make, 4000) < 40 for _ in range(3))
        return
    # AddressSanitizer keeps what is freed for a while, so memory in use tells nothing.
    make()
    before = leaked_allocations(leak_check, capfd)
    for _ in range(100):
        make()
    assert leaked_allocations(leak_check, capfd) < before + 100


def test_only_the_entry_point_is_seen():
    """Nothing of FCL in this module is found by, or taken from, another copy of FCL in the process."""
    names = subprocess.run(["nm", "-DC", "--defined-only", bocst._bocst.__file__], check=True, text=True,
                           stdout=subprocess.PIPE).stdout.split("\n")
    assert [line.split()[-1] for line in names if line] == ["PyInit__bocst"]


CALL = """
import ctypes, sys
for library in sys.argv[2:]:
    ctypes.CDLL(library, getattr(ctypes, sys.argv[1]))
import numpy as np, bocst, bocst.fcl as fcl
mesh = bocst.Mesh(2 * np.eye(3), [[0, 1, 2]])
def bvh(kind):
    b = kind(); b.beginModel(); b.addSubModel(mesh.vertices, mesh.triangles); b.endModel()
    return b
at = lambda g, x: fcl.CollisionObject(g, fcl.Transform(np.array([x, 0.0, 0.0])))
solids = [fcl.Sphere(1.2), fcl.Box(2.2, 2.2, 2.2), fcl.Halfspace([1, 1, 1], 2.5)]
meshes = [bocst.Model(mesh), bvh(fcl.BVHModel), bvh(fcl.BVHModelOBBRSS)]
for a in meshes:
    for b in meshes + solids:
        assert fcl.collide(at(a, 0), at(b, 0)) == 1 and fcl.collide(at(b, 0), at(a, 0)) == 1, (a, b)
        if b is not solids[2]:
            assert fcl.collide(at(a, 0), at(b, 9)) == 0 and fcl.distance(at(a, 0), at(b, 9)) > 5, (a, b)
manager = fcl.DynamicAABBTreeCollisionManager()
manager.registerObjects([at(meshes[0], 0), at(meshes[1], 0), at(solids[0], 5)])
manager.setup()
data = fcl.CollisionData(fcl.CollisionRequest(num_max_contacts=9))
manager.collide(data, fcl.defaultCollisionCallback)
assert {c.o1 for c in data.result.contacts} | {c.o2 for c in data.result.contacts} == set(meshes[:2])
fcl.continuousCollide(at(meshes[0], 0), fcl.Transform(), at(solids[0], 9), fcl.Transform())
"""


def libraries():
    """libfcl and, where it is not in the module itself, libbocst."""
    lines = subprocess.run(["ldd", bocst._bocst.__file__], check=True, text=True, stdout=subprocess.PIPE).stdout
    paths = {line.split()[0].split(".")[0]: line.split()[2] for line in lines.splitlines() if "=> /" in line}
    return [paths[name] for name in ("libfcl", "libbocst") if name in paths]


@pytest.mark.parametrize("mode", ["RTLD_LOCAL", "RTLD_GLOBAL"])
def test_any_order_of_libraries(mode):
    found = libraries()
    for loaded in ([], found[:1], found[1:], found, found[::-1]):
        subprocess.run([sys.executable, "-c", CALL, mode, *loaded], check=True)


@pytest.mark.parametrize("ask", ["bocst.collide_poses(model, model, X)", "scene.collisions(X[:, None])",
                                 "manager.collide(None, lambda a, b, d: False)"])
def test_a_daemon_thread_may_still_ask_at_exit(ask):
    code = f"""
import threading, time, numpy as np, bocst, bocst.fcl as fcl
rng = np.random.default_rng(1)
model = bocst.Model(bocst.Mesh(rng.uniform(-1, 1, (3000, 3)), np.arange(3000).reshape(-1, 3)))
X = np.tile(np.eye(4), (200000, 1, 1))
X[:, :3, 3] = rng.uniform(-2, 2, (200000, 3))
scene = bocst.Scene()
scene.add_fixed(model, np.eye(4))
scene.add_moving(model)
manager = fcl.DynamicAABBTreeCollisionManager()
manager.registerObjects([fcl.CollisionObject(fcl.Sphere(1)) for _ in range(40)])
manager.setup()
def run():
    while True:
        {ask}
for _ in range(3):
    threading.Thread(target=run, daemon=True).start()
time.sleep(0.3)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
