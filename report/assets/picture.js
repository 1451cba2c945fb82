// The picture of the report page: shows each time of the film in the drawing, the counters and the table.

const SVG = "http://www.w3.org/2000/svg";
const byId = (id) => document.getElementById(id);
const film = new Film(JSON.parse(byId("film").textContent));

const PHASES = {
  ABSENT: "not joined yet", LISTENING: "listening", GATHERED: "gathered", COMPUTING: "computing its plan",
  PLANNING: "planning", AGREEING: "agreeing", WAITING: "waiting", MOVING: "moving", SETTLED: "settled", SPARE: "spare", WAITING_FOR_QUORUM: "waiting for quorum",
};

const make = (name, parent, className) => {
  const element = document.createElementNS(SVG, name);
  if (className) element.setAttribute("class", className);
  parent.append(element);
  return element;
};
const show = (element, visible) => {
  if (visible) element.removeAttribute("display");
  else element.setAttribute("display", "none");
};
const setText = (element, text) => {
  if (element.textContent !== text) element.textContent = text;
};
const setAttribute = (element, name, value) => {
  if (element.getAttribute(name) !== value) element.setAttribute(name, value);
};
const setAttributes = (element, values) => {
  for (const [name, value] of Object.entries(values)) element.setAttribute(name, value);
};
const degrees = (theta) => (theta * 180) / Math.PI;
const lineThrough = (points) => `M${points.map(({ x, y }) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}`;

// The drawn elements, by position.
const moduleElements = film.modules.map(({ id }) => document.querySelector(`#modules [data-module="${id}"]`));
const bodies = moduleElements.map((element) => element.querySelector(".body"));
const colours = bodies.map((body) => body.querySelector("rect").getAttribute("fill"));
const phaseCells = film.modules.map(({ id }) => document.querySelector(`[data-row="${id}"] .phase`));
const spotElements = film.spots.map(({ id }) => document.querySelector(`.target [data-spot="${id}"]`));
const ways = film.modules.map(() => ({ line: make("path", byId("paths")), drawn: undefined }));
const trails = colours.map((stroke) => {
  const line = make("path", byId("trails"), "trail");
  setAttributes(line, { stroke, "stroke-width": film.side * 0.16 });
  return line;
});
const CROWD = 40;
for (const id of ["paths", "modules"]) byId(id).classList.toggle("crowded", ways.length > CROWD);
const arm = film.side * 0.15;
const links = film.links.map((link) => ({
  ...link, line: make("line", byId("links"), `link ${link.fate}`), cross: link.fate === "broken" ? make("path", byId("crosses"), "cross") : null,
}));
for (const { cross } of links) cross?.setAttribute("d", `M-${arm} -${arm}L${arm} ${arm}M-${arm} ${arm}L${arm} -${arm}`);
const picked = new Set();
const isChosen = (id) => byId(`show-${id}`).checked;

/** As many elements of a layer as there are values, each of which is drawn by one. */
const fill = (layer, name, values, draw) => {
  while (layer.childElementCount > values.length) layer.lastElementChild.remove();
  while (layer.childElementCount < values.length) make(name, layer);
  values.forEach((value, index) => draw(layer.children[index], value));
};

/** Draws where a module goes: a dotted line to its spot where no way is known. */
const drawWay = (drawn, index, time, spot) => {
  const way = film.way(index, time);
  const key = `${way.key} ${spot?.id}`;
  if (drawn.drawn === key) return;
  drawn.drawn = key;
  const points = !way.known && spot ? [way.points[0], spot] : way.points;
  drawn.line.setAttribute("class", way.known ? "path" : "claim");
  drawn.line.setAttribute("d", film.isLong(points) ? lineThrough(points) : "");
};

const drawLinks = (modules, time) => {
  for (const { one, other, from, until, line, cross } of links) {
    const visible = from <= time && time < until;
    show(line, visible);
    if (cross) show(cross, visible);
    if (!visible) continue;
    const [a, b] = [modules[one], modules[other]];
    setAttributes(line, { x1: a.x, y1: a.y, x2: b.x, y2: b.y });
    cross?.setAttribute("transform", `translate(${(a.x + b.x) / 2} ${(a.y + b.y) / 2})`);
  }
};

const drawRings = ({ modules, acting, evicted }) => {
  const waiting = modules.flatMap(({ waits }, index) => (waits ? [[index, "ring waiting", 0.72]] : []));
  const rings = [
    ...(isChosen("waits") ? waiting : []), ...acting.map((module) => [module, "ring acting", 0.82]),
    ...evicted.map((module) => [module, "ring evicted", 0.82]), ...[...picked].map((module) => [module, "ring picked", 1.05]),
  ];
  fill(byId("marks"), "circle", rings, (ring, [module, className, size]) => {
    setAttribute(ring, "class", className);
    setAttributes(ring, { cx: modules[module].x, cy: modules[module].y, r: film.side * size });
  });
};

const drawCells = (modules) => {
  const cells = isChosen("cells") ? modules.flatMap((module, index) => film.cells(module).map((cell) => ({ ...cell, fill: colours[index] }))) : [];
  const half = film.unit / 2;
  fill(byId("cells"), "rect", cells, (rect, { x, y, theta, fill: colour }) => {
    if (!rect.hasAttribute("x")) setAttributes(rect, { x: -half, y: -half, width: film.unit, height: film.unit });
    setAttribute(rect, "fill", colour);
    setAttribute(rect, "transform", `translate(${x} ${y}) rotate(${degrees(theta)})`);
  });
};

let shownStep = -1;
const markStep = (step) => {
  if (step === shownStep) return;
  stepButtons[shownStep]?.removeAttribute("aria-current");
  stepButtons[step]?.setAttribute("aria-current", "step");
  if (byId("steps-box").open) reveal(stepButtons[step]);
  shownStep = step;
};

const render = (time) => {
  const scene = film.at(time);
  const { modules, spots, step, caption } = scene;
  const spotOf = new Map(spots.map((spot) => [spot.id, spot]));
  spots.forEach(({ state }, index) => setAttribute(spotElements[index], "data-state", state));
  modules.forEach(({ x, y, theta, phase, spot, goes }, index) => {
    setAttribute(moduleElements[index], "transform", `translate(${x.toFixed(2)} ${y.toFixed(2)})`);
    setAttribute(bodies[index], "transform", `rotate(${degrees(theta).toFixed(1)})`);
    setAttribute(moduleElements[index], "data-phase", phase);
    setText(phaseCells[index], PHASES[phase] + (spot === null ? "" : `, spot ${spot}`));
    const hasWay = goes && isChosen("paths");
    show(ways[index].line, hasWay);
    if (hasWay) drawWay(ways[index], index, time, spotOf.get(spot));
    show(trails[index], isChosen("trails"));
    if (isChosen("trails")) setAttribute(trails[index], "d", lineThrough(film.trail(index, time)));
  });
  drawLinks(modules, time);
  drawCells(modules);
  drawRings(scene);
  const count = (is) => `${modules.filter(is).length} of ${modules.length}`;
  setText(byId("joined"), count(({ phase }) => phase !== "ABSENT"));
  setText(byId("placed"), count(({ spot }) => spot !== null));
  setText(byId("settled"), count(({ phase }) => phase === "SETTLED"));
  setText(byId("stage"), scene.stage);
  setText(byId("now"), caption);
  setText(byId("step"), `${step + 1} of ${film.steps.length}`);
  markStep(step);
  byId("scrub").setAttribute("aria-valuetext", `step ${step + 1} of ${film.steps.length}: ${caption}`);
};

/** Scrolls only the list of steps. */
const reveal = (button) => {
  if (!button) return;
  const list = byId("steps");
  const offset = button.getBoundingClientRect().top - list.getBoundingClientRect().top;
  if (offset < 0 || offset > list.clientHeight - button.offsetHeight) {
    list.scrollTop += offset - list.clientHeight / 2;
  }
};

const stepButtons = film.steps.map((step) => {
  const item = document.createElement("li");
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = step.text;
  button.addEventListener("click", () => player.open(step.at));
  item.append(button);
  byId("steps").append(item);
  return button;
});

const player = new Player((time) => {
  // While the film runs, a screen reader could not read every step in time.
  byId("now").setAttribute("aria-live", player?.playing ? "off" : "polite");
  if (time != null) render(time);
}, document);

for (const button of document.querySelectorAll(".pick")) {
  button.addEventListener("click", () => {
    const module = film.modules.findIndex(({ id }) => id === Number(button.textContent));
    const chosen = !picked.delete(module);
    if (chosen) picked.add(module);
    button.setAttribute("aria-pressed", String(chosen));
    player.seek(player.time);
  });
}
for (const box of document.querySelectorAll("#shown input")) box.addEventListener("change", () => player.seek(player.time));
byId("steps-box").addEventListener("toggle", () => reveal(stepButtons[shownStep]));

// A small picture shows no texts that would be too small to read, and the ground takes their room. It can be zoomed and moved.
const picture = byId("picture");
const [, , wide, high] = picture.getAttribute("viewBox").split(" ").map(Number);
const floor = picture.querySelector(".floor");
const ground = picture.querySelector(".ground").transform.baseVal[0].matrix;
const GRID_TEXT_MIN = 7.5 / 11;
const NUMBER_SIDE_MIN = 12;
const ZOOM_MAX = 30;
let zoom = 1;
let middle = null;
const fit = () => {
  const box = picture.getBoundingClientRect();
  if (!box.width || !box.height) return;
  const scale = (width, height) => Math.min(box.width / width, box.height / height);
  const bare = scale(wide, high) < GRID_TEXT_MIN || zoom > 1;
  const size = [Number(floor.getAttribute("width")) + 4, Number(floor.getAttribute("height")) + 4];
  const whole = bare ? [ground.e - 2, ground.f - 2, ...size] : [0, 0, wide, high];
  middle ??= [whole[0] + whole[2] / 2, whole[1] + whole[3] / 2];
  // As much as the picture has room for, and never beyond the whole.
  const shown = [box.width, box.height].map((side) => side / scale(whole[2], whole[3]) / zoom);
  const inside = (at, low, side, part) => (part >= side ? low + side / 2 : Math.min(Math.max(at, low + part / 2), low + side - part / 2));
  middle = [inside(middle[0], whole[0], whole[2], shown[0]), inside(middle[1], whole[1], whole[3], shown[1])];
  const view = zoom > 1 ? [middle[0] - shown[0] / 2, middle[1] - shown[1] / 2, ...shown] : whole;
  picture.setAttribute("viewBox", view.join(" "));
  picture.classList.toggle("bare", bare);
  picture.classList.toggle("zoomed", zoom > 1);
  picture.classList.toggle("unnumbered", film.side * scale(view[2], view[3]) < NUMBER_SIDE_MIN);
};
const placeOf = (event) => {
  const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(picture.getScreenCTM().inverse());
  return [x, y];
};
const zoomBy = (factor, about = middle) => {
  const before = zoom;
  zoom = Math.min(ZOOM_MAX, Math.max(1, zoom * factor));
  middle = middle?.map((at, index) => about[index] + ((at - about[index]) * before) / zoom);
  fit();
};
// The wheel alone scrolls the page.
picture.addEventListener("wheel", (event) => {
  if (!event.ctrlKey && zoom === 1) return;
  event.preventDefault();
  zoomBy(Math.exp(-event.deltaY / 400), placeOf(event));
}, { passive: false });
let grabbed = null;
picture.addEventListener("pointerdown", (event) => {
  if (zoom === 1 || event.button !== 0 || !event.isPrimary) return;
  grabbed = placeOf(event);
  picture.setPointerCapture(event.pointerId);
});
picture.addEventListener("pointermove", (event) => {
  if (!grabbed || !event.isPrimary) return;
  const at = placeOf(event);
  middle = middle.map((value, index) => value + grabbed[index] - at[index]);
  fit();
});
for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) picture.addEventListener(end, () => { grabbed = null; });
byId("zoom-in").addEventListener("click", () => zoomBy(1.4));
byId("zoom-out").addEventListener("click", () => zoomBy(1 / 1.4));
byId("fit").addEventListener("click", () => zoomBy(0));
addEventListener("resize", fit);

for (const id of ["player", "counters", "steps-box"]) byId(id).hidden = false;
byId("turns-hint").hidden = film.begin === 0;
fit();
player.load(film);
player.seek(film.begin);
