#!/usr/bin/env python3
"""Meshes a body with Open CASCADE, through gmsh, compares it with the exact surfaces, and confirms
the worst place with `nurbray probe`: the point of the surface is where the report says it is.
Needs the Python package gmsh; without it nothing is tested.

    tools/foreign.py target/release/nurbray body.igs
"""

import json
import pathlib
import subprocess
import sys
import tempfile


def main():
    nurbray, body = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    try:
        import gmsh
    except ImportError:
        print("no gmsh: no mesh of another tool is tested")
        return
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        mesh = folder / "mesh.stl"
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
        gmsh.model.occ.importShapes(str(body))
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(2)
        gmsh.write(str(mesh))
        gmsh.finalize()
        out = folder / "report"
        run = subprocess.run([nurbray, "compare", body, mesh, "-o", out], check=True,
                             capture_output=True, text=True)
        print(run.stdout, end="")
        found = json.loads((out / "report.json").read_text())["meshes"][0]
        for way, end in [("surface_to_mesh", "from"), ("mesh_to_surface", "to")]:
            worst = found[way]["worst"][0]
            line = "{patch},{u!r},{v!r}\n".format(**worst)
            probe = subprocess.run([nurbray, "probe", body, "--uv", "-", "--json"], check=True,
                                   input=line, capture_output=True, text=True)
            point = json.loads(probe.stdout)["point"]
            off = sum((a - b) ** 2 for a, b in zip(point, worst[end])) ** 0.5
            other = worst["to" if end == "from" else "from"]
            apart = sum((a - b) ** 2 for a, b in zip(point, other)) ** 0.5
            assert off < 1e-9 * found_size(out), f"{way}: {off} beside the surface"
            assert abs(apart - worst["distance"]) < 1e-9 * found_size(out)
            print(f"{way}: {worst['distance']:.6g} at patch {worst['patch']}, confirmed")


def found_size(out):
    return json.loads((out / "report.json").read_text())["size"]


if __name__ == "__main__":
    main()
