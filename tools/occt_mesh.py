#!/usr/bin/env python3
"""Triangles of bodies, beside those of Open CASCADE at the same measured deviation.

    python3 -m venv V && V/bin/pip install cadquery-ocp
    cargo build --release && V/bin/python tools/occt_mesh.py [FILE ...]

Without files: ten bodies of ../shared/corpus. Both sides make triangles on one thread, with the same
limit of 15 degrees. First each gets the default tolerance, 1/2000 of the diagonal: `kept` is what
`nurbray compare` then measures, in tolerances, both ways. Then theirs is asked for what brings the
measured deviation to ours, within five percent; triangles and times are compared there. Times are
the best of seven: those of making triangles, in which ours find out which faces meet, and those from the
file on, as theirs do that while reading."""

import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.IGESControl import IGESControl_Reader
from OCP.Interface import Interface_Static
from OCP.StlAPI import StlAPI_Writer

ROOT = pathlib.Path(__file__).resolve().parent.parent
NURBRAY = ROOT / "target/release/nurbray"
ANGLE = 15.0
RUNS = 7
BODIES = ["bladex_shaft.iges", "gmsh_model1.igs", "gmsh_sphere_Rhino3D_default.igs", "mayo_cube.iges",
          "made_brep186_NIST_PMI_1.igs", "made_brep186_NIST_PMI_3.igs", "made_brep186_screw.igs",
          "occt_bearing.iges", "occt_hammer.iges", "pygem_test_pipe_hollow.iges"]


# How Open CASCADE calls units of length; it reads files into the one it is told.
UNITS = {"mm": "MM", "m": "M", "cm": "CM", "in": "INCH", "ft": "FT", "um": "UM"}


def static(owner, name):
    """Some versions of the binding mark static functions."""
    return getattr(owner, name + "_s", None) or getattr(owner, name)


def clean(shape):
    static(BRepTools, "Clean")(shape)


def theirs(shape, length, out):
    """Seconds that Open CASCADE takes; its triangles are written to `out`."""
    best = math.inf
    for _ in range(RUNS):
        clean(shape)
        started = time.process_time()
        BRepMesh_IncrementalMesh(shape, length, False, math.radians(ANGLE), False)
        best = min(best, time.process_time() - started)
    writer = StlAPI_Writer()
    writer.ASCIIMode = False
    writer.Write(shape, str(out))
    return best


def ours(body, folder):
    """Seconds that we take to read and to make triangles, the tolerance and the mesh; the runs are in one
    process, as theirs."""
    copies = [folder / f"{run}{body.suffix}" for run in range(RUNS)]
    for copy in copies:
        shutil.copy(body, copy)
    run = subprocess.run([NURBRAY, "convert", *copies, "-o", folder / "{stem}.stl", "--angle", str(ANGLE),
                          "--log", "json"],
                         env={**os.environ, "RAYON_NUM_THREADS": "1"}, check=True,
                         capture_output=True, text=True)
    reports = [json.loads(line) for line in run.stdout.splitlines()]
    reports = [report for report in reports if "tessellate_s" in report]
    reading, making = (min(report[name] for report in reports) for name in ("read_s", "tessellate_s"))
    return reading, making, reports[0]["tolerance"], folder / "0.stl"


def measured(body, mesh, folder):
    """Triangles, and the largest distance both ways."""
    subprocess.run([NURBRAY, "compare", body, mesh, "-o", folder, "--size", "64x48", "--samples",
                    "1"], check=True, capture_output=True)
    found = json.loads((folder / "report.json").read_text())["meshes"][0]
    return found["triangles"], found["hausdorff_found"]


def read(body, unit):
    """What Open CASCADE makes of a file, and the seconds that it takes."""
    best = math.inf
    for _ in range(RUNS):
        reader = IGESControl_Reader()
        static(Interface_Static, "SetCVal")("xstep.cascade.unit", UNITS[unit])
        started = time.process_time()
        reader.ReadFile(str(body))
        reader.TransferRoots()
        shape = reader.OneShape()
        best = min(best, time.process_time() - started)
    return shape, best


def compare(body, folder):
    read_ours, time_ours, tolerance, mesh = ours(body, folder)
    count_ours, deviation = measured(body, mesh, folder / "ours")
    info = subprocess.run([NURBRAY, "info", body, "--json"], check=True, capture_output=True)
    unit = json.loads(info.stdout)["unit"]["name"]
    shape, read_theirs = read(body, unit)
    length, kept = tolerance, None
    for _ in range(8):
        time_theirs = theirs(shape, length, mesh)
        count, found = measured(body, mesh, folder / "theirs")
        kept = kept or found / tolerance
        if abs(found / deviation - 1.0) < 0.05 or deviation == found:
            break
        length *= min(max(deviation / max(found, 1e-12 * tolerance), 0.2), 5.0)
        if not tolerance / 20.0 < length < 50.0 * tolerance:
            break
    return {"name": body.name, "kept_ours": deviation / tolerance, "kept_theirs": kept,
            "ratio": found / deviation if deviation > 0 else 1.0, "ours": count_ours, "theirs": count,
            "times": [(time_ours, time_theirs), (read_ours + time_ours, read_theirs + time_theirs)]}


def main():
    bodies = [pathlib.Path(name) for name in sys.argv[1:]]
    bodies = bodies or [ROOT / "../shared/corpus/iges" / name for name in BODIES]
    print("| body | kept by us | kept by theirs | triangles | theirs | ratio | ms | theirs | ratio "
          "| ms from the file | theirs | ratio |")
    print("|" + "---|" * 12)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for body in bodies:
            row = compare(body.resolve(), pathlib.Path(folder))
            rows.append(row)
            off = "" if abs(row["ratio"] - 1.0) < 0.05 else f" (at {row['ratio']:.2f} of our deviation)"
            kept = f"{row['kept_ours']:.2f} | {row['kept_theirs']:.2f}"
            print(line(row["name"], kept, (row["ours"], row["theirs"]), off, row["times"]), flush=True)
    counts = [sum(row[side] for row in rows) for side in ("ours", "theirs")]
    times = [[sum(row["times"][k][side] for row in rows) for side in (0, 1)] for k in (0, 1)]
    print(line("all", " | ", counts, "", times))


def line(name, kept, counts, off, times):
    """A row of the table."""
    ours, theirs = counts
    pairs = " | ".join(f"{1e3 * a:.1f} | {1e3 * b:.1f} | {a / b:.2f}" for a, b in times)
    return f"| {name} | {kept} | {ours} | {theirs}{off} | {ours / theirs:.2f} | {pairs} |"


if __name__ == "__main__":
    main()
