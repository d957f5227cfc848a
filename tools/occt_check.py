#!/usr/bin/env python3
"""Reads what we write with Open CASCADE: every IGES file given is converted by `nurbray convert`,
and the original and the copy must have as many faces and the same area there.

    python3 -m venv V && V/bin/pip install cadquery-ocp
    cargo build --release && V/bin/python tools/occt_check.py [FILE ...]

Without files: those of samples and of ../shared/corpus. Prints a line for each file, and what its
read and transfer took there; ends with 1 if a copy differs where we show the same faces as it."""
import json
import pathlib
import subprocess
import sys
import tempfile
import time

from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.IGESControl import IGESControl_Reader
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer

ROOT = pathlib.Path(__file__).resolve().parent.parent
NURBRAY = ROOT / "target/release/nurbray"
MOST = 1_000_000  # bytes of a file
ACCURACY = 1e-4  # of the area, and ten times what the other side aims at


def static(owner, name):
    """Some versions of the binding mark static functions."""
    return getattr(owner, name + "_s", None) or getattr(owner, name)


def read(path):
    """Faces, area in square millimetres, and CPU seconds of reading and transfer."""
    started = time.process_time()
    reader = IGESControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    shape = reader.OneShape()
    took = time.process_time() - started
    faces, explorer = 0, TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        faces += 1
        explorer.Next()
    sums = GProp_GProps()
    static(BRepGProp, "SurfaceProperties")(shape, sums, ACCURACY / 10)
    return faces, sums.Mass(), took


def shown(path):
    """How many faces we show of a file."""
    done = subprocess.run([NURBRAY, "info", "--json", path], capture_output=True, text=True)
    return json.loads(done.stdout).get("patches", {}).get("shown", 0) if done.stdout else 0


def main():
    files = [pathlib.Path(name) for name in sys.argv[1:]]
    if not files:
        folders = [ROOT / "samples", ROOT / "../shared/corpus/iges"]
        files = sorted(f for folder in folders for f in folder.glob("*.ig*s"))
        files = [f for f in files if f.stat().st_size <= MOST]
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "copy.igs"
        for path in files:
            ours = shown(path)
            command = [NURBRAY, "convert", path, "-o", copy]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode != 0 or ours == 0:
                print(f"{path.name}: not written")
                continue
            (faces, area, took), (again, found, _) = read(path), read(copy)
            # A face with several outer loops is several in the copy.
            is_wrong = again != shown(copy)
            # Where the other side shows other faces of the original, there is no area to compare.
            if faces == ours:
                is_wrong |= abs(found - area) > ACCURACY * max(area, found)
            wrong += is_wrong
            print(
                f"{path.name}: {ours} faces here, {faces} there; the copy {again}; "
                f"area {area:.9g}, the copy {found:.9g}; {took:.3f} s"
                f"{' WRONG' if is_wrong else ''}",
                flush=True,
            )
    print(f"{wrong} wrong")
    return 1 if wrong else 0


sys.exit(main())
