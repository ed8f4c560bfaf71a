# SPDX-License-Identifier: BSD-3-Clause
"""What pyproject.toml names as its build backend: setuptools, with the extension module built by CMake."""
import os
import pathlib
import re
import subprocess
import sys

from setuptools import Extension, build_meta, setup
from setuptools.command.build_ext import build_ext

SOURCE = pathlib.Path(__file__).resolve().parents[2]


class CMakeBuild(build_ext):
    """Builds and installs the component `python`, with the libraries of bocst beside the module. The environment's
    BOCST_BUILD names a build folder that is there already; its module is taken."""

    def build_extension(self, ext):
        build = pathlib.Path(os.environ.get("BOCST_BUILD", pathlib.Path(self.build_temp).resolve()))
        if "BOCST_BUILD" not in os.environ:
            subprocess.run(["cmake", "-S", SOURCE, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DBOCST_BUILD_PYTHON=ON",
                            f"-DBOCST_PYTHON={sys.executable}", "-DBOCST_BUILD_TOOLS=OFF", "-DBOCST_BUILD_TESTS=OFF"],
                           check=True)
        subprocess.run(["cmake", "--build", build, "--target", "bocst_python"], check=True)
        package = pathlib.Path(self.get_ext_fullpath(ext.name)).resolve().parent
        subprocess.run(["cmake", f"-DCMAKE_INSTALL_PREFIX={package.parent}", "-Dwheel=ON",
                        "-DCMAKE_INSTALL_COMPONENT=python", "-P", build / "src/python/cmake_install.cmake"], check=True)


class Backend(build_meta._BuildMetaBackend):  # pylint: disable=protected-access
    """Calls setup() where setuptools would look for a setup.py at the top level."""

    def run_setup(self, setup_script="setup.py"):
        version = re.search(r"project\(bocst VERSION ([\d.]+)", (SOURCE / "CMakeLists.txt").read_text()).group(1)
        setup(
            version=version,
            ext_modules=[Extension("bocst._bocst", [])],
            cmdclass={"build_ext": CMakeBuild},
            options={"build": {"build_base": "build-pip", "build_temp": "build-pip"}},
        )


backend = Backend()
