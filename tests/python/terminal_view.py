"""Watches `formation run` on a pseudo-terminal, through a terminal emulator that we did not write.

    terminal_view.py watched|plain|from_elsewhere FORMATION SCENARIO DOMAIN

`watched` is a run in colour on a terminal that is made smaller meanwhile; `plain` one without colour on a small terminal,
whose result goes to a pipe; `from_elsewhere` a run without a terminal, which `formation watch` shows on one.
"""

import fcntl
import json
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time

import pyte

PATIENCE_S = 90
# What is written within this time belongs to one frame.
QUIET_S = 0.02


def check(condition, message):
    if not condition:
        sys.exit(message)


class Terminal:
    """A program on a terminal, and what its screen showed."""

    def __init__(self, command, columns, rows, environment, stdout=None):
        self.screen = pyte.Screen(columns, rows)
        self.stream = pyte.ByteStream(self.screen)
        self.raw = b""
        self.shown = []
        self.master, slave = pty.openpty()
        self._set_size(columns, rows)
        surroundings = {key: value for key, value in os.environ.items()
                        if key not in ("NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "ROS_DOMAIN_ID", "LC_ALL", "LC_CTYPE")}

        def become_foreground():
            os.setsid()
            fcntl.ioctl(slave, termios.TIOCSCTTY, 0)

        self.child = subprocess.Popen(
            command, stdin=slave, stdout=stdout or slave, stderr=slave, preexec_fn=become_foreground,
            env={**surroundings, "TERM": "xterm-256color", "LANG": "C.UTF-8", **environment})
        os.close(slave)

    def _set_size(self, columns, rows):
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def resize(self, columns, rows):
        self.screen.resize(rows, columns)
        self._set_size(columns, rows)

    def press(self, key):
        os.write(self.master, key)

    def watch(self, each=lambda: None):
        """Takes in what is written until the program has ended; calls `each` after every frame."""
        deadline = time.monotonic() + PATIENCE_S
        fresh = False
        while True:
            if time.monotonic() > deadline:
                self.child.kill()
                sys.exit("the run does not end; the screen shows:\n" + "\n".join(self.screen.display))
            ready, _, _ = select.select([self.master], [], [], QUIET_S)
            if ready:
                try:
                    data = os.read(self.master, 65536)
                except OSError:
                    break
                if not data:
                    break
                self.raw += data
                self.stream.feed(data)
                fresh = True
            elif fresh:
                fresh = False
                self.shown.append("\n".join(line.rstrip() for line in self.screen.display))
                each()
        os.close(self.master)
        self.shown.append("\n".join(line.rstrip() for line in self.screen.display))
        return self.child.wait(10)

    def showed(self, *parts):
        """Whether some frame had all of these."""
        return any(all(re.search(part, frame) for part in parts) for frame in self.shown)

    def check_frames(self):
        for frame in self.shown:
            bars = len(re.findall(r"^  joined  ", frame, re.MULTILINE))
            check(bars <= 1, f"the view stands {bars} times on the screen:\n{frame}")

    def check_clean_end(self):
        last = self.shown[-1]
        check("  joined  " not in last and "settled " not in last.replace("have settled", ""),
              f"the view was left on the screen:\n{last}")


def watched(formation, scenario, domain):
    terminal = Terminal(
        [formation, "run", scenario, "--domain", domain, "--modules-per-process", "2"], 100, 40, {})
    sizes = iter([(60, 20), (44, 30), (100, 40)])

    keys = {r"\[acting\]": b"s", r" s(, epoch \d)?, stopped": b"r"}

    def interfere_while_acting():
        # On the way, a person pulls at the window, stops all modules, and lets them go on.
        if terminal.showed(r"\[acting\]") and len(terminal.shown) % 3 == 0:
            if size := next(sizes, None):
                terminal.resize(*size)
        for cue in [cue for cue in keys if re.search(cue, terminal.shown[-1])]:
            terminal.press(keys.pop(cue))

    status = terminal.watch(interfere_while_acting)
    last = terminal.shown[-1]
    check(status == 0, f"exit status {status}:\n{last}")
    check("COMPLETE: all 7 spots are filled, hole-free" in last, f"no verdict at the end:\n{last}")
    check(not keys, f"the view never showed {list(keys)}, so keys were not pressed")
    check(not list(sizes), "the run was over before the terminal had every size")
    for what, parts in {
        "who joins": [r"joined  \S+  \d/7"],
        "the phases": [r"gathering → planning → agreeing → \[acting\] → done"],
        "who moves, by the plan": [r"now +\S.* (is|are) on (its|their) way"],
        "the map with a module on its way": [r">\d", r"\[4\] settled"],
        "the map with settled modules": [r"\[\d\]\[\d\]"],
        "turns": [r"\d s +Turn 1: .* takes? spots? \d"],
        "motions": [r"\d s +.* sets? off"],
        "the keys": [r"s stops all modules, r resumes"],
    }.items():
        check(terminal.showed(*parts), f"never shown: {what}")
    check(b"\x1b[30;48;5;74m" in terminal.raw, "nothing is in colour")
    terminal.check_frames()
    terminal.check_clean_end()


def plain(formation, scenario, domain):
    terminal = Terminal(
        [formation, "run", scenario, "--domain", domain, "--modules-per-process", "2", "--plan-only", "--json"],
        40, 12, {"NO_COLOR": "1", "LANG": "C"}, stdout=subprocess.PIPE)
    status = terminal.watch()
    result = json.loads(terminal.child.stdout.read())
    check(status == 0 and result["verdict"] == "AGREED", f"exit status {status}: {result}")
    check(not re.search(rb"\x1b\[[0-9;]*m", terminal.raw), "there are colours in spite of NO_COLOR")
    check(all(byte < 128 for byte in terminal.raw), "the locale knows ASCII alone")
    check(terminal.showed(r"joined  [#-]+  \d/7"), "the view was never shown")
    terminal.check_frames()
    terminal.check_clean_end()


def from_elsewhere(formation, scenario, domain):
    run = subprocess.Popen(
        [formation, "run", scenario, "--domain", domain, "--modules-per-process", "2", "--speed", "1.5"],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    terminal = Terminal([formation, "watch", "--domain", domain], 100, 40, {})
    status = terminal.watch()
    run_status = run.wait(PATIENCE_S)
    last = terminal.shown[-1]
    check(status == 0 and run_status == 0, f"exit status {status}, and {run_status} of the run:\n{last}")
    check("COMPLETE: 7 of 7 spots are filled" in last, f"no verdict at the end:\n{last}")
    for what, parts in {
        "the phases": [r"planning → agreeing → \[acting\] → done"],
        "the name of the target": [r"mcs-detach"],
        "who moves, by the plan": [r"now +\S.* (is|are) on (its|their) way"],
        "the map with a module on its way": [r">\d", r"\[4\] settled"],
    }.items():
        check(terminal.showed(*parts), f"never shown: {what}:\n" + "\n".join(terminal.shown[-8:]))
    check(not terminal.showed(r"s stops all modules"), "a watch gives no orders")
    terminal.check_frames()
    terminal.check_clean_end()


if __name__ == "__main__":
    {"watched": watched, "plain": plain, "from_elsewhere": from_elsewhere}[sys.argv[1]](*sys.argv[2:])
