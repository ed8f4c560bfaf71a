#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: page_test.py PROGRAM MODELS [PICTURES]
Opens the pages of `bocst inspect --html`, `bocst collide --html` and so on in Chromium and uses them as a person would.
PICTURES: a folder for screenshots."""

import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

from browser import Browser

PROGRAM, MODELS = sys.argv[1:3]
PICTURES = sys.argv[3] if len(sys.argv) > 3 else None
CELL = os.path.join(MODELS, "..", "examples", "scene", "cell.json")
LINK, GRIPPER = (os.path.join(MODELS, name + ".obj") for name in ("link", "gripper"))

# Pixels of the 3D view that are not background, in the frame that a change of `volume` causes.
COVERAGE = """new Promise(done => {
  document.getElementById('volume').dispatchEvent(new Event('input'));
  requestAnimationFrame(() => {
    const view = document.getElementById('view'), copy = document.createElement('canvas');
    [copy.width, copy.height] = [view.width, view.height];
    const context = copy.getContext('2d');
    context.drawImage(view, 0, 0);
    const pixels = context.getImageData(0, 0, copy.width, copy.height).data;
    let covered = 0;
    for (let i = 0; i < pixels.length; i += 4) covered += Math.abs(pixels[i] - 244) > 3 || Math.abs(pixels[i + 2] - 248) > 3;
    done(covered);
  });
})"""

# The same of pixels in the colour of what touches.
REDS = COVERAGE.replace("Math.abs(pixels[i] - 244) > 3 || Math.abs(pixels[i + 2] - 248) > 3",
                        "pixels[i] > 90 && pixels[i] > 2.5 * pixels[i + 1]")


def torus(file, n):
    with open(file, "w", encoding="ascii") as out:
        out.write(f"OFF\n{n * n} {2 * n * n} 0\n")
        for i in range(n):
            for j in range(n):
                u, v = 2 * math.pi * i / n, 2 * math.pi * j / n
                r = 1 + 0.3 * math.cos(v)
                out.write(f"{r * math.cos(u)} {r * math.sin(u)} {0.3 * math.sin(v)}\n")
        for i in range(n):
            for j in range(n):
                a, b, c, d = (x % n * n + y % n for x in (i, i + 1) for y in (j, j + 1))
                out.write(f"3 {a} {c} {b}\n3 {b} {c} {d}\n")


class PageTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.page = os.path.join(self.folder.name, "page.html")

    def tearDown(self):
        self.folder.cleanup()

    def report(self, *arguments):
        """Makes the page, and gives the report beside it."""
        done = subprocess.run([PROGRAM, *arguments, "--html", self.page, "--json", "-"], check=True,
                              stdout=subprocess.PIPE)
        return json.loads(done.stdout)

    def keep(self, browser, name):
        if PICTURES:
            browser.screenshot(os.path.join(PICTURES, name + ".png"))

    def test_inspect_shows_each_level_of_both_trees(self):
        counts = {}
        for name, subdivision in (("O-BOCST", "octree"), ("B-BOCST", "bono")):
            report = self.report("inspect", LINK, "--depth", "6", "--subdivision", subdivision)
            counts[name] = [level["nodes"] for level in report["levels"]]
        self.assertNotEqual(counts["O-BOCST"], counts["B-BOCST"])
        with Browser() as browser:
            browser.open(self.page)
            self.assertEqual(browser.value("document.title"), "link.obj - bocst")
            self.assertEqual(browser.value("document.getElementById('problem').hidden"), True)
            for name, by_level in counts.items():
                browser.choose("tree", name)
                for level, count in enumerate(by_level, 1):
                    browser.choose("level", level)
                    self.assertEqual(browser.text("count").split()[0].replace(",", ""), str(count))
            self.keep(browser, "inspect")
            # What is drawn: nothing, the mesh, and ever less of spheres and boxes around it.
            browser.choose("mesh", False)
            browser.choose("volume", "none")
            self.assertEqual(browser.value(COVERAGE), 0)
            browser.choose("mesh", True)
            mesh = browser.value(COVERAGE)
            self.assertGreater(mesh, 10000)
            for volume in ("spheres", "boxes"):
                browser.choose("volume", volume)
                covered = []
                for level in (2, 4, 6):
                    browser.choose("level", level)
                    covered.append(browser.value(COVERAGE))
                    self.keep(browser, f"inspect_{volume}_{level}")
                self.assertGreater(covered[0], 1.05 * covered[1])
                self.assertGreater(covered[1], 1.02 * covered[2])
                self.assertGreater(covered[2], mesh)
            self.assertEqual(browser.value("document.querySelectorAll('#plot circle').length"), 12)
            browser.choose("up", "y")
            self.assertNotEqual(browser.value(COVERAGE), covered[2])
            self.assertEqual(browser.complaints, [])

    def test_faults_are_marked(self):
        self.report("inspect", LINK, "--depth", "2", "--no-error")
        with Browser() as browser:
            browser.open(self.page)
            self.assertEqual(browser.value("document.getElementById('faults-row').hidden"), True)
        mesh = os.path.join(self.folder.name, "open.off")
        with open(mesh, "w", encoding="ascii") as out:  # far from the origin, which must not matter
            out.write("OFF\n4 2 0\n1000 0 0\n1001 0 0\n1001 1 0\n1000 1 0\n3 0 1 2\n3 0 2 3\n")
        self.assertEqual(self.report("inspect", mesh, "--depth", "2")["health"]["open_edges"], 4)
        with Browser() as browser:
            browser.open(self.page)
            self.assertEqual(browser.value("document.getElementById('faults-row').hidden"), False)
            browser.choose("volume", "none")
            self.keep(browser, "faults")
            browser.choose("mesh", False)
            self.assertGreater(browser.value(COVERAGE), 300)
            browser.choose("faults", False)
            self.assertEqual(browser.value(COVERAGE), 0)
            self.assertEqual(browser.complaints, [])

    def test_a_large_mesh_is_shown_coarser(self):
        mesh = os.path.join(self.folder.name, "<img src=x onerror=alert(1)>.off")
        torus(mesh, 400)
        self.report("inspect", mesh, "--depth", "3", "--no-error")
        self.assertLess(os.path.getsize(self.page), 8e6)
        with Browser() as browser:
            browser.open(self.page)
            self.assertIn("of 320,000 triangles", browser.text("notes"))
            self.assertEqual(browser.text("title"), os.path.basename(mesh))
            self.assertEqual(browser.value("document.getElementById('plot-row').hidden"), True)
            browser.choose("volume", "none")
            self.assertGreater(browser.value(COVERAGE), 10000)
            self.assertEqual(browser.complaints, [])

    def test_collide_shows_what_grew_and_the_contacts(self):
        for extra in ([], ["--answer", "conservative", "--depth", "5"]):
            report = self.report("collide", LINK, GRIPPER, *extra)
            with Browser() as browser:
                browser.open(self.page)
                facts = browser.text("facts")
                self.assertIn("theymay touch" if "conservative" in facts else "theycollide", facts)
                if not extra:
                    self.assertIn(f"contacts{report['contacts']}", facts)
                at_level = []
                for level in range(1, 6):
                    browser.choose("level", level)
                    at_level.append(int(browser.text("count").split()[0].replace(",", "")))
                self.assertEqual(at_level[0], 2)
                # Deeper, exact answers have lanes of triangles, of which there may be fewer than cells.
                self.assertEqual(sorted(at_level[:3]), at_level[:3])
                self.assertTrue(all(count > 0 for count in at_level))
                self.keep(browser, "collide" + str(len(extra)))
                browser.choose("cut", "leaves")
                self.assertGreater(int(browser.text("count").split()[0].replace(",", "")), at_level[-1])
                browser.choose("mesh", False)
                browser.choose("volume", "none")
                self.assertGreater(browser.value(COVERAGE), 100)
                browser.choose("contacts", False)
                self.assertEqual(browser.value(COVERAGE), 0)
                self.assertEqual(browser.complaints, [])

    def test_objects_contacts_and_scale(self):
        report = self.report("collide", LINK, GRIPPER)
        for width in (420, 1600):
            with Browser(width=width, height=900) as browser:
                browser.open(self.page)
                browser.settle()
                self.keep(browser, f"pair_{width}")
                # Nothing is wider than the window, and the panel's parts do not overlap.
                self.assertLessEqual(browser.value("document.documentElement.scrollWidth"), width)
                self.assertGreater(browser.value("document.getElementById('view').clientHeight"), 300)
                legend = browser.text("legend")
                for word in ("A: link.obj", "B: gripper.obj", "surface", "volumes", "contacts", "normals"):
                    self.assertIn(word, legend)

                # Each object alone, neither, and both.
                browser.choose("volume", "none")
                browser.choose("contacts", False)
                both = browser.value(COVERAGE)
                browser.choose("object-0", False)
                b = browser.value(COVERAGE)
                browser.choose("object-1", False)
                self.assertEqual(browser.value(COVERAGE), 0)
                self.assertEqual(browser.text("count").split()[0], "0")
                browser.choose("object-0", True)
                a = browser.value(COVERAGE)
                self.assertTrue(0 < a < both and 0 < b < both and a + b >= both, (a, b, both))

                # The wireframe covers less than the surface, of which it is a part.
                browser.choose("wires", True)
                self.assertAlmostEqual(browser.value(COVERAGE) / a, 1, delta=0.1)  # lines reach half a pixel out of it
                browser.choose("mesh", False)
                self.assertTrue(0.05 * a < browser.value(COVERAGE) < 1.1 * a)
                self.keep(browser, f"wires_{width}")
                browser.choose("object-1", True)
                browser.choose("mesh", True)
                browser.choose("wires", False)
                browser.choose("contacts", True)

                # The bar's length is of the size of the meshes.
                bar = "[Number(document.getElementById('scale-text').textContent), document.getElementById('scale-bar').offsetWidth]"
                length, pixels = browser.value(bar)
                self.assertTrue(40 <= pixels <= 121, pixels)
                self.assertTrue(0.01 < length < 0.5, length)  # link and gripper together are some 0.4 m long
                self.assertEqual(browser.value("document.querySelectorAll('#axes text').length"), 3)

                # A contact is looked at, and then all again.
                listed = browser.value("[...document.querySelectorAll('#contact-list button')].map(b => b.textContent)")
                self.assertEqual(len(listed), min(200, report["contacts"]))
                self.assertRegex(listed[0], r"^1: at .*, depth .*, triangles \d+ and \d+$")
                browser.value("document.querySelectorAll('#contact-list button')[1].click()")
                browser.settle()
                self.keep(browser, f"contact_{width}")
                self.assertEqual(browser.value("document.querySelectorAll('#contact-list [aria-current=true]').length"), 1)
                near, _ = browser.value(bar)
                self.assertLess(near, length / 4)
                browser.value("document.getElementById('whole').click()")
                browser.settle()
                self.assertEqual(browser.value(bar)[0], length)
                self.assertEqual(browser.complaints, [])

    def test_boxes_do_not_flicker(self):
        # Boxes in whose faces the cube's own faces lie: a turn by a thousandth of a degree must hardly change a pixel.
        mesh = os.path.join(self.folder.name, "cube.off")
        with open(mesh, "w", encoding="ascii") as out:
            out.write("OFF\n8 12 0\n" + "".join(f"{i & 1} {i >> 1 & 1} {i >> 2}\n" for i in range(8)))
            for a, b, c, d in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
                out.write(f"3 {a} {b} {c}\n3 {a} {c} {d}\n")
        self.report("inspect", mesh, "--depth", "5", "--no-error")
        picture = """new Promise(done => {
          const view = document.getElementById('view'), at = {pointerId: 1, clientX: 300, bubbles: true};
          const send = (type, y) => view.dispatchEvent(new PointerEvent(type, {...at, clientY: y}));
          view.setPointerCapture = () => {};
          send('pointerdown', 300); send('pointermove', 300 + MOVE); send('pointerup', 300 + MOVE);
          requestAnimationFrame(() => {
            const copy = document.createElement('canvas');
            [copy.width, copy.height] = [view.width, view.height];
            const context = copy.getContext('2d');
            context.drawImage(view, 0, 0);
            done(Array.from(context.getImageData(0, 0, copy.width, copy.height).data.filter((_, i) => i % 4 === 0)));
          });
        })"""
        with Browser(width=700, height=420) as browser:
            browser.open(self.page)
            browser.choose("volume", "boxes")
            browser.choose("level", 4)
            first = browser.value(picture.replace("MOVE", "0.1"))
            for _ in range(3):
                second = browser.value(picture.replace("MOVE", "0.002"))
                changed = sum(abs(a - b) > 8 for a, b in zip(first, second))
                self.assertLess(changed, len(first) / 2000)
                first = second
            self.keep(browser, "flicker")
            self.assertEqual(browser.complaints, [])

    def test_validate_shows_the_worst_case(self):
        report = self.report("validate", LINK, GRIPPER, "--poses", "60", "--answer", "conservative", "--depth", "5",
                             "--histogram")
        self.assertGreater(report["overestimates"][4]["largest"], 0)
        with Browser() as browser:
            browser.open(self.page)
            facts = browser.text("facts")
            self.assertIn("theymay touch", facts)
            self.assertIn("apart, the farthest of 60 poses", facts)
            pose = [float(x) for x in facts.split("B in A")[1].split("answer")[0].split(",")]
            self.assertEqual(pose, report["overestimates"][4]["pose"])
            self.assertEqual(browser.complaints, [])

    def test_apart_there_are_no_contacts(self):
        self.report("collide", LINK, GRIPPER, "--pose", "9,0,0,1,0,0,0")
        with Browser() as browser:
            browser.open(self.page)
            self.assertIn("theydo not collide", browser.text("facts"))
            self.assertEqual(browser.value("document.getElementById('contacts-row').hidden"), True)
            self.assertEqual(browser.complaints, [])

    def test_scene_shows_each_state_and_what_touches(self):
        report = self.report("scene", CELL, "--clearance")
        self.assertGreater(report["collisions"], 1)
        self.assertLess(report["collisions"], report["asked"])
        with Browser() as browser:
            browser.open(self.page)
            self.assertEqual(browser.value("document.getElementById('volumes-row').hidden"), True)
            self.assertEqual(browser.value("document.getElementById('tree-row').hidden"), True)
            covered = set()
            for k, state in enumerate(report["states"]):
                browser.choose("state", k)
                self.assertEqual(browser.text("state-shown"), f"{k + 1} of {report['asked']} ({state['place']})")
                shown = browser.value("[...document.querySelectorAll('#pairs li')].map(line => line.textContent)")
                self.assertEqual(shown, [" - ".join(pair) for pair in state["pairs"]])
                verdict = "collides" if state["collide"] else f"free, clearance {float('%.4g' % state['clearance'])}"
                self.assertEqual(browser.text("verdict").rstrip("0"), verdict.rstrip("0"))
                covered.add(browser.value(COVERAGE))
                self.keep(browser, f"scene_{k}")
                browser.choose("fixed", False)  # it may stand before what touches
                self.assertEqual(browser.value(REDS) > 100, state["collide"])
                browser.choose("fixed", True)
            self.assertGreater(len(covered), 3)  # the arm moves
            browser.choose("fixed", False)
            arm = browser.value(COVERAGE)
            self.assertGreater(arm, 1000)
            self.assertLess(arm, min(covered) / 2)
            # From one collision to the next, and round.
            hits = [k for k, state in enumerate(report["states"]) if state["collide"]]
            browser.choose("state", hits[0])
            for k in hits[1:] + hits[:1]:
                browser.value("document.getElementById('next').click()")
                self.assertTrue(browser.text("state-shown").startswith(f"{k + 1} of"))
            self.assertEqual(browser.complaints, [])

    def test_scene_without_webgl_names_the_pairs(self):
        report = self.report("scene", CELL)
        first = next(state for state in report["states"] if state["collide"])
        with Browser(webgl=False) as browser:
            browser.open(self.page)
            browser.choose("state", first["index"])
            self.assertEqual(browser.text("verdict"), "collides")
            self.assertIn(" - ".join(first["pairs"][0]), browser.text("pairs"))

    def test_without_webgl_the_figures_remain(self):
        report = self.report("inspect", LINK, "--depth", "4")
        with Browser(webgl=False) as browser:
            browser.open(self.page)
            self.assertIn("no WebGL 2", browser.text("problem"))
            browser.choose("level", 3)
            self.assertEqual(browser.text("count"), f"{report['levels'][2]['nodes']} nodes")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
