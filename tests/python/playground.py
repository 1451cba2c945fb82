"""Draws an H on the page of a playground, served as static files under a strict policy. Usage: playground.py FOLDER

Prints what it saw as lines of JSON; ends with an error where something did not come.
"""

import json
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

from browser import Browser
from studio_page import Studio, draw_h

POLICY = ("default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; style-src 'self'; "
          "img-src 'self' data: blob:; connect-src 'self'")


class Handler(SimpleHTTPRequestHandler):
    def end_headers(self):
        self.send_header("Content-Security-Policy", POLICY)
        super().end_headers()

    def log_message(self, *_):
        pass


class Playground(Studio):
    """The page of a playground, used like that of a studio."""

    def __init__(self, folder):
        self.server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=folder))
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.browser = Browser(1280, 720)
        try:
            self.browser.visit(f"http://127.0.0.1:{self.server.server_port}/")
            self.wait("the page", 'return document.body.dataset.ready === "yes"')
        except BaseException:
            self.close()
            raise

    def close(self):
        try:
            self.browser.close()
        finally:
            self.server.shutdown()
            self.server.server_close()


def main(folder):
    with Playground(folder) as page:
        draw_h(page)
        page.await_plan("7 of 7 spots")
        page.browser.click("#play")
        page.wait("the film", "return window.formationStudio.player.time > 0")
        seen = {"run": not page.browser.run('return document.getElementById("live").hidden'),
                # There is no state of a server to be had.
                "faults": [entry["message"] for entry in page.faults() if "api/state" not in entry["message"]]}
        print(json.dumps(seen))


main(sys.argv[1])
