"""The page of `formation studio` as a teacher uses it: drawn by mouse and keyboard, in a headless Chromium."""

import json
import subprocess
import time

from browser import Browser

PATIENCE_S = 90


class Studio:
    """A `formation studio` and a browser that shows its page."""

    def __init__(self, program, *options, width=1280, height=720, dark=False):
        self.process = subprocess.Popen([program, "studio", *options], stdout=subprocess.PIPE,
                                        stderr=subprocess.DEVNULL, text=True)
        self.browser = None
        try:
            self.address = self.process.stdout.readline().strip()
            if not self.address.startswith("http://127.0.0.1:"):
                raise RuntimeError(f"no address of a studio: {self.address!r}, status {self.process.wait(10)}")
            self.browser = Browser(width, height, dark)
            self.browser.visit(self.address)
            self.wait("the page", 'return document.body.dataset.ready === "yes"')
        except BaseException:
            self.close()
            raise

    def wait(self, what, script, *arguments):
        """Waits until a script in the page returns something true, and returns it."""
        deadline = time.monotonic() + PATIENCE_S
        while not (found := self.browser.run(script, *arguments)):
            if time.monotonic() > deadline:
                shown = self.browser.run("return document.body.innerText")
                raise TimeoutError(f"{what} did not come within {PATIENCE_S} s; the page shows:\n{shown}")
            time.sleep(0.05)
        return found

    def tool(self, name):
        self.browser.click(f'[data-tool="{name}"]')

    def place(self, x, y):
        """Where a place of the ground is in the view, which shows it as after `fit`."""
        return self.browser.run("""
            const box = document.getElementById("ground").getBoundingClientRect();
            const { scale, middle } = window.formationStudio.stage;
            return [box.left + box.width / 2 + (arguments[0] - middle.x) * scale,
                    box.top + box.height / 2 - (arguments[1] - middle.y) * scale];
        """, x, y)

    def draw(self, tool, *cells):
        """One stroke of a tool over these cells."""
        self.tool(tool)
        self.browser.drag(*[self.place(x, y) for x, y in cells])

    def text(self, name):
        return self.browser.run("return document.getElementById(arguments[0]).textContent", name)

    def scenario(self):
        """What is drawn."""
        return json.loads(self.browser.run("return JSON.stringify(window.formationStudio.drawing.scenario())"))

    def await_plan(self, words="Planned"):
        return self.wait(f"a plan with `{words}`", """
            const text = document.getElementById("outcome").textContent;
            return text.includes(arguments[0]) && text
        """, words)

    def await_stage(self, words):
        return self.wait(f"the stage `{words}`", """
            const text = document.getElementById("stage").textContent;
            return text.includes(arguments[0]) && text
        """, words)

    def choose(self, name, value):
        self.browser.run("""
            const select = document.getElementById(arguments[0]);
            select.value = arguments[1];
            select.dispatchEvent(new Event("change", { bubbles: true }));
        """, name, value)

    def faults(self):
        """What the console of the page complained of."""
        return [entry for entry in self.browser.logged() if entry["level"] == "SEVERE"]

    def picture(self, path):
        width, height = self.browser.run("return [innerWidth, innerHeight]")
        path.write_bytes(self.browser.screenshot(0, 0, width, height))

    def close(self):
        try:
            if self.browser:
                self.browser.close()
        finally:
            self.process.terminate()
            self.process.wait(30)
            self.process.stdout.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


#: The cells of a letter H of seven spots, as strokes.
LETTER_H = [[(2, 2), (2, 3), (2, 4)], [(4, 2), (4, 3), (4, 4)], [(3, 3)]]


def draw_h(studio):
    """Draws an H, five modules that stand alone and three that are docked; one of the eight is spare."""
    for stroke in LETTER_H:
        studio.draw("spot", *stroke)
    for x in (0, 2, 4, 6, 8):
        studio.draw("module", (x, 0))
    studio.draw("group", (7, 3), (7, 4), (8, 4))
