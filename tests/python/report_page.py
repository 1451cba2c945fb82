"""Opens reports in a real browser, headless, and uses them as people do: by mouse, by keyboard and on a phone.

Reads a JSON list of cases from the standard input, each with the `directory` of a report, its `title`, how many
`modules` and `spots` it has, how many of these are `filled` in the end, whether its film is to be `played`, and whether
only its first screen is looked at (`first_screen_only`).
"""

import json
import struct
import sys
import time
import xml.etree.ElementTree as xml
import zlib
from pathlib import Path

from browser import Browser, Missing

# A picture as large as this is seen whole, so that a screenshot shows all of it.
DESKTOP = (1280, 1500)
PHONE = (360, 740)
# On these the picture and the controls are in view together, without scrolling.
SCREENS = ((1280, 720), (390, 844))
PATIENCE_S = 60
# Every pixel is classified, so a screenshot is taken at half its size.
SHRUNK = 0.5

STATES = """
return [...document.querySelectorAll('.target [data-spot]')].map((spot) => spot.dataset.state)
"""
# Where everything is and what it does, as far as a person sees it.
PICTURE = """
return JSON.stringify([
  [...document.querySelectorAll('#modules [data-module]')].map((module) => [
    module.dataset.module, module.dataset.phase, module.getAttribute('transform'),
    module.querySelector('.body').getAttribute('transform')]),
  [...document.querySelectorAll('.target [data-spot]')].map((spot) => spot.dataset.state),
  [...document.querySelectorAll('#links line')].map((line) => line.getAttribute('display')),
  document.getElementById('now').textContent, document.getElementById('stage').textContent,
])
"""
# For each filled spot: how far the nearest module is, its colour, and points of its square on the screen.
FILLED = """
const centre = (element) => {
  const box = element.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
};
const modules = [...document.querySelectorAll('#modules [data-module]')].map((module) => {
  const square = module.querySelector('.body rect');
  return {id: module.dataset.module, at: centre(square), fill: square.getAttribute('fill')};
});
return [...document.querySelectorAll('.target [data-state="filled"]')].map((spot) => {
  const square = spot.querySelector('rect');
  const [x, y] = centre(square);
  const distance = ({at}) => Math.hypot(at[0] - x, at[1] - y);
  const nearest = modules.reduce((one, other) => (distance(one) <= distance(other) ? one : other));
  const side = square.getBoundingClientRect().width;
  const points = [];
  for (const across of [-0.3, 0.3]) {
    for (const down of [-0.3, 0.3]) points.push([x + across * side, y + down * side]);
  }
  return {spot: spot.dataset.spot, module: nearest.id, apart: distance(nearest), fill: nearest.fill, points};
});
"""
NAMELESS = """
return [...document.querySelectorAll('button, input, select, [tabindex], figure svg')].filter((element) => {
  const labelled = element.getAttribute('aria-labelledby');
  return !(element.getAttribute('aria-label') || element.textContent.trim() || element.labels?.length
    || (labelled && document.getElementById(labelled)));
}).map((element) => element.outerHTML)
"""
FOCUSED = "return document.activeElement.id || document.activeElement.className || document.activeElement.tagName"
OVERFLOWING = """
return [...document.querySelectorAll('body *')].filter((element) => {
  const box = element.getBoundingClientRect();
  return box.width && (box.right > innerWidth + 0.5 || box.left < -0.5)
    && !element.closest('.scroll, .skip, #picture');
}).map((element) => element.outerHTML.slice(0, 120))
"""
# What of the first screen is not as it should be.
FIRST_SCREEN = """
const faults = [];
const visible = (element) => element.getClientRects().length > 0;
const name = (element) => element.id || element.className.baseVal || element.className || element.localName;
const box = (selector) => document.querySelector(selector).getBoundingClientRect();
scrollTo(0, 0);
const controls = [...document.querySelectorAll('#player button, #player input, #player select, #player output')].filter(visible);
if (controls.length < 8) faults.push(`only ${controls.length} controls are shown`);
const boxes = controls.map((control) => [name(control), control.getBoundingClientRect()]);
for (const [index, control] of controls.entries()) {
  const {left, right, top, bottom} = boxes[index][1];
  if (left < 0 || top < 0 || right > innerWidth || bottom > innerHeight) {
    faults.push(`${name(control)} is at ${[left, top, right, bottom].map(Math.round)}, out of view`);
    continue;
  }
  const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  if (!control.contains(hit)) faults.push(`${name(control)} is covered by ${hit && name(hit)}`);
  for (const [other, b] of boxes.slice(index + 1)) {
    if (left < b.right && b.left < right && top < b.bottom && b.top < bottom) faults.push(`${name(control)} lies upon ${other}`);
  }
}
const picture = box('#picture');
const texts = ['h1', '.outcome', 'figcaption', '#player'].map((selector) => box(selector).height);
const rest = innerHeight - texts.reduce((one, other) => one + other);
if (picture.top < 0 || picture.bottom > innerHeight) faults.push('the picture is not in view');
if (rest < 0.4 * innerHeight) faults.push(`only ${Math.round(rest)} pixels are left for the picture`);
if (picture.height < rest - 64)
  faults.push(`the picture is ${Math.round(picture.height)} high, where ${Math.round(rest)} are left`);
if (picture.width < Math.min(innerWidth * 0.9, 1000)) faults.push(`the picture is ${picture.width} wide`);
const ground = box('#picture .floor');
if (Math.max(ground.width / picture.width, ground.height / picture.height) < 0.85) {
  const size = ({width, height}) => `${Math.round(width)} x ${Math.round(height)}`;
  faults.push(`the ground has ${size(ground)} of the picture's ${size(picture)}`);
}
for (const across of [0.02, 0.25, 0.5, 0.75, 0.98]) {
  for (const down of [0.02, 0.25, 0.5, 0.75, 0.98]) {
    const hit = document.elementFromPoint(picture.left + across * picture.width, picture.top + down * picture.height);
    if (!hit?.closest('#picture')) faults.push(`the picture is covered by ${hit && name(hit)}`);
  }
}
return faults;
"""
SEEK_LONGEST_STEP = """
const steps = [...document.querySelectorAll('#steps button')];
steps.reduce((one, other) => (one.textContent.length < other.textContent.length ? other : one)).click();
"""
# The paths that are drawn: how many, and which of them cross a wall or an obstacle.
PATHS = """
const shown = [...document.querySelectorAll('#paths .path')].filter((path) =>
  path.getAttribute('display') !== 'none' && path.getAttribute('d'));
const areas = [...document.querySelectorAll('#picture .obstacle')].map((area) => area.getBBox());
const arena = document.querySelector('#picture .arena')?.getBBox();
const crossing = shown.filter((path) => {
  const length = path.getTotalLength();
  for (let along = 0; along <= length; along += 2) {
    const {x, y} = path.getPointAtLength(along);
    const isIn = (area, margin) => area.x + margin < x && x < area.x + area.width - margin
      && area.y + margin < y && y < area.y + area.height - margin;
    if (areas.some((area) => isIn(area, 0.5)) || (arena && !isIn(arena, -0.5))) return true;
  }
  return false;
});
return {shown: shown.length, crossing: crossing.map((path) => path.getAttribute('d')), obstacles: areas.length};
"""
SMALL = """
return [...document.querySelectorAll('#player button, #player select')].filter((element) => {
  const box = element.getBoundingClientRect();
  return Math.min(box.width, box.height) < 40;
}).map((element) => element.id)
"""


def check(condition, message):
    if not condition:
        raise AssertionError(message)


def pixels_of(png):
    """Width, height and rows of RGB triples of a PNG of 8 bits a channel without interlacing (ISO/IEC 15948)."""
    position, data = 8, b""
    while position < len(png):
        length, kind = struct.unpack(">I4s", png[position:position + 8])
        body = png[position + 8:position + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
            check(depth == 8 and colour in (2, 6) and not interlace, "a screenshot of an unknown sort")
            channels = 3 if colour == 2 else 4
        elif kind == b"IDAT":
            data += body
        position += 12 + length
    raw, stride, rows, above = zlib.decompress(data), width * channels, [], bytearray(width * channels)
    for row in range(height):
        start = row * (stride + 1)
        line, filtering = bytearray(raw[start + 1:start + 1 + stride]), raw[start]
        for index in range(stride):
            left = line[index - channels] if index >= channels else 0
            up, corner = above[index], above[index - channels] if index >= channels else 0
            if filtering == 1:
                predicted = left
            elif filtering == 2:
                predicted = up
            elif filtering == 3:
                predicted = (left + up) // 2
            elif filtering == 4:
                distances = [(abs(left + up - corner - value), order) for order, value in
                             enumerate((left, up, corner))]
                predicted = (left, up, corner)[min(distances)[1]]
            else:
                predicted = 0
            line[index] = (line[index] + predicted) & 0xFF
        rows.append([tuple(line[index:index + 3]) for index in range(0, stride, channels)])
        above = line
    return width, height, rows


def rgb(colour):
    return tuple(int(colour[start:start + 2], 16) for start in (1, 3, 5))


def is_of_colour(seen, wanted):
    """Whether a pixel has a colour, or the colour under a black pattern that covers less than a third of it."""
    share = sum(seen) / sum(wanted)
    return 0.65 <= share <= 1.02 and all(abs(a - share * b) <= 5 for a, b in zip(seen, wanted))


class Page:
    def __init__(self, browser, case):
        self.browser, self.case = browser, case
        browser.logged(), browser.requested()
        browser.open(Path(case["directory"]) / "report.html")

    def length(self):
        return float(self.browser.run("return document.getElementById('scrub').max"))

    def time(self):
        return float(self.browser.run("return document.getElementById('player').dataset.time"))

    def plays(self):
        return self.browser.run("return document.getElementById('player').classList.contains('playing')")

    def focus(self, identifier):
        self.browser.run("document.getElementById(arguments[0]).focus()", identifier)

    def begin(self):
        return float(self.browser.run("return document.getElementById('scrub').min"))

    def scrub_to(self, share):
        self.browser.run("""
            const scrub = document.getElementById('scrub');
            scrub.value = Number(scrub.min) + arguments[0] * (scrub.max - scrub.min);
            scrub.dispatchEvent(new Event('input', {bubbles: true}));
        """, share)
        return self.browser.run(PICTURE)

    def is_loaded(self):
        said = self.browser.logged()
        check(not said, f"the console says: {said}")
        others = [url for url in self.browser.requested()
                  if url.startswith(("http", "ws", "ftp")) or (url.startswith("file:") and "report.html" not in url)]
        check(not others, f"the page asked for {others}")
        check(self.browser.run("return document.querySelector('h1').textContent") == self.case["title"],
              "the heading is not the name of the formation")
        check(self.browser.run("return window.hostile") is None, "text of the scenario was run as a script")
        nameless = self.browser.run(NAMELESS)
        check(not nameless, f"controls without a name: {nameless}")

    def begins_at_the_first_motion(self):
        opened = self.browser.run(PICTURE)
        check(not self.plays(), "the film plays at once")
        phases = [phase for _, phase, *_ in json.loads(opened)[0]]
        check("MOVING" in phases, f"at first nothing moves: {sorted(set(phases))}")
        self.browser.run("""
            const scrub = document.getElementById('scrub');
            scrub.value = Number(scrub.value) + 0.5;
            scrub.dispatchEvent(new Event('input', {bubbles: true}));
        """)
        poses = [[pose for _, _, *pose in json.loads(picture)[0]] for picture in (opened, self.browser.run(PICTURE))]
        check(poses[0] != poses[1], "half a second later, all modules are where they were")
        begin = self.begin()
        self.browser.click("#turns")
        check(self.time() == 0 and self.begin() == 0, "the turns are not shown on demand")
        held = [state for state in self.browser.run(STATES) if state != "free"]
        check(not held, f"before the turns, spots are {held}")
        self.browser.click("#turns")
        check(self.time() == begin == self.begin(), "the film does not return to the first motion")
        self.browser.run("document.querySelector('#steps button').click()")
        check(self.time() < begin, "a step before the first motion is not shown")
        self.browser.click("#turns")

    def draws_paths_round_walls(self):
        paths = self.browser.run(PATHS)
        check(paths["shown"] > 0, "no path is drawn")
        check(not paths["crossing"], f"paths through walls: {paths['crossing']}")
        check(paths["obstacles"] > 0 or not self.case.get("walls"), "no obstacle is drawn")

    def shows_everything_on_the_first_screen(self):
        for width, height in SCREENS:
            self.browser.view(width, height)
            for prepare in ("", SEEK_LONGEST_STEP):
                self.browser.run(prepare)
                faults = self.browser.run(FIRST_SCREEN)
                check(not faults, f"at {width} x {height}: {'; '.join(faults)}")
        self.browser.view(*DESKTOP)

    def plays_to_the_end(self):
        self.browser.run("document.getElementById('speed').value = '16'")
        self.scrub_to(0)
        self.browser.click("#play")
        # A short film may have ended by the time of the question.
        check(self.plays() or self.time() > self.begin(), "a click on play does not play")
        deadline = time.monotonic() + PATIENCE_S
        while self.plays():
            check(time.monotonic() < deadline, f"the film stands at {self.time()} of {self.length()} s")
            time.sleep(0.05)
        check(abs(self.time() - self.length()) < 0.01, "the film stops before its end")

    def ends_with_every_spot_filled(self):
        """Checks the states in the page, where the squares are, and which colour the screen has there."""
        states = self.browser.run(STATES)
        check(len(states) == self.case["spots"], f"{len(states)} spots are drawn")
        check(states.count("filled") == self.case["filled"], f"in the end the spots are {states}")
        self.browser.run("scrollTo(0, 0)")
        filled = self.browser.run(FILLED)
        check(len({one["module"] for one in filled}) == self.case["filled"], "a module stands on two spots")
        picture = self.browser.run("""
            const box = document.getElementById('picture').getBoundingClientRect();
            return [box.left, box.top, box.width, box.height];
        """)
        left, top = picture[:2]
        width, height, rows = pixels_of(self.browser.screenshot(*picture, SHRUNK))
        for one in filled:
            check(one["apart"] < 1.0, f"module {one['module']} is {one['apart']} pixels off spot {one['spot']}")
            points = [(int((x - left) * SHRUNK), int((y - top) * SHRUNK)) for x, y in one["points"]]
            check(all(0 <= x < width and 0 <= y < height for x, y in points), f"spot {one['spot']} is out of sight")
            colours = [rows[y][x] for x, y in points]
            wanted = rgb(one["fill"])
            alike = sum(is_of_colour(colour, wanted) for colour in colours)
            check(alike >= 2, f"on the screen, spot {one['spot']} is {colours} instead of {wanted}")

    def scrubs_back_and_forth(self):
        shares = [0, 0.2, 0.45, 0.7, 0.9, 1]
        forth = [self.scrub_to(share) for share in shares]
        back = [self.scrub_to(share) for share in reversed(shares)]
        check(forth == back[::-1], "the picture depends on the way to it")
        check(len(set(forth)) == len(shares), "scrubbing changes nothing")
        check(json.loads(forth[0])[1].count("filled") == 0, "a spot is filled at the start")

    def shows_what_is_chosen_and_zooms(self):
        self.scrub_to(0.5)
        shown = """
            const visible = (selector) => [...document.querySelectorAll(selector)].filter((one) =>
              one.getAttribute('display') !== 'none' && (one.getAttribute('d') ?? one.getAttribute('transform'))).length;
            return [visible('#paths path'), visible('#trails path'), document.querySelectorAll('#cells rect').length];
        """
        check(self.browser.run(shown)[1:] == [0, 0], "trails and cells are shown unasked")
        for layer in ("paths", "trails", "cells"):
            self.browser.click(f"#show-{layer}")
        paths, trails, cells = self.browser.run(shown)
        modules = self.case["modules"]
        check(paths == 0, "paths are shown although they were put out")
        check(trails == modules, f"{trails} trails of {modules} modules")
        check(modules <= cells <= 4 * modules, f"{modules} modules are on {cells} cells")
        for layer in ("paths", "trails", "cells"):
            self.browser.click(f"#show-{layer}")
        view = "return document.getElementById('picture').getAttribute('viewBox').split(' ').map(Number)"
        whole = self.browser.run(view)
        self.browser.click("#zoom-in")
        self.browser.click("#zoom-in")
        near = self.browser.run(view)
        check(near[2] * near[3] < 0.6 * whole[2] * whole[3], f"zoomed, the picture shows {near} of {whole}")
        left, top, width, height = self.browser.run("""
            const box = document.getElementById('picture').getBoundingClientRect();
            return [box.left, box.top, box.width, box.height];
        """)
        middle = (left + width / 2, top + height / 2)
        self.browser.drag(middle, (middle[0] - 40, middle[1] - 30))
        moved = self.browser.run(view)
        check(moved[0] > near[0] or moved[1] > near[1], f"dragged, the picture still shows {moved}")
        self.browser.click("#fit")
        check(self.browser.run(view) == whole, "the whole is not shown again")

    def is_used_by_keyboard(self):
        # Slow enough to be asked whether it plays.
        self.browser.run("document.getElementById('speed').value = '0.25'")
        self.browser.run("document.querySelector('a, button, input, select, summary, [tabindex]').focus()")
        order = [self.browser.run(FOCUSED)]
        for _ in range(11):
            self.browser.press("Tab")
            order.append(self.browser.run(FOCUSED))
        # A page with notes has a link to them, and a caption that scrolls takes the focus too.
        order = [place for place in order if place not in ("to-notes", "FIGCAPTION")][:9]
        check(order == ["skip", "scrub", "start", "back", "play", "forward", "finish", "turns", "speed"],
              f"Tab goes along {order}")
        self.focus("scrub")
        self.browser.press("Home")
        check(self.time() == self.begin(), "Home does not go to the start")
        self.browser.press("Right")
        first = self.time()
        self.browser.press("Right")
        second = self.time()
        check(self.begin() < first < second, f"the steps go to {first} and {second}")
        self.browser.press("Left")
        check(self.time() == first, "a step back is not the way of the step on")
        self.browser.press("Space")
        check(self.plays(), "Space does not play")
        check(self.browser.run("return document.getElementById('play').getAttribute('aria-label')") == "Pause",
              "the button still says that it plays")
        deadline = time.monotonic() + PATIENCE_S
        while self.time() <= first:
            check(time.monotonic() < deadline, "the film does not move")
        self.browser.press("Space")
        check(not self.plays(), "Space does not pause")
        self.focus("play")
        self.browser.press("Space")
        check(self.plays(), "Space does not press the button under the focus")
        self.browser.press("End")
        check(abs(self.time() - self.length()) < 0.01, "End does not go to the end")
        self.browser.run("document.querySelector('.pick').focus()")
        self.browser.press("Enter")
        check(self.browser.run("return document.querySelectorAll('.ring.picked').length") == 1,
              "a module is not pointed out")
        self.browser.press("Enter")

    def keeps_its_controls_in_place(self):
        tops = self.browser.run("""
            const scrub = document.getElementById('scrub');
            return [...document.querySelectorAll('#steps button')].slice(0, 200).map((step) => {
              step.click();
              return scrub.getBoundingClientRect().top + scrollY;
            });
        """)
        check(tops and max(tops) - min(tops) < 0.5, f"the controls move with the steps: {sorted(set(tops))}")

    def fits_a_phone(self):
        self.keeps_its_controls_in_place()
        self.browser.view(*PHONE)
        self.keeps_its_controls_in_place()
        self.scrub_to(0.5)
        self.browser.run("for (const box of document.querySelectorAll('details')) box.open = true")
        wide = self.browser.run("return document.documentElement.scrollWidth")
        check(wide <= PHONE[0], f"the page is {wide} pixels wide on a screen of {PHONE[0]}")
        overflowing = self.browser.run(OVERFLOWING)
        check(not overflowing, f"these leave the screen: {overflowing}")
        small = self.browser.run(SMALL)
        check(not small, f"too small for a finger: {small}")
        self.browser.view(*DESKTOP)

    def has_a_dark_face(self):
        paper = "return getComputedStyle(document.body).backgroundColor"
        light = self.browser.run(paper)
        self.browser.view(*DESKTOP, dark=True)
        dark = self.browser.run(paper)
        self.browser.view(*DESKTOP)
        brightness = [sum(map(int, colour[4:-1].split(","))) for colour in (light, dark)]
        check(brightness[0] > 700 and brightness[1] < 100, f"light is {light} and dark is {dark}")


def pictures_are_sound(browser, case):
    for name in ("before.svg", "after.svg"):
        path = Path(case["directory"]) / name
        root = xml.parse(path).getroot()
        modules = [element for element in root.iter() if "data-module" in element.attrib]
        check(len(modules) == case["modules"], f"{name} shows {len(modules)} modules")
        browser.logged()
        browser.open(path)
        check(browser.run("return document.documentElement.localName") == "svg", f"{name} is not shown")
        said = browser.logged()
        check(not said, f"{name}: the console says: {said}")
        outside = browser.run("""
            const paper = document.querySelector('.paper').getBoundingClientRect();
            return [...document.querySelectorAll('text, line, rect, path')].filter((element) => {
              const box = element.getBoundingClientRect();
              return !element.closest('defs') && (box.right > paper.right + 1 || box.left < paper.left - 1
                || box.bottom > paper.bottom + 1 || box.top < paper.top - 1);
            }).map((element) => element.outerHTML)
        """)
        check(not outside, f"{name}: outside of the picture: {outside}")
        overlapping = browser.run("""
            const boxes = [...document.querySelectorAll('.legend text, .grid text, .title, .subtitle')]
              .map((text) => [text.textContent, text.getBoundingClientRect()]);
            return boxes.flatMap(([one, a], index) => boxes.slice(index + 1)
              .filter(([, b]) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom)
              .map(([other]) => `${one} / ${other}`));
        """)
        check(not overlapping, f"{name}: texts lie upon each other: {overlapping}")


def main():
    cases = json.load(sys.stdin)
    with Browser(*DESKTOP) as browser:
        for case in cases:
            began = time.monotonic()
            try:
                page = Page(browser, case)
                page.is_loaded()
                page.begins_at_the_first_motion()
                page.draws_paths_round_walls()
                page.shows_everything_on_the_first_screen()
                if case.get("first_screen_only"):
                    print(f"{case['title']}: {time.monotonic() - began:.1f} s")
                    continue
                page.scrubs_back_and_forth()
                if case["played"]:
                    page.plays_to_the_end()
                else:
                    page.scrub_to(1)
                page.ends_with_every_spot_filled()
                page.shows_what_is_chosen_and_zooms()
                page.is_used_by_keyboard()
                page.fits_a_phone()
                page.has_a_dark_face()
                check(not browser.logged(), "the console says something in the end")
                pictures_are_sound(browser, case)
            except AssertionError as error:
                sys.exit(f"{case['directory']}: {error}")
            print(f"{case['title']}: {time.monotonic() - began:.1f} s")


if __name__ == "__main__":
    try:
        main()
    except Missing as missing:
        sys.exit(str(missing))
