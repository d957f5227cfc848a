#!/usr/bin/env python3
"""Opens reports of `nurbray compare` in headless Chromium: pictures at two widths, slider,
keyboard, worst places, and that nothing is fetched. Needs Chromium and nothing else; without it
nothing is tested.

    tools/browser.py target/debug/nurbray [FOLDER]

Screenshots are left in FOLDER, if there is one.
"""

import base64
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
REPORTS = [
    ("teapot", ["samples/teapot.obj", "--tolerance", "1%,0.3%,0.1%"]),
    ("machine", ["samples/methods/machine.x3d", "--tolerance", "1mm,0.3mm,0.1mm"]),
]
# Width, height, and whether it is a phone.
SCREENS = [(1280, 900, False), (390, 844, True)]


class Browser:
    """Chromium over a pair of pipes, in the words of its DevTools protocol."""

    def __init__(self, program, profile, drawing="--disable-gpu"):
        to_read, self.to_write = os.pipe()
        self.to_receive, to_send = os.pipe()
        options = "--headless=new --no-sandbox --remote-debugging-pipe --hide-scrollbars " \
            f"--enable-unsafe-swiftshader --no-first-run {drawing}"
        line = f"exec {program} {options} --user-data-dir={profile} 3<&{to_read} 4>&{to_send}"
        self.process = subprocess.Popen(
            ["bash", "-c", line], pass_fds=(to_read, to_send),
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_send)
        self.rest, self.number, self.session, self.events = b"", 0, None, []
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Network"]:
            self.ask(domain + ".enable")

    def receive(self):
        while b"\0" not in self.rest:
            part = os.read(self.to_receive, 1 << 20)
            if not part:
                raise RuntimeError("the browser has gone")
            self.rest += part
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def ask(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to_write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def wait(self, event):
        while not any(e.get("method") == event for e in self.events):
            self.events.append(self.receive())

    def value(self, expression):
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True,
                          awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def press(self, key, code=0, text=""):
        for kind in ["keyDown", "keyUp"]:
            self.ask("Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code,
                     text=text if kind == "keyDown" else "")

    def close(self):
        self.process.terminate()
        self.process.wait()


def chromium():
    names = ["chromium", "chromium-browser", "google-chrome"]
    return next(filter(None, map(shutil.which, names)), None)


def check(truth, text):
    if not truth:
        raise AssertionError(text)


def look(browser, page, screen, shots, name):
    width, height, phone = screen
    browser.events.clear()
    browser.ask("Emulation.setDeviceMetricsOverride", width=width, height=height,
                deviceScaleFactor=1, mobile=phone)
    browser.ask("Page.navigate", url=page.as_uri())
    browser.wait("Page.loadEventFired")
    browser.value("Promise.all([...document.images].map(i => i.complete || i.decode()))")
    inside = browser.value("document.documentElement.scrollWidth")
    check(inside <= width, f"{inside} px wide on a screen of {width}")

    # The slider, by keyboard.
    clip = "document.getElementById('other').style.clipPath"
    before = browser.value(clip)
    browser.value("document.getElementById('slider').focus()")
    for _ in range(5):
        browser.press("ArrowRight", 39)
    check(browser.value("document.getElementById('slider').value") == "55", "slider not moved")
    check(browser.value(clip) != before, "the picture does not follow the slider")

    # And by pointer: a press at a quarter of the picture.
    box = browser.value("(r => [r.x, r.y, r.width, r.height])"
                        "(document.getElementById('stage').getBoundingClientRect())")
    at = {"x": box[0] + box[2] / 4, "y": box[1] + min(box[3], height - box[1]) / 2}
    for kind in ["mousePressed", "mouseReleased"]:
        browser.ask("Input.dispatchMouseEvent", type=kind, button="left", buttons=1, clickCount=1,
                    **at)
    check(browser.value("document.getElementById('slider').value") == "25", "not dragged")

    # Deviation as colours, by its key, and back.
    browser.press("h", 72, "h")
    check(browser.value("document.getElementById('heat').checked"), "no heat map")
    browser.press("h", 72, "h")
    check(not browser.value("document.getElementById('heat').checked"), "heat map stays")

    # Another mesh, by the arrow keys.
    browser.value("document.querySelector('#meshes [aria-checked=true]').focus()")
    browser.press("ArrowRight", 39)
    chosen = "document.querySelector('#meshes [aria-checked=true]').dataset.key"
    check(browser.value(chosen) == "1", "the second mesh is not chosen")
    browser.press("ArrowLeft", 37)

    # A worst place opens and closes.
    browser.value("document.querySelector('#worst button').click()")
    check(browser.value("document.getElementById('crop').open"), "no crop")
    if shots:
        save(browser, shots / f"{name}-{width}-crop.png")
    browser.press("Escape", 27)
    check(not browser.value("document.getElementById('crop').open"), "the crop stays open")

    # The mesh turns.
    drawn = "document.getElementById('solid').toDataURL()"
    first = browser.value(drawn)
    browser.value("document.getElementById('solid').focus()")
    browser.press("ArrowRight", 39)
    if browser.value("!!document.createElement('canvas').getContext('webgl2')"):
        check(browser.value(drawn) != first, "the mesh does not turn")
    else:
        print("  no WebGL here: the mesh was not looked at")

    fetched = [e["params"]["request"]["url"] for e in browser.events
               if e.get("method") == "Network.requestWillBeSent"]
    outside = [url for url in fetched if not url.startswith(("file:", "data:"))]
    check(not outside, f"fetched {outside}")
    if shots:
        browser.value("document.activeElement.blur(); scrollTo(0, 0)")
        save(browser, shots / f"{name}-{width}.png", whole=True)


def save(browser, path, whole=False):
    shot = browser.ask("Page.captureScreenshot", captureBeyondViewport=whole)
    path.write_bytes(base64.b64decode(shot["data"]))


def main():
    program = chromium()
    if not program:
        print("no Chromium: the pages are not tested")
        return
    nurbray = pathlib.Path(sys.argv[1]).resolve()
    shots = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        browser = Browser(program, folder / "profile")
        try:
            for name, arguments in REPORTS:
                report = folder / name
                subprocess.run([nurbray, "compare", *arguments, "-o", report, "--size", "480x360"],
                               cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
                for screen in SCREENS:
                    look(browser, report / "index.html", screen, shots, name)
                    print(f"{name} at {screen[0]} px: as it should be")
        finally:
            browser.close()


if __name__ == "__main__":
    main()
