#!/usr/bin/env python3
"""Shows samples as glTF in three.js, in headless Chromium: plain, on a grid, and compressed. Needs
npm and Chromium; without them nothing is tested.

    tools/viewer.py target/release/nurbray [FOLDER]

Pictures are left in FOLDER, if there is one. Ends with 1 if a file is not shown, or if the
compressed one looks different."""

import base64
import functools
import http.server
import pathlib
import shutil
import subprocess
import sys
import tempfile
import threading
import time

from browser import Browser

ROOT = pathlib.Path(__file__).resolve().parent.parent
SAMPLES = ["teapot.obj", "can.igs", "goblet.x3d"]
WAYS = {"plain": [], "grid": ["--quantize"], "packed": ["--quantize", "--meshopt"]}
PAGE = """<!doctype html><body style="margin:0"><canvas id="c" width="640" height="480"></canvas>
<script type="importmap">{"imports":{"three":"./node_modules/three/build/three.module.js"}}</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from './node_modules/three/examples/jsm/loaders/GLTFLoader.js';
import { MeshoptDecoder } from './node_modules/three/examples/jsm/libs/meshopt_decoder.module.js';
const renderer = new THREE.WebGLRenderer({ canvas: document.getElementById('c'), antialias: true,
    preserveDrawingBuffer: true });
const loader = new GLTFLoader();
loader.setMeshoptDecoder(MeshoptDecoder);
window.show = async path => {
    const scene = new THREE.Scene();
    scene.background = new THREE.Color(0xffffff);
    const gltf = await loader.loadAsync(path);
    scene.add(gltf.scene, new THREE.HemisphereLight(0xffffff, 0x444444, 3));
    const box = new THREE.Box3().setFromObject(gltf.scene);
    const middle = box.getCenter(new THREE.Vector3()), size = box.getSize(new THREE.Vector3()).length();
    const camera = new THREE.PerspectiveCamera(30, 4 / 3, size / 100, size * 10);
    camera.position.copy(middle).add(new THREE.Vector3(1, 0.7, 1.4).multiplyScalar(size));
    camera.lookAt(middle);
    renderer.render(scene, camera);
    const pixels = new Uint8Array(640 * 480 * 4), gl = renderer.getContext();
    gl.readPixels(0, 0, 640, 480, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    window.shown = Array.from(pixels);
    return { triangles: renderer.info.render.triangles,
        drawn: pixels.filter((x, k) => k % 4 == 0 && x < 250).length };
};
window.apart = before => window.shown.reduce((most, x, k) => most + (Math.abs(x - before[k]) > 32), 0);
window.ready = true;
</script>"""


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def check(browser, nurbray, folder, pictures):
    bad = 0
    for sample in SAMPLES:
        for way, options in WAYS.items():
            out = folder / f"{pathlib.Path(sample).stem}_{way}.glb"
            subprocess.run([nurbray, "convert", ROOT / "samples" / sample, "-o", out, *options],
                           check=True, capture_output=True)
            seen = browser.value(f"show('{out.name}')")
            if way == "plain":
                browser.value("window.before = window.shown, 0")
            apart = browser.value("apart(window.before)")
            print(f"{out.name}: {out.stat().st_size} bytes, {seen['triangles']} triangles, "
                  f"{seen['drawn']} pixels, {apart} others than plain")
            bad += seen["drawn"] < 1000 or apart > 4 * 0.002 * 640 * 480
            if pictures:
                shot = browser.ask("Page.captureScreenshot", format="png")["data"]
                (pictures / f"{out.stem}.png").write_bytes(base64.b64decode(shot))
    return bad


def main():
    nurbray = pathlib.Path(sys.argv[1]).resolve()
    pictures = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
    if pictures:
        pictures.mkdir(parents=True, exist_ok=True)
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if not (shutil.which("npm") and chromium):
        print("no npm or no Chromium: glTF files are not looked at")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        done = subprocess.run(["npm", "install", "--no-audit", "--no-fund", "three"], cwd=folder,
                              capture_output=True)
        if done.returncode != 0:
            print("three cannot be installed: glTF files are not looked at")
            return 0
        (folder / "index.html").write_text(PAGE)
        handler = functools.partial(Silent, directory=folder)
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = Browser(chromium, folder / "profile")
        browser.ask("Page.navigate", url=f"http://127.0.0.1:{server.server_port}/index.html")
        until = time.time() + 60
        while not browser.value("window.ready === true"):
            if time.time() > until:
                print("three does not start")
                return 1
            time.sleep(0.2)
        return 1 if check(browser, nurbray, folder, pictures) else 0


if __name__ == "__main__":
    sys.exit(main())
