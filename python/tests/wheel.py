"""Packs a wheel with an extension module that cargo has built already, with the metadata that maturin writes.

`pip install ./python` has maturin build everything a second time, with other features of the dependencies; this takes a second.

Usage: wheel.py PACKAGE OUT
    PACKAGE  a folder with the package `formation` as it is to be installed
    OUT      the folder for the wheel, whose name is printed
"""

import base64
import hashlib
import pathlib
import subprocess
import sys
import tempfile
import zipfile

PROJECT = pathlib.Path(__file__).resolve().parents[1]


def main():
    package, out = map(pathlib.Path, sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        maturin = pathlib.Path(sys.executable).with_name("maturin")
        command = [maturin, "pep517", "write-dist-info", "--metadata-directory", folder]
        subprocess.run(command, cwd=PROJECT, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        [information] = pathlib.Path(folder).glob("*.dist-info")
        words = dict(line.split(": ", 1) for line in (information / "WHEEL").read_text().splitlines() if line)
        name = f"{information.name.removesuffix('.dist-info')}-{words['Tag']}.whl"
        files = [(path, path.relative_to(package)) for path in sorted((package / "formation").iterdir())]
        files += [(path, path.relative_to(folder)) for path in sorted(information.iterdir())]
        record = ""
        with zipfile.ZipFile(out / name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as wheel:
            for path, inside in files:
                data = path.read_bytes()
                digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
                record += f"{inside},sha256={digest},{len(data)}\n"
                wheel.writestr(str(inside), data)
            listed = f"{information.name}/RECORD"
            wheel.writestr(listed, f"{record}{listed},,\n")
    print(name)


main()
