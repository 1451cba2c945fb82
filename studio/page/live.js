// The live view of a run: how far it is, who waits for whom, the verdict, and what can be done to a module.
//
// Names and texts come from scenarios and processes, so they are only ever put in as text.

const COUNTS = [["joined", "expected"], ["planned", "to_fill"], ["settled", "to_fill"]];
const ACTIONS = ["kill", "restart", "retire"];

function element(name, text, className) {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

async function post(call, body) {
  try {
    const response = await fetch(`api/${call}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
    return await response.json();
  } catch (error) {
    return { error: { text: `the server does not answer: ${error.message}` } };
  }
}

/** The state of the server; `null` where there is none, as in a static folder. */
export async function serverState() {
  try {
    const response = await fetch("api/state");
    return response.ok ? await response.json() : null;
  } catch {
    return null;
  }
}

class Live {
  constructor(section, page) {
    this.page = page;
    this.modules = new Map();
    this.chosen = null;
    this.state = { running: false, read_only: true };
    this.build(section);
  }

  build(section) {
    section.replaceChildren();
    this.stage = section.appendChild(element("p", "", "live-stage"));
    this.stage.setAttribute("role", "status");
    this.counts = section.appendChild(element("p", "", "live-counts"));
    this.verdict = section.appendChild(element("p", "", "live-verdict"));
    const bar = section.appendChild(element("div", undefined, "live-orders"));
    this.run = this.button(bar, "Run", () => this.orderDrawn("run"));
    this.target = this.button(bar, "Next target", () => this.orderDrawn("run/target"));
    this.stop = this.button(bar, "Stop", () => this.order("run/stop", {}));
    this.resume = this.button(bar, "Resume", () => this.order("run/resume", {}));
    this.end = this.button(bar, "End", () => this.order("run/end", {}));
    this.message = section.appendChild(element("p", "", "live-message"));
    this.message.setAttribute("role", "alert");
    this.list = section.appendChild(element("ul", undefined, "live-modules"));
    this.actions = section.appendChild(element("div", undefined, "live-actions"));
    this.log = section.appendChild(element("ol", undefined, "live-log"));
  }

  button(bar, text, act) {
    const made = bar.appendChild(element("button", text));
    made.type = "button";
    made.addEventListener("click", act);
    return made;
  }

  async order(call, body) {
    this.message.textContent = "";
    const answer = await post(call, body);
    if (answer.error) this.message.textContent = answer.error.text;
  }

  async orderDrawn(call) {
    await this.order(call, { yaml: await this.page.yaml() });
  }

  /** Chooses a module, for what can be done to it; the page calls it when one is clicked. */
  choose(id) {
    this.chosen = this.modules.has(id) ? id : null;
    this.actions.replaceChildren();
    if (this.chosen === null || this.state.read_only) return;
    this.actions.append(element("span", `Module ${id}`));
    for (const action of ACTIONS) {
      this.button(this.actions, action, () => this.order(`run/${action}`, { module: id }));
    }
    this.button(this.actions, "push", () => {
      const { x, y } = this.modules.get(id);
      this.order("run/push", { module: id, x: x + 1, y });
    });
  }

  take(event) {
    switch (event.kind) {
      case "state":
        this.takeState(event);
        break;
      case "stage":
        this.state.running = event.stage !== "stopped";
        this.stage.textContent = `${event.stage}: ${event.text}`;
        this.enable();
        break;
      case "modules":
        this.takeModules(event.modules, event.progress);
        break;
      case "verdict":
        this.takeVerdict(event);
        break;
      case "log":
        this.takeLog(event.text);
        break;
    }
  }

  takeState(state) {
    this.state = state;
    this.stage.textContent = `${state.stage}: ${state.text}`;
    this.log.replaceChildren();
    for (const text of state.log) this.takeLog(text);
    this.takeVerdict(state.verdict ?? {});
    this.takeModules(state.modules, state.progress);
    if (!this.modules.has(this.chosen)) this.choose(null);
    this.enable();
  }

  takeModules(modules, progress) {
    this.modules = new Map(modules.map((module) => [module.id, module]));
    const counts = progress
      ? COUNTS.map(([name, of]) => `${name} ${progress[name]}${progress[of] == null ? "" : `/${progress[of]}`}`)
      : [];
    this.counts.textContent = counts.join(", ");
    const lines = modules.filter((module) => module.phase !== "SETTLED" || module.process === "dead");
    this.list.replaceChildren(...lines.map((module) => this.line(module)));
    this.page.draw?.(modules);
  }

  line(module) {
    const waits = module.waits_for.length ? ` for ${module.waits_for.join(", ")}` : "";
    const item = element("li");
    const text = `Module ${module.id}: ${module.phase.toLowerCase().replaceAll("_", " ")}${waits}, ${module.why}`;
    const button = this.button(item, text, () => this.choose(module.id));
    if (module.process === "dead") button.className = "dead";
    return item;
  }

  takeVerdict(verdict) {
    this.verdict.textContent = [verdict.text, ...(verdict.violations ?? [])].filter(Boolean).join("; ");
    this.verdict.dataset.outcome = verdict.outcome ?? "";
  }

  takeLog(text) {
    this.log.append(element("li", text));
    while (this.log.children.length > 50) this.log.firstChild.remove();
  }

  enable() {
    const { running, read_only: readOnly } = this.state;
    this.run.disabled = readOnly || running;
    for (const button of [this.target, this.stop, this.resume, this.end]) button.disabled = readOnly || !running;
  }
}

/**
 * Shows the run of the server in a section. `page.yaml()` gives what is drawn, or a promise of it; `page.draw(modules)` draws
 * modules where they are. Returns the view, or `null` where there is no server.
 */
export async function mountLive(section, page) {
  const state = await serverState();
  section.hidden = state === null;
  if (state === null) return null;
  const live = new Live(section, page);
  live.take(state);
  // A connection that is lost is made again, and begins with the state.
  const events = new EventSource("api/events");
  events.addEventListener("message", (message) => live.take(JSON.parse(message.data)));
  return live;
}
