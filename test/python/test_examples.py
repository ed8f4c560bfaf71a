# SPDX-License-Identifier: BSD-3-Clause
"""The examples of share/examples/python do what they say."""
import importlib.util
import os
import pathlib
import re
import subprocess
import sys

import bocst
import numpy as np

SHARE = pathlib.Path(os.environ.get("BOCST_SOURCE", pathlib.Path(__file__).parents[2])) / "share"


def run(script, *arguments):
    done = subprocess.run([sys.executable, str(SHARE / "examples" / "python" / script), *map(str, arguments)],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_inspect_mesh(tmp_path):
    link = SHARE / "models" / "link.obj"
    text = run("inspect_mesh.py", link, 4)
    assert "watertight: True" in text and "2560 vertices" in text
    spheres = [int(n) for n in re.findall(r"^ +\d +(\d+) ", text, re.M)]
    assert spheres == [len(bocst.spheres(bocst.load_mesh(link), level)[1]) for level in (1, 2, 3, 4)]
    if importlib.util.find_spec("matplotlib"):
        picture = tmp_path / "link.png"
        run("inspect_mesh.py", link, 3, picture)
        assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 10000


def test_planner():
    for seed in (1, 2, 3):
        text = run("planner.py", SHARE / "models" / "wall.obj", SHARE / "models" / "link.obj", seed)
        states = int(re.search(r"a path of (\d+) states", text).group(1))
        assert states > 2 and len(re.findall(r"\[ *-?\d[^\]]*\]", text)) == states


def test_robot_spheres(tmp_path):
    names = ["link", "gripper"]
    files = [SHARE / "models" / f"{name}.obj" for name in names]
    out = tmp_path / "robot.yaml"
    run("robot_spheres.py", 40, out, *files)
    links = re.split(r"^  (\w+):$", out.read_text(), flags=re.M)
    assert links[0] == "collision_spheres:\n" and links[1::2] == names
    for file, text in zip(files, links[2::2]):
        numbers = np.array([float(n) for n in re.findall(r"-?\d+\.\d+", text)]).reshape(-1, 4)
        assert 4 < len(numbers) <= 40
        mesh = bocst.load_mesh(file)
        gaps = np.linalg.norm(mesh.vertices[:, None] - numbers[None, :, :3], axis=2) - numbers[None, :, 3]
        assert gaps.min(axis=1).max() <= 0
