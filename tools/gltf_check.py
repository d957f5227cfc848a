#!/usr/bin/env python3
"""Converts samples, and ../shared/corpus if it is there, to glTF and gives every file to the
validator of the Khronos group. Needs npm; without it nothing is tested.

    tools/gltf_check.py target/release/nurbray

Prints how many files there were; ends with 1 if one has an error or a warning."""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDERS = ["samples", "../shared/corpus/iges", "../shared/corpus/obj", "../shared/corpus/vrml",
           "../shared/corpus/x3d"]
# Coarse: what is tested is the file, not the triangles.
WAYS = [["--tolerance", "0.5%"], ["--tolerance", "0.5%", "--quantize"]]
SCRIPT = """
const validator = require('gltf-validator'), fs = require('fs');
async function main() {
    for (const path of process.argv.slice(1)) {
        const bytes = new Uint8Array(fs.readFileSync(path));
        const { issues } = await validator.validateBytes(bytes, { uri: path, maxIssues: 3 });
        console.log(JSON.stringify({ path, issues }));
    }
}
main();
"""


def main():
    nurbray = pathlib.Path(sys.argv[1]).resolve()
    if not shutil.which("npm"):
        print("no npm: glTF files are not validated")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", "gltf-validator"],
                              cwd=folder, capture_output=True, text=True)
        if done.returncode != 0:
            print("gltf-validator cannot be installed: glTF files are not validated")
            return 0
        for number, options in enumerate(WAYS):
            for name in FOLDERS:
                source = ROOT / name
                if source.is_dir():
                    out = folder / "out" / str(number) / source.name
                    subprocess.run([nurbray, "convert", source, "-o", "{stem}.glb", "--out-dir",
                                    out, "--jobs", "0", *options], capture_output=True)
        files = sorted((folder / "out").rglob("*.glb"))
        done = subprocess.run(["node", "-e", SCRIPT, *files], cwd=folder, check=True,
                              capture_output=True, text=True)
        found = [json.loads(line) for line in done.stdout.splitlines()]
        bad = [f for f in found if f["issues"]["numErrors"] or f["issues"]["numWarnings"]]
        for file in bad:
            path = pathlib.Path(file["path"]).relative_to(folder / "out")
            print(path, json.dumps(file["issues"]["messages"]))
        print(f"{len(found)} glTF files, {len(bad)} with errors or warnings")
        return 1 if bad or len(found) != len(files) else 0


if __name__ == "__main__":
    sys.exit(main())
