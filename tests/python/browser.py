"""A headless Chromium, driven by WebDriver (https://www.w3.org/TR/webdriver2/) with nothing but the standard library."""

import base64
import http.client
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

# Besides what a headless browser needs, nothing of it is to look for a network.
FLAGS = [
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
    "--mute-audio", "--force-device-scale-factor=1",
]
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"
KEYS = {"Left": "\ue012", "Right": "\ue014", "Home": "\ue011", "End": "\ue010", "Space": " ", "Tab": "\ue004",
        "Enter": "\ue007"}


class Missing(Exception):
    """A program that has to be installed."""


def program(*names):
    for name in names:
        if found := shutil.which(name):
            return found
    raise Missing(
        f"`{names[0]}` is missing; install it, on Debian and Ubuntu with `apt-get install chromium chromium-driver`")


class Browser:
    """One browser with one page. Everything that it logs is kept."""

    def __init__(self, width=1280, height=900, dark=False):
        chromium = program("chromium", "chromium-browser", "google-chrome")
        self.profile = tempfile.TemporaryDirectory(prefix="formation-browser-", ignore_cleanup_errors=True)
        self.gestures = 0
        self.driver = subprocess.Popen(
            [program("chromedriver"), "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.session = None
        try:
            self.port = self._port()
            flags = [*FLAGS, f"--user-data-dir={self.profile.name}", f"--window-size={width},{height}"]
            options = {"binary": chromium, "args": flags}
            answer = self._call("POST", "/session", {"capabilities": {"alwaysMatch": {
                "browserName": "chrome", "goog:chromeOptions": options,
                "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}}})
            self.session = answer["sessionId"]
            self.view(width, height, dark)
        except BaseException:
            self.close()
            raise

    def _port(self):
        for line in self.driver.stdout:
            if found := re.search(r"started successfully on port (\d+)", line):
                return int(found[1])
        raise RuntimeError(f"chromedriver ended with status {self.driver.wait()} before it said its port")

    def _call(self, method, path, body=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            payload = None if body is None else json.dumps(body)
            connection.request(method, path, payload, {"Content-Type": "application/json"})
            value = json.loads(connection.getresponse().read())["value"]
        finally:
            connection.close()
        if isinstance(value, dict) and "error" in value:
            raise RuntimeError(f"{method} {path}: {value['error']}: {value.get('message', '')}")
        return value

    def _ask(self, method, command, body=None):
        return self._call(method, f"/session/{self.session}{command}", body)

    def _devtools(self, command, **parameters):
        return self._ask("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def view(self, width, height, dark=False):
        """Makes the page as large as this, in light or dark surroundings."""
        self._devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                       mobile=width < 600)
        self._devtools("Emulation.setEmulatedMedia",
                       features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def open(self, path):
        self.visit(Path(path).resolve().as_uri())

    def visit(self, address):
        self._ask("POST", "/url", {"url": address})

    def run(self, script, *arguments):
        """Runs the body of a function in the page and returns what it returns."""
        return self._ask("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def press(self, *keys):
        """Presses keys one after another, wherever the focus is."""
        actions = []
        for key in keys:
            value = KEYS.get(key, key)
            actions += [{"type": "keyDown", "value": value}, {"type": "keyUp", "value": value}]
        self._ask("POST", "/actions", {"actions": [{"type": "key", "id": "keys", "actions": actions}]})

    def click(self, selector):
        self.gestures += 1
        element = self._ask("POST", "/element", {"using": "css selector", "value": selector})
        self._ask("POST", f"/element/{element[ELEMENT]}/click", {})

    def drag(self, *places):
        """Presses the mouse at the first place of the view, moves it to the others in turn, and releases it."""
        self.gestures += 1
        moves = [{"type": "pointerMove", "duration": 0, "x": round(x), "y": round(y)} for x, y in places]
        actions = [moves[0], {"type": "pointerDown", "button": 0}, *moves[1:], {"type": "pointerUp", "button": 0}]
        mouse = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}
        self._ask("POST", "/actions", {"actions": [mouse]})

    def screenshot(self, left, top, width, height, scale=1.0):
        """A part of the page as PNG."""
        clip = {"x": left, "y": top, "width": width, "height": height, "scale": scale}
        return base64.b64decode(self._devtools("Page.captureScreenshot", format="png", clip=clip)["data"])

    def logged(self):
        """What the console said since the last call."""
        return self._ask("POST", "/se/log", {"type": "browser"})

    def requested(self):
        """The addresses that were asked for since the last call."""
        messages = [json.loads(entry["message"])["message"]
                    for entry in self._ask("POST", "/se/log", {"type": "performance"})]
        return [message["params"]["request"]["url"] for message in messages
                if message["method"] == "Network.requestWillBeSent"]

    def close(self):
        try:
            if self.session:
                self._ask("DELETE", "")
        finally:
            self.driver.terminate()
            try:
                self.driver.wait(10)
            except subprocess.TimeoutExpired:
                self.driver.kill()
                self.driver.wait()
            self.driver.stdout.close()
            self.profile.cleanup()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
