"""What the page of `formation studio` does, one part after another. Usage: studio.py PROGRAM DOMAIN SCENARIOS PART

Prints what it saw as lines of JSON; ends with an error where something did not come.
"""

import http.client
import json
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

from studio_page import LETTER_H, Studio, draw_h


def say(**seen):
    print(json.dumps(seen), flush=True)


def start_of(studio):
    """Where the modules of the run stand."""
    return studio.browser.run("return window.formationStudio.live.standing().modules.map(({ id, x, y }) => [id, x, y])")


def is_running(studio):
    """Whether the studio has a run."""
    return json.loads(studio.browser.run('return fetch("api/state").then((answer) => answer.text())'))["running"]


def lesson(program, domain, _):
    """Draw, plan, run, kill, draw the next target, run again."""
    with Studio(program, "--domain", domain) as studio:
        began = time.monotonic()
        draw_h(studio)
        studio.await_plan("7 of 7 spots")
        drawn = (studio.browser.gestures, time.monotonic() - began)
        studio.browser.click("#play")
        studio.wait("the film", "return window.formationStudio.player.time > 0")
        for part in ("trails", "cells"):
            studio.browser.click(f"#show-{part}")
            studio.wait(part, "return window.formationStudio.stage.scene[arguments[0]].length >= 8", part)
        studio.browser.click("#finish")
        studio.browser.click("#back")
        studio.wait("the last step", "const { player } = window.formationStudio; return player.time < player.film.length")
        studio.browser.click("#show-paths")
        studio.wait("no paths", "return window.formationStudio.stage.scene.paths.length === 0")
        began = time.monotonic()
        studio.browser.click("#run")
        studio.await_stage("COMPLETE")
        say(formed=len(start_of(studio)))
        print(f"a letter of seven spots and eight modules: {drawn[0] + 1} strokes and clicks, drawn in {drawn[1]:.1f} s, "
              f"formed {time.monotonic() - began:.1f} s after Run", file=sys.stderr)
        studio.browser.drag(studio.place(3, 3))
        studio.wait("a chosen module", 'return !document.getElementById("chosen").hidden')
        studio.browser.click("#kill")
        studio.wait("its end", 'return document.getElementById("chosen-text").textContent.includes("ended")')
        studio.await_stage("moving")
        studio.await_stage("COMPLETE")
        say(replanned=len(start_of(studio)))
        settled = studio.browser.run("""
            const { live } = window.formationStudio;
            const spare = [...live.modules.values()].filter(({ id, phase }) => phase === "SETTLED" && !live.dead.has(id));
            const { id, x, y } = spare.reduce((one, other) => (one.x < other.x ? one : other));
            live.pick({ x, y });
            return [id, x, y];
        """)
        studio.wait("the chosen module", 'return !document.getElementById("push").disabled')
        studio.browser.click("#push")
        studio.wait("the push", """
            const [id, x, y] = arguments[0];
            const module = window.formationStudio.live.modules.get(id);
            return Math.hypot(module.x - x, module.y - y) > 0.5;
        """, settled)
        studio.await_stage("moving")
        studio.await_stage("COMPLETE")
        say(pushed=len(start_of(studio)))
        studio.browser.click("#clear")
        bar = [[(x, 6) for x in range(1, 6)], [(3, 5), (3, 4)]]
        for stroke in bar:
            studio.draw("spot", *stroke)
        studio.await_plan("7 of 7 spots")
        studio.browser.click("#next-target")
        studio.await_stage("moving")
        studio.await_stage("COMPLETE")
        say(next=sorted([x, y] for _, x, y in start_of(studio)))
        studio.browser.click("#stop")
        studio.wait("the stop", 'return document.getElementById("stage").textContent.includes("stopped")'
                                ' || !document.getElementById("resume").disabled')
        studio.browser.click("#resume")
        studio.wait("the end of the stop", 'return document.getElementById("resume").disabled')
        studio.browser.click("#end")
        studio.wait("the end of the run", 'return !document.getElementById("run").disabled')
        say(faults=studio.faults())


def drawn(program, domain, scenarios):
    """Every shipped scenario is loaded and planned; what is exported is what was loaded; what is wrong is marked."""
    with Studio(program, "--domain", domain) as studio:
        names = studio.browser.run('return [...document.getElementById("scenarios").options].map((one) => one.value)')
        for name in filter(None, names):
            studio.choose("scenarios", name)
            wanted = json.loads(subprocess.run([program, "check", f"{scenarios}/{name}.yaml", "--json"],
                                               capture_output=True, text=True, check=False).stdout or "{}")
            studio.wait(f"the plan of {name}", """
                const { drawing } = window.formationStudio;
                const [modules, spots] = arguments[0];
                return (modules === undefined || drawing.now.modules.length === modules && drawing.now.spots.length === spots)
                    && document.getElementById("outcome").textContent.startsWith("Planned")
            """, [wanted.get("modules"), wanted.get("spots")])
            before = studio.scenario()
            exported = studio.browser.run("""
                const request = (call) => fetch("api/engine", { method: "POST", headers: { "Content-Type": "application/json" },
                    body: JSON.stringify(call) }).then((response) => response.json());
                return request({ call: "write", text: arguments[0] }).then(({ ok }) => request({ call: "read", text: ok.text }))
                    .then(({ ok }) => JSON.stringify(ok.scenario));
            """, json.dumps(before))
            studio.browser.run("window.formationStudio.drawing.load(JSON.parse(arguments[0]))", exported)
            say(loaded=name, equal=studio.scenario() == before)
        studio.choose("scenarios", "singletons_10")
        studio.await_plan("10 of 10")
        studio.choose("policy", "auction")
        studio.browser.run("""
            window.written = null;
            URL.createObjectURL = (blob) => { blob.text().then((text) => { window.written = text; }); return "#"; };
            document.getElementById("export-yaml").click();
        """)
        written = studio.wait("the exported file", "return window.written")
        say(policy='"policy":"auction"' in written)
        studio.choose("policy", "")
        studio.choose("faults", "mixed")
        studio.browser.click("#simulate")
        ending = studio.wait("the end of the simulated run", """
            const text = document.getElementById("ending").textContent;
            return text.includes("promise") && text
        """)
        say(simulated=ending, events=studio.browser.run('return document.getElementById("events").childElementCount > 20'))
        studio.browser.click("#clear")
        for stroke in LETTER_H:
            studio.draw("spot", *stroke)
        studio.draw("spot", (9, 4))
        studio.draw("module", (0, 0))
        text = studio.wait("what is wrong", 'return document.querySelector("#findings .error")?.textContent')
        studio.browser.click("#run")
        refused = studio.wait("the refusal of a run", 'return document.getElementById("message").textContent')
        say(wrong=text, refused=refused)
        studio.browser.press("Tab")
        studio.browser.run('document.getElementById("ground").focus()')
        before = len(studio.scenario()["target"]["spots"])
        studio.browser.press("1", "\ue014", "Enter", "\ue014", "Enter")
        say(by_keyboard=len(studio.scenario()["target"]["spots"]) - before)
        studio.browser.click("#undo")
        say(after_undo=len(studio.scenario()["target"]["spots"]) - before, faults=studio.faults())


def pasted(program, domain, _):
    """Names with markup stay text, a million modules are refused, and nothing starts."""
    with Studio(program, "--domain", domain) as studio:
        markup = "<img src=x onerror=\"document.body.dataset.broken='yes'\">"
        text = f"name: {json.dumps(markup)}\ntarget: {{spots: [{{id: 1, x: 0, y: 0}}]}}\nsingletons: [{{id: 1, x: 3, y: 3}}]\n"
        paste = """
            document.getElementById("paste").click();
            document.getElementById("paste-text").value = arguments[0];
            document.getElementById("paste-ok").click();
        """
        studio.browser.run(paste, text)
        studio.await_plan("1 of 1")
        say(broken=studio.browser.run("return document.body.dataset.broken || document.querySelector('main img') !== null"),
            name=studio.scenario()["name"] == markup)
        refused = studio.browser.run("""
            const many = Array.from({ length: 1000000 }, (_, id) => `{id: ${id}, x: ${id}, y: 0}`);
            return fetch("api/run", { method: "POST", headers: { "Content-Type": "application/json" },
                body: JSON.stringify({ yaml: `target: {spots: [{id: 1, x: 0, y: 0}]}\\nsingletons: [${many}]` }) })
                .then((response) => response.text());
        """)
        say(million=refused, running=is_running(studio))


def strangers(program, domain, scenarios):
    """Another host, another origin and another token are refused, and so are forms."""
    with Studio(program, "--domain", domain) as studio:
        place = urlsplit(studio.address)
        body = json.dumps({"yaml": Path(scenarios, "singletons_10.yaml").read_text()})
        kind = {"Content-Type": "application/json"}

        def status(path, method="POST", **headers):
            connection = http.client.HTTPConnection(place.hostname, place.port, timeout=20)
            connection.putrequest(method, path, skip_host="Host" in headers)
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            for name, value in {**kind, **named, "Content-Length": str(len(body))}.items():
                connection.putheader(name, value)
            connection.endheaders(body.encode())
            return connection.getresponse().status

        run = f"{place.path}api/run"
        say(host=status(run, Host="evil.example"), origin=status(run, Origin="http://evil.example"),
            null=status(run, Origin="null"), site=status(run, Sec_Fetch_Site="cross-site"),
            token=status("/00000000000000000000000000000000/api/run"), none=status("/api/run"),
            form=status(run, Content_Type="text/plain"), method=status(run, method="PUT"),
            events=status(f"{place.path}api/events", method="GET", Origin="http://evil.example"),
            file=status(f"{place.path}../../../etc/passwd", method="GET"),
            running=is_running(studio))


def attached(program, domain, scenarios):
    """A run that was started by hand, seen and not touched."""
    run = subprocess.Popen([program, "run", f"{scenarios}/singletons_10.yaml", "--domain", domain, "--attended"],
                           stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        # It is there once modules have joined.
        for line in run.stdout:
            if "progress" in line and json.loads(line).get("progress", {}).get("joined"):
                break
        with Studio(program, "--attach", "--domain", domain) as studio:
            studio.await_stage("COMPLETE")
            say(seen=len(start_of(studio)), hidden=studio.browser.run('return document.getElementById("run").hidden'))
            answer = studio.browser.run("""
                return fetch("api/run/stop", { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" })
                    .then((response) => response.text());
            """)
            say(order=answer, faults=studio.faults())
    finally:
        run.stdin.close()
        run.stdout.close()
        run.wait(30)


if __name__ == "__main__":
    program, domain, scenarios, part = sys.argv[1:]
    {"lesson": lesson, "drawn": drawn, "pasted": pasted, "strangers": strangers, "attached": attached}[part](
        program, domain, scenarios)
