#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: test/documents/run.py SOURCE BUILD DOCUMENT...
Does what the documents say: runs the commands of each fenced `sh` block as written, in order, in a folder that looks
like a clone after `tools/quickstart`; builds the programs that they show; looks whether links lead somewhere.

Comments before a fence: <!-- file: NAME --> puts the block into a file of that folder; <!-- not run: REASON --> leaves
a block out, which only those may that need root or the network."""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

BLOCK = re.compile(r"(?:<!-- (?P<mark>file|not run): (?P<what>[^>]*?) -->\n)?```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.M | re.S)


def fail(document, what):
    print(f"FAILED: {document}: {what}")
    return 1


def commands_of(document, folder):
    """The script of a document; files are written at once."""
    script = []
    for block in BLOCK.finditer(document.read_text(encoding="utf-8")):
        mark, what, kind, text = block.group("mark", "what", "kind", "text")
        if mark == "file":
            file = folder / what
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        elif kind == "sh" and mark == "not run":
            if not re.search(r"\b(root|network)\b", what):
                raise ValueError(f"not run for no good reason: {what}")
            print(f"{document.name}: not run ({what}):", text.strip().replace("\n", "; "))
        elif kind == "sh":
            script.append(text)
    return script


def run(document, source, build):
    with tempfile.TemporaryDirectory(prefix="bocst_documents_") as name:
        folder = pathlib.Path(name) / "clone"
        folder.mkdir()
        for entry in source.iterdir():
            if not entry.name.startswith((".", "build")):
                (folder / entry.name).symlink_to(entry)
        (folder / "build").symlink_to(build)
        try:
            script = commands_of(document, folder)
        except ValueError as error:
            return fail(document.name, error)
        if not script:
            return 0
        # `python3` is the interpreter that the Python module was built for; a sanitizer's library wants to be the first.
        cache = (build / "CMakeCache.txt").read_text()
        python = re.search(r"^BOCST_PYTHON:\w+=(.*)$", cache, re.M)
        preload = ""
        if re.search(r"^BOCST_SANITIZE:\w+=.*address", cache, re.M):
            preload = ('export LD_PRELOAD="$(g++ -print-file-name=libasan.so):libstdc++.so.6" '
                       'ASAN_OPTIONS="$ASAN_OPTIONS:detect_leaks=0"\n')
        (folder.parent / "bin").mkdir()
        if python:
            shim = folder.parent / "bin" / "python3"
            shim.write_text(f'#!/bin/sh\n{preload}exec {python[1]} "$@"\n')
            shim.chmod(0o755)
        environment = dict(os.environ, HOME=name, PATH=f"{folder.parent}/bin:{build}/tools:{os.environ['PATH']}")
        done = subprocess.run(["bash", "-euo", "pipefail", "-x", "-c", "".join(script)], cwd=folder, env=environment,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              check=False)
        if done.returncode != 0:
            return fail(document.name, f"exit code {done.returncode}\n{done.stdout[-4000:]}")
        print(f"{document.name}: {len(script)} blocks ran")
        return 0


def anchors_of(document):
    heads = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def broken_links(document):
    failures = 0
    text = re.sub(r"```.*?^```$", "", document.read_text(encoding="utf-8"), flags=re.M | re.S)
    for link in re.findall(r"\]\(([^)]+)\)", text):
        if link.startswith(("http:", "https:")):
            continue
        file, _, anchor = link.partition("#")
        target = (document.parent / file) if file else document
        if not target.exists():
            failures += fail(document.name, f"no {link}")
        elif anchor and anchor not in anchors_of(target):
            failures += fail(document.name, f"no section {link}")
    return failures


def main():
    source, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    documents = [pathlib.Path(argument).resolve() for argument in sys.argv[3:]]
    if shutil.which("cmake") is None or not documents:
        return fail("documents", "no cmake, or no documents")
    failures = 0
    for document in documents:
        failures += run(document, source, build)
        failures += broken_links(document)
    return 1 if failures else 0


sys.exit(main())
