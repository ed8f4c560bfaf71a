#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Usage: test/package/packaging_test.py SOURCE
Are the files for vcpkg, conda and the forge well formed, and do they agree with what CMake has: version, options,
dependencies, files?"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

import yaml

failures = 0

# What CMake asks for, and its names elsewhere; where None, the system has no such package or need.
NAMES = {
    # CMake: vcpkg, conda
    "Threads": (None, None),
    "Eigen3": ("eigen3", "eigen"),
    "fcl": ("fcl", "fcl"),
    "hwy": ("highway", "libhwy"),
    "epoxy": ("libepoxy", "libepoxy"),
    "assimp": ("assimp", "assimp"),
    "pugixml": ("pugixml", "pugixml"),
    "PkgConfig": ("pkgconf", "pkg-config"),
    "CLI11": ("cli11", "cli11"),
    "nlohmann_json": ("nlohmann-json", "nlohmann_json"),
    "meshoptimizer": ("meshoptimizer", "meshoptimizer"),
    "cairo": ("cairo", "cairo"),
    "urdfdom": ("urdfdom", "urdfdom"),
    "console_bridge": ("console-bridge", "console_bridge"),
}

# Stand-ins for vcpkg's functions: the port file runs with them and leaves what it would do in variables.
VCPKG = r"""
cmake_policy(SET CMP0057 NEW)
macro(vcpkg_check_features)
  set(FEATURE_OPTIONS "")
  set(arguments ${ARGN})
  list(FIND arguments FEATURES at)
  math(EXPR at "${at} + 1")
  list(LENGTH arguments count)
  while(at LESS count)
    math(EXPR after "${at} + 1")
    list(GET arguments ${at} feature)
    list(GET arguments ${after} option)
    message("FEATURE ${feature} ${option}")
    list(APPEND FEATURE_OPTIONS "-D${option}=ON")
    math(EXPR at "${at} + 2")
  endwhile()
endmacro()
macro(vcpkg_find_acquire_program name)
  set(${name} /usr/bin/${name})
endmacro()
function(vcpkg_cmake_configure)
  foreach(argument IN LISTS ARGN)
    message("CONFIGURE ${argument}")
  endforeach()
endfunction()
foreach(name vcpkg_check_linkage vcpkg_cmake_install vcpkg_cmake_config_fixup vcpkg_fixup_pkgconfig vcpkg_copy_tools vcpkg_install_copyright)
  function(${name})
    message("CALL ${CMAKE_CURRENT_FUNCTION} ${ARGN}")
  endfunction()
endforeach()
function(file)
  message("FILE ${ARGN}")
endfunction()
set(FEATURES io tools)
set(PORT bocst)
set(CURRENT_PACKAGES_DIR /packages)
include(${PORTFILE})
"""


def expect(holds, what):
    global failures
    if not holds:
        print("FAILED:", what)
        failures += 1


def options_of(texts):
    return set(re.findall(r"^\s*(?:option|set)\((BOCST_\w+|BUILD_\w+) ", texts, re.M))


def check_vcpkg(source, version, options, packages):
    port = source / "share/packaging/vcpkg/bocst"
    manifest = json.loads((port / "vcpkg.json").read_text(encoding="utf-8"))
    expect(manifest["name"] == port.name and manifest["version"] == version, "vcpkg.json: name or version")
    features = [manifest, *manifest["features"].values()]
    names = {d if isinstance(d, str) else d["name"] for f in features for d in f["dependencies"]}
    for package in packages:
        expect(NAMES[package][0] in names | {None}, f"vcpkg.json lacks {NAMES[package][0]}, CMake's {package}")
    expect(names <= {n for n, _ in NAMES.values()} | {"bocst", "vcpkg-cmake", "vcpkg-cmake-config"},
           f"vcpkg.json has what CMake does not ask for: {names}")
    expect(set(manifest["default-features"]) <= set(manifest["features"]), "vcpkg.json: default-features")

    script = port / "portfile.cmake"
    with tempfile.NamedTemporaryFile("w", suffix=".cmake") as stand_ins:
        stand_ins.write(VCPKG)
        stand_ins.flush()
        done = subprocess.run(["cmake", f"-DPORTFILE={script}", "-P", stand_ins.name], text=True, check=False,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    expect(done.returncode == 0, f"portfile.cmake: {done.stdout}")
    said = done.stdout.splitlines()
    expect({line.split()[1] for line in said if line.startswith("FEATURE ")} == set(manifest["features"]),
           "portfile.cmake and vcpkg.json have other features")
    used = set(re.findall(r"-D(BOCST_\w+)=", done.stdout))
    expect(used and used <= options, f"portfile.cmake sets what CMake does not know: {used - options}")
    expect(f"CONFIGURE {source}" in said, f"portfile.cmake builds another folder: {said}")
    for call in ("vcpkg_cmake_install", "vcpkg_cmake_config_fixup", "vcpkg_install_copyright"):
        expect(any(line.startswith(f"CALL {call}") for line in said), f"portfile.cmake: no {call}")
    target = set(re.findall(r"bocst::\w+", (port / "usage").read_text(encoding="utf-8")))
    expect(target == {"bocst::bocst", "bocst::io"}, f"usage names {target}")


def check_conda(source, version, options, packages):
    file = source / "share/packaging/conda/recipe.yaml"
    recipe = yaml.safe_load(file.read_text(encoding="utf-8"))
    expect(recipe["schema_version"] == 1 and recipe["context"]["version"] == version, "recipe.yaml: version")
    names = {str(line).split()[0] for part in ("build", "host") for line in recipe["requirements"][part]}
    for package in packages:
        expect(NAMES[package][1] in names | {None}, f"recipe.yaml lacks {NAMES[package][1]}, CMake's {package}")
    used = set(re.findall(r"-D(BOCST_\w+)=", "\n".join(recipe["build"]["script"])))
    expect(used and used <= options, f"recipe.yaml sets what CMake does not know: {used - options}")
    expect((file.parent / recipe["source"]["path"]).resolve() == source, "recipe.yaml builds another folder")
    expect((source / recipe["about"]["license_file"]).is_file(), "recipe.yaml: no licence")


def check_workflow(source):
    workflow = yaml.safe_load((source / ".github/workflows/build.yml").read_text(encoding="utf-8"))
    job = workflow["jobs"]["test"]
    expect({"debian:12", "ubuntu:24.04"} <= set(job["strategy"]["matrix"]["image"]), "the workflow lacks an image")
    commands = "\n".join(step.get("run", "") for step in job["steps"])
    scripts = re.findall(r"^\s*((?:tools|test)/[\w/.-]+)", commands, re.M)
    expect({"tools/quickstart", "tools/test"} <= set(scripts), "the workflow does not build and test")
    for script in scripts:
        expect((source / script).stat().st_mode & 0o111, f"the workflow runs {script}, which is no program")


def main():
    source = pathlib.Path(sys.argv[1]).resolve()
    lists = "\n".join((source / name).read_text(encoding="utf-8")
                      for name in ("CMakeLists.txt", "src/CMakeLists.txt", "tools/CMakeLists.txt"))
    version = re.search(r"project\(bocst VERSION (\S+)", lists).group(1)
    packages = set(re.findall(r"find_package\((\w+)(?: [\d.]+)? REQUIRED", lists))
    packages |= set(re.findall(r"pkg_check_modules\(\w+ REQUIRED (?:IMPORTED_TARGET )?(\w+)", lists))
    packages.discard("Python3")
    expect(packages >= {"fcl", "hwy", "epoxy", "cairo", "assimp"}, f"CMake asks for {packages}")
    options = options_of(lists)
    check_vcpkg(source, version, options, packages)
    check_conda(source, version, options, packages)
    check_workflow(source)
    return 1 if failures else 0


sys.exit(main())
