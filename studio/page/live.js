// A run of real processes, as it happens: what the server sends, and the orders that go back.

import { groupColour } from "./stage.js";
import { order } from "./engine.js";

const LOG_MAX = 200;
/** How far a module is pushed. */
const PUSH_UNITS = 1.5;
const part = (id) => document.getElementById(id);

export class Live {
  /** `text` gives the scenario file of what is drawn, `show` shows what is new, and `say` says what went wrong. */
  constructor(drawing, { text, show, say }) {
    Object.assign(this, { drawing, text, show, say, chosen: null, running: false, readOnly: true });
    this.reset();
    const orders = {
      run: () => this.start(),
      "next-target": () => this.sendDrawn("run/target"),
      stop: () => this.send("run/stop"),
      resume: () => this.send("run/resume"),
      end: () => this.send("run/end"),
      kill: () => this.send("run/kill", { module: this.chosen }),
      restart: () => this.send("run/restart", { module: this.chosen }),
      retire: () => this.send("run/retire", { module: this.chosen }),
      rejoin: () => this.send("run/rejoin", { module: this.chosen }),
      push: () => this.push(),
    };
    for (const [id, act] of Object.entries(orders)) part(id).addEventListener("click", act);
  }

  reset() {
    this.modules = new Map();
    this.dead = new Set();
    this.progress = null;
    this.verdict = null;
    this.stageText = "";
    this.groups = this.drawing.groupNumbers();
  }

  /** Begins to listen. A connection that is lost is made again, and begins with the state. */
  connect() {
    part("live").hidden = false;
    const events = new EventSource("api/events");
    events.addEventListener("message", ({ data }) => this.take(JSON.parse(data)));
  }

  /** Sends an order; `body` may be awaited. */
  async send(path, body) {
    this.say("");
    try {
      await order(path, await body);
    } catch (error) {
      this.say(error.message);
    }
  }

  /** Pushes the chosen module away from the middle of the others. */
  push() {
    const module = this.modules.get(this.chosen);
    if (!module) return;
    const all = [...this.modules.values()];
    const middle = (axis) => all.reduce((sum, one) => sum + one[axis], 0) / all.length;
    const [x, y] = [module.x - middle("x"), module.y - middle("y")];
    const length = Math.hypot(x, y);
    const way = length > 0.1 ? [x / length, y / length] : [1, 0];
    this.send("run/push", { module: module.id, x: way[0] * PUSH_UNITS, y: way[1] * PUSH_UNITS });
  }

  /** Sends an order about what is drawn. */
  sendDrawn(path) {
    return this.send(path, this.text().then((yaml) => ({ yaml })));
  }

  async start() {
    this.reset();
    part("run").disabled = true;
    await this.sendDrawn("run");
    this.refresh();
  }

  take(event) {
    const takes = {
      state: () => this.takeState(event),
      stage: () => {
        this.running = event.stage !== "stopped";
        this.stageText = event.stage;
      },
      modules: () => this.takeModules(event.modules, event.progress),
      verdict: () => this.judge(event),
      log: () => this.log(event.text),
    };
    takes[event.kind]?.();
    this.refresh();
  }

  takeState(state) {
    if (!this.running) this.groups = this.drawing.groupNumbers();
    this.readOnly = state.read_only;
    this.running = state.running;
    this.stageText = state.running ? state.stage : "";
    part("log").replaceChildren();
    for (const text of state.log) this.log(text);
    this.judge(state.verdict ?? {});
    this.takeModules(state.modules, state.progress);
  }

  takeModules(modules, progress) {
    this.modules = new Map(modules.map((module) => [module.id, module]));
    this.dead = new Set(modules.filter((module) => module.process === "dead").map(({ id }) => id));
    this.progress = progress;
  }

  judge(verdict) {
    this.verdict = verdict.outcome ? verdict : null;
    if (this.verdict) this.log(verdict.text);
  }

  log(text) {
    const line = document.createElement("li");
    line.textContent = text;
    part("log").append(line);
    while (part("log").childElementCount > LOG_MAX) part("log").firstElementChild.remove();
  }

  /** What happens, drawn and in words; at most once a frame. */
  refresh() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      this.words();
      this.show();
    });
  }

  words() {
    const { progress, verdict, running, readOnly } = this;
    part("run").hidden = part("next-target").hidden = part("end").hidden = readOnly;
    part("stop").hidden = part("resume").hidden = readOnly;
    part("run").disabled = running;
    const stopped = Boolean(progress?.stopped);
    for (const id of ["next-target", "end"]) part(id).disabled = !running;
    part("stop").disabled = !running || stopped;
    part("resume").disabled = !running || !stopped;
    const stage = part("stage");
    stage.className = "outcome";
    if (verdict) {
      stage.textContent = [verdict.text, ...verdict.violations.slice(0, 1)].join("; ");
      stage.classList.add(verdict.outcome === "COMPLETE" ? "good" : "bad");
    } else {
      stage.textContent = stopped ? `${this.stageText}, stopped` : this.stageText;
    }
    const counts = part("counts");
    counts.replaceChildren();
    for (const name of progress ? ["joined", "planned", "agreed", "settled"] : []) {
      const [term, number] = [document.createElement("dt"), document.createElement("dd")];
      term.textContent = name;
      number.textContent = `${progress[name]}`;
      const group = document.createElement("div");
      group.append(term, number);
      counts.append(group);
    }
    const waiting = progress?.waiting_for ?? [];
    part("waits").textContent = waiting.length && running ? `waiting for module${waiting.length > 1 ? "s" : ""} ${waiting.slice(0, 12).join(", ")}${waiting.length > 12 ? " …" : ""}` : "";
    this.describe();
  }

  pick(place) {
    const near = [...this.modules.values()].find(({ x, y }) => Math.hypot(x - place.x, y - place.y) < 0.6);
    this.chosen = near ? near.id : null;
    this.refresh();
  }

  describe() {
    const module = this.modules.get(this.chosen);
    part("chosen").hidden = !module;
    if (!module) return;
    const isDead = this.dead.has(module.id);
    const spot = module.spot == null ? "without a spot" : `spot ${module.spot}`;
    const waits = module.waits_for.length ? `waits for ${module.waits_for.join(", ")} ` : "";
    part("chosen-text").textContent = `Module ${module.id}: ${isDead ? "its process ended" : module.phase.toLowerCase()}, ${spot}, docked to ${module.links.length ? module.links.join(", ") : "nothing"}; ${waits}${module.why}`;
    for (const id of ["kill", "restart", "push"]) part(id).hidden = this.readOnly;
    part("retire").hidden = this.readOnly || !module.in_service;
    part("rejoin").hidden = this.readOnly || module.in_service;
    for (const id of ["retire", "rejoin", "push"]) part(id).disabled = isDead || !this.running;
    part("kill").disabled = isDead || !this.running;
    part("restart").disabled = !isDead || !this.running;
  }

  /** Whether there is something to see. */
  isSeen() {
    return this.modules.size > 0;
  }

  /** The scene of the run. */
  scene() {
    const modules = [...this.modules.values()].map((module) => ({
      ...module, colour: groupColour(this.groups.get(module.id)), settled: module.phase === "SETTLED", gone: this.dead.has(module.id),
    }));
    // Bodies of dead processes are drawn below what moves onto their places.
    modules.sort((one, other) => Number(other.gone) - Number(one.gone));
    const links = modules.flatMap(({ id, links: docked }) => docked.filter((other) => id < other && !this.dead.has(id) && !this.dead.has(other)).map((other) => [id, other]));
    const chosen = this.modules.get(this.chosen);
    const awaited = (chosen?.waits_for ?? []).map((id) => this.modules.get(id)).filter(Boolean);
    return { modules, links, waits: awaited.map((other) => [chosen, other]), marks: chosen ? [{ ...chosen, kind: "ink" }] : [] };
  }

  /** The modules where they stand now, as lists of a scenario, docked as they are. */
  standing() {
    const alive = [...this.modules.values()].filter(({ id }) => !this.dead.has(id));
    const round = (number) => Math.round(number * 1e4) / 1e4;
    return {
      modules: alive.map(({ id, x, y, theta }) => ({ id, x: round(x), y: round(y), theta: round(theta), group: null })),
      links: alive.flatMap(({ id, links }) => links.filter((other) => id < other && this.modules.has(other) && !this.dead.has(other)).map((other) => [id, other])),
    };
  }
}
