// The page: what is drawn is checked and planned as one draws, played as a film, and run by real processes.

import { ask, findEngine } from "./engine.js";
import { Drawing } from "./drawing.js";
import { Editor } from "./editor.js";
import { Film } from "./film.js";
import { Live } from "./live.js";
import { Player } from "./player.js";
import { Stage, groupColour } from "./stage.js";

const PLAN_DELAY_MS = 150;
const EVENTS_SHOWN_MAX = 3000;
const part = (id) => document.getElementById(id);

const drawing = new Drawing();
const stage = new Stage(part("ground"));
const second = new Stage(part("second"));
let films = [null, null];
let findings = [];
let asked = 0;

/** Says what went wrong, until something else is done. */
const say = (text) => { part("message").textContent = text; };
/** What is drawn, for the engine: with the policy that is chosen. */
const drawnFields = (policy = part("policy").value) => ({ text: JSON.stringify(drawing.scenario()), ...(policy ? { policy } : {}) });
/** The scenario file of what is drawn. */
const scenarioFile = async () => (await ask("write", drawnFields())).text;

const live = new Live(drawing, { text: scenarioFile, show: () => render(), say });
const player = new Player((time) => render(time), part("player"));
/** Whether a part of the film is to be shown. */
const isChosen = (id) => part(`show-${id}`).checked;
part("shown").addEventListener("change", () => player.time == null || player.seek(player.time));
/** Nothing is drawn while a film or a run is shown. */
const isLocked = () => player.time != null || isWatching();
let watching = true;
const isWatching = () => live.isSeen() && watching;
const editor = new Editor(stage, drawing, {
  locked: isLocked,
  // They are where the processes of the run have them.
  fixed: () => live.running,
  onPick: (place) => {
    if (player.time != null) player.leave();
    else live.pick(place);
  },
});

/** The scene of what is drawn. */
function drawn() {
  const { spots, edges, modules, links, obstacles, rest } = drawing.now;
  const groups = drawing.groupNumbers();
  const kinds = { error: "bad", warning: "warn" };
  const marks = findings.flatMap((finding) => [
    ...modules.filter(({ id }) => finding.modules.includes(id)), ...spots.filter(({ id }) => finding.spots.includes(id)),
    ...obstacles.filter((_, index) => finding.obstacles.includes(index)),
  ].map(({ x, y }) => ({ x, y, kind: kinds[finding.severity] })));
  const coloured = (module) => ({ ...module, colour: groupColour(groups.get(module.id)), settled: module.phase === "SETTLED" });
  return { spots, edges, obstacles, links, marks, arena: rest.arena, cursor: editor.cursor, modules: modules.map(coloured), coloured };
}

/** What a film shows at a time, upon what is drawn. */
function sceneOf(film, base, time) {
  const now = film.at(time);
  const modules = now.modules.map(base.coloured);
  const ring = (list, kind) => list.map((index) => ({ x: modules[index].x, y: modules[index].y, kind }));
  const waiting = now.modules.flatMap(({ waits }, index) => (waits ? [index] : []));
  return {
    ...base, modules, caption: now.caption,
    links: now.links.map(({ one, other, fate }) => [modules[one].id, modules[other].id, fate]),
    states: new Map(now.spots.map(({ id, state }) => [id, state])),
    marks: [...ring(now.acting, "path"), ...ring(now.evicted, "bad")],
    waiting: isChosen("waits") ? ring(waiting, "soft") : [],
    paths: isChosen("paths") ? modules.flatMap(({ goes }, index) => (goes ? [film.way(index, time).points] : [])) : [],
    trails: isChosen("trails") ? modules.map(({ colour }, index) => ({ way: film.trail(index, time), colour })) : [],
    cells: isChosen("cells") ? modules.flatMap((module) => film.cells(module).map((cell) => ({ ...cell, colour: module.colour }))) : [],
  };
}

/** Shows the film at a time; without one, what is drawn or runs. */
function render(time = player.time) {
  const base = drawn();
  const [film, other] = films;
  const isPlaying = time != null && film;
  const sceneAt = (shown) => (isPlaying ? sceneOf(shown, base, Math.min(time, shown.length)) : base);
  const scene = film ? sceneAt(film) : base;
  part("caption").textContent = scene.caption ?? "";
  part("caption").setAttribute("aria-live", player.playing ? "off" : "polite");
  if (other) second.show(sceneAt(other));
  stage.show(!isPlaying && isWatching() ? { ...base, ...live.scene() } : scene);
}

function listFindings(list) {
  findings = list;
  part("findings").replaceChildren(...list.map(({ severity, text }) => {
    const item = document.createElement("li");
    item.className = severity;
    item.textContent = text;
    return item;
  }));
}

function tabulate(numbers) {
  part("numbers").replaceChildren(...numbers.map((row) => {
    const line = document.createElement("tr");
    const head = document.createElement("th");
    head.textContent = row[0];
    line.append(head, ...row.slice(1).map((value) => {
      const cell = document.createElement("td");
      cell.textContent = value;
      return cell;
    }));
    return line;
  }));
}

/** Plans what is drawn; the latest question wins. */
async function plan() {
  const number = ++asked;
  const { spots, modules } = drawing.now;
  const outcome = part("outcome");
  if (spots.length === 0 || modules.length === 0) {
    films = [null, null];
    player.load(null);
    listFindings([]);
    tabulate([]);
    outcome.className = "outcome";
    outcome.textContent = spots.length === 0 ? "Draw the spots of the target." : "Draw the modules that are to form it.";
    return;
  }
  const beside = part("beside").value;
  const answers = [ask("plan", drawnFields()), ...(beside ? [ask("plan", drawnFields(beside))] : [])];
  const [one, other] = await Promise.allSettled(answers);
  if (number !== asked) return;
  if (one.status === "rejected") {
    films = [null, null];
    player.load(null);
    outcome.className = "outcome bad";
    outcome.textContent = "There is no plan.";
    tabulate([]);
    listFindings([{ severity: "error", text: one.reason.message, ...(one.reason.place ?? { modules: [], spots: [], obstacles: [] }) }]);
  } else {
    const planned = [one, other].filter((it) => it?.status === "fulfilled").map((it) => it.value);
    films = [new Film(planned[0].film), planned[1] ? new Film(planned[1].film) : null];
    player.load(films[0], Math.max(...films.filter(Boolean).map(({ length }) => length)));
    outcome.className = "outcome";
    outcome.textContent = planned[0].outcome;
    listFindings(planned[0].findings);
    const head = beside ? [["", ...planned.map((it) => it.policy)]] : [];
    tabulate([...head, ...planned[0].numbers.map(({ name, value }, index) => [name, value, ...(planned[1] ? [planned[1].numbers[index]?.value ?? ""] : [])])]);
  }
  if (part("second").hidden === Boolean(films[1])) {
    part("second").hidden = !films[1];
    fit();
  }
  render();
}

let timer = null;
drawing.listeners.push(() => {
  part("undo").disabled = drawing.past.length === 0;
  part("redo").disabled = drawing.future.length === 0;
  say("");
  player.leave();
  clearTimeout(timer);
  timer = setTimeout(plan, PLAN_DELAY_MS);
});

function fit() {
  const { spots, modules, obstacles } = drawing.now;
  const shown = [...spots, ...modules, ...obstacles, ...(isWatching() ? live.scene().modules : [])];
  stage.fit(shown.length > 1 ? shown : [{ x: 0, y: 0 }, { x: 11, y: 8 }]);
  second.fit(shown);
}

async function read(text) {
  const { scenario } = await ask("read", { text });
  drawing.load(scenario);
  fit();
}

/** A drawn target becomes a scenario with as many single modules below it. */
function asScenario(text) {
  const isMap = text.trim() !== "" && /^[o\-| \n\r#]*$/.test(text);
  if (!isMap) return text;
  const lines = text.replace(/\s+$/, "").split("\n");
  const spots = [...text].filter((letter) => letter === "o").length;
  const width = Math.max(4, Math.ceil(Math.sqrt(spots)));
  const map = lines.map((line) => `    ${line}`).join("\n");
  const singletons = Array.from({ length: spots }, (_, index) => ({ id: index + 1, x: (index % width) * 2, y: -3 - 2 * Math.floor(index / width) }));
  return `name: drawn\ntarget:\n  map: |\n${map}\nsingletons: ${JSON.stringify(singletons)}\n`;
}

function download(name, kind, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type: kind }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Runs an action of a button, and says what went wrong. */
function onClick(id, act) {
  part(id).addEventListener("click", async () => {
    say("");
    try {
      await act();
    } catch (error) {
      say(error.message);
    }
  });
}

const name = () => (drawing.now.rest.name || "formation").replace(/[^\w-]+/g, "_").slice(0, 60);
onClick("undo", () => drawing.undo());
onClick("redo", () => drawing.redo());
onClick("clear", () => {
  if (live.running) {
    if (isWatching()) drawNext();
    drawing.change((now) => Object.assign(now, { spots: [], edges: [] }));
  } else {
    watching = false;
    drawing.load({ name: "drawn", target: { spots: [], edges: [] } });
    fit();
  }
});
onClick("fit", fit);
onClick("zoom-in", () => [stage, second].forEach((one) => one.zoom(1.25)));
onClick("zoom-out", () => [stage, second].forEach((one) => one.zoom(0.8)));
onClick("export-yaml", async () => download(`${name()}.yaml`, "text/yaml", await scenarioFile()));
onClick("export-svg", async () => {
  const { svg } = await ask("figure", drawnFields());
  download(`${name()}.svg`, "image/svg+xml", svg);
});
onClick("export-png", () => new Promise((done) => {
  stage.draw();
  part("ground").toBlob((blob) => { download(`${name()}.png`, "image/png", blob); done(); });
}));
onClick("paste", () => { part("paste-error").textContent = ""; part("paste-dialog").showModal(); });
part("paste-ok").addEventListener("click", async () => {
  try {
    await read(asScenario(part("paste-text").value));
    part("scenarios").value = "";
    part("paste-dialog").close();
  } catch (error) {
    part("paste-error").textContent = error.message;
  }
});
for (const id of ["policy", "beside"]) part(id).addEventListener("change", plan);
for (const id of ["run", "next-target"]) {
  part(id).addEventListener("click", () => {
    watching = true;
    player.leave();
  });
}
document.addEventListener("keydown", (event) => {
  if (!event.ctrlKey && !event.metaKey) return;
  if (event.target instanceof HTMLTextAreaElement) return;
  if (event.key === "z" && !event.shiftKey) drawing.undo();
  else if (event.key === "y" || event.key === "Z") drawing.redo();
  else return;
  event.preventDefault();
});
for (const button of document.querySelectorAll("[data-tool]")) {
  // Whoever takes a tool wants to draw: the film ends, and the modules of a run stay where they stand now.
  button.addEventListener("click", () => {
    player.leave();
    if (isWatching()) drawNext();
  });
}

/** Runs what is drawn under virtual time, with the faults of a seed. */
async function simulate() {
  const [faults, seed] = [part("faults").value, part("seed").valueAsNumber];
  const ending = part("ending");
  ending.className = "";
  ending.textContent = "simulating…";
  part("simulate").disabled = true;
  try {
    const run = await ask("simulate", { ...drawnFields(), seed: Number.isFinite(seed) ? seed : 1, faults });
    const broken = run.violations.length ? `; broken: ${run.violations.join("; ")}` : ", no promise broken";
    ending.textContent = `${run.ending}, ${run.recovery_s.toFixed(1)} s after the last fault, in ${run.epochs} epoch${run.epochs === 1 ? "" : "s"}${broken}`;
    ending.className = run.violations.length ? "bad" : "";
    part("events").replaceChildren(...run.events.slice(0, EVENTS_SHOWN_MAX).map((text) => {
      const line = document.createElement("li");
      line.textContent = text;
      return line;
    }));
    part("events-box").hidden = false;
    films = [new Film(run.film), null];
    player.load(films[0]);
    part("second").hidden = true;
    player.play();
  } catch (error) {
    ending.className = "bad";
    ending.textContent = error.message;
  } finally {
    part("simulate").disabled = false;
  }
}
onClick("simulate", simulate);

/** The next drawing begins with the modules of the run where they stand. */
function drawNext() {
  const { modules, links } = live.standing();
  watching = false;
  drawing.change((now) => Object.assign(now, { modules, links, leaders: [] }));
}

part("scenarios").addEventListener("change", async ({ target }) => {
  const shipped = scenarios.find((one) => one.name === target.value);
  if (shipped) {
    watching = false;
    await read(shipped.text);
  }
});

const state = await findEngine();
const scenarios = (await ask("scenarios")).scenarios;
part("scenarios").append(...scenarios.map(({ name: value }) => new Option(value, value)));
const { policies, faults } = await ask("choices");
part("faults").append(...faults.map((kind) => new Option(kind, kind)));
const choosable = policies.filter((policy) => policy.name !== "given");
part("policy").append(new Option("as in the file", ""), ...choosable.map((policy) => new Option(policy.name, policy.name)));
part("beside").append(...choosable.map((policy) => new Option(policy.name, policy.name)));
if (state) live.connect();
if (state?.yaml) await read(state.yaml);
else fit();
drawing.past = [];
drawing.changed();
// For tests and for the console of the browser.
window.formationStudio = { drawing, stage, live, player };
document.body.dataset.ready = "yes";
