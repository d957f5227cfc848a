#!/usr/bin/env python3
"""Opens X3D files that nurbray writes in X_ITE, in headless Chromium, and checks that they can be
seen: the teapot and a trimmed door. Needs Chromium and the package x_ite, and a person to look at
the pictures that it leaves in FOLDER.

    npm install --prefix target/x_ite x_ite
    tools/x_ite.py target/debug/nurbray target/x_ite FOLDER
"""

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

import browser

SAMPLES = ["teapot.obj", "door.wrl"]
PAGE = """<!DOCTYPE html><meta charset="utf-8"><script src="x_ite.min.js"></script>
<style>body {{ margin: 0 }} x3d-canvas {{ width: 640px; height: 480px }}</style>
<x3d-canvas src="{0}" splashScreen="false"></x3d-canvas>"""
# The share of pixels unlike the first one.
SHARE = """(async () => {{
    const image = new Image();
    image.src = 'data:image/png;base64,{0}';
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height).getContext('2d');
    canvas.drawImage(image, 0, 0);
    const data = canvas.getImageData(0, 0, image.width, image.height).data;
    let other = 0;
    for (let k = 0; k < data.length; k += 4)
        other += [0, 1, 2].some(c => Math.abs(data[k + c] - data[c]) > 8);
    return other / (data.length / 4);
}})()"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def shown(chromium, address, name, shots):
    chromium.events.clear()
    chromium.ask("Page.navigate", url=f"{address}/{name}.html")
    chromium.wait("Page.loadEventFired")
    share = 0.0
    for _ in range(30):
        time.sleep(1)
        picture = chromium.ask("Page.captureScreenshot")["data"]
        share = chromium.value(SHARE.format(picture))
        if share > 0.1:
            break
    (shots / f"{name}.png").write_bytes(base64.b64decode(picture))
    browser.check(share > 0.1, f"{name}: {share:.0%} of the picture shows something")
    print(f"{name}: {share:.0%} of the picture shows something")


def main():
    nurbray, package, shots = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
    shots.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        shutil.copytree(package / "node_modules/x_ite/dist", folder / "pages")
        for sample in SAMPLES:
            name = pathlib.Path(sample).stem
            output = folder / "pages" / f"{name}.x3d"
            subprocess.run([nurbray, "convert", browser.ROOT / "samples" / sample, "-o", output],
                           check=True)
            (output.with_suffix(".html")).write_text(PAGE.format(output.name))
        handler = functools.partial(Quiet, directory=folder / "pages")
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        drawing = "--use-gl=angle --use-angle=swiftshader --ignore-gpu-blocklist"
        chromium = browser.Browser(browser.chromium(), folder / "profile", drawing)
        try:
            chromium.ask("Emulation.setDeviceMetricsOverride", width=640, height=480,
                         deviceScaleFactor=1, mobile=False)
            for sample in SAMPLES:
                address = f"http://127.0.0.1:{server.server_address[1]}"
                shown(chromium, address, pathlib.Path(sample).stem, shots)
        finally:
            chromium.close()


if __name__ == "__main__":
    main()
