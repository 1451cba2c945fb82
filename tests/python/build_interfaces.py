"""Builds the Python package of the interface files, for an environment that has rclpy from wheels.

Usage: build_interfaces.py ENVIRONMENT BUILD

Run by the interpreter of ENVIRONMENT. BUILD receives the build, and BUILD/install what rclpy imports.
"""

import os
import pathlib
import subprocess
import sys
import sysconfig

import numpy

INTERFACES = pathlib.Path(__file__).resolve().parent.parent.parent / "msgs"
# Where the wheels were built, which their CMake files still name.
BUILDERS_PYTHON = "/opt/python/cp311-cp311"


def correct_paths(share):
    """Has the CMake files of the wheels name the headers of this interpreter."""
    replaced = {
        f"{BUILDERS_PYTHON}/lib/python3.11/site-packages/numpy/_core/include": numpy.get_include(),
        f"{BUILDERS_PYTHON}/include/python3.11": sysconfig.get_paths()["include"],
    }
    for path in share.rglob("*.cmake"):
        before = path.read_text(encoding="utf-8")
        after = before
        for name, here in replaced.items():
            after = after.replace(name, here)
        if after != before:
            path.write_text(after, encoding="utf-8")


def main():
    environment, build = (pathlib.Path(argument).absolute() for argument in sys.argv[1:])
    correct_paths(environment / "share")
    variables = os.environ | {
        "PATH": f"{environment / 'bin'}:{os.environ['PATH']}",
        "AMENT_PREFIX_PATH": str(environment),
        "CMAKE_PREFIX_PATH": str(environment),
    }
    options = [f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF", "-DCMAKE_C_FLAGS=-O0", "-DCMAKE_CXX_FLAGS=-O0"]
    configure = ["cmake", "-Wno-dev", "-S", INTERFACES, "-B", build, f"-DCMAKE_INSTALL_PREFIX={build / 'install'}", *options]
    for command in (configure, ["cmake", "--build", build, "--parallel", "2"], ["cmake", "--install", build]):
        done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit((done.stdout + done.stderr)[-4000:])


if __name__ == "__main__":
    main()
