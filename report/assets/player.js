"use strict";
// Plays the film in the page. Everything shown is a function of one number, the time in the film, so that playing,
// stepping and scrubbing show the same.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const byId = (id) => document.getElementById(id);
  const film = JSON.parse(byId("film").textContent);
  const player = byId("player");
  const scrub = byId("scrub");
  const speed = byId("speed");

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

  // Position of the last entry whose time is not after the given one; -1 before all.
  const lastAt = (list, time, timeOf) => {
    let low = 0;
    let high = list.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (timeOf(list[middle]) <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  };
  const first = (entry) => entry[0];
  const at = (entry) => entry.at;
  const valueAt = (list, time, otherwise) => {
    const index = lastAt(list, time, first);
    return index < 0 ? otherwise : list[index][1];
  };

  const between = (from, to, share) => from + (to - from) * share;
  // In the direction of the smaller angle.
  const angleBetween = (from, to, share) => from + ((((to - from) % 360) + 540) % 360 - 180) * share;

  const poseAt = (track, time) => {
    const index = Math.max(lastAt(track, time, first), 0);
    const [t0, x0, y0, turn0] = track[index];
    const next = track[index + 1];
    if (!next || time <= t0) return [x0, y0, turn0];
    const share = (time - t0) / (next[0] - t0);
    return [between(x0, next[1], share), between(y0, next[2], share), angleBetween(turn0, next[3], share)];
  };

  const recordedAt = (time) => {
    const index = Math.max(lastAt(film.clock, time, first), 0);
    const [t0, ms0] = film.clock[index];
    const next = film.clock[index + 1];
    return next ? between(ms0, next[1], (time - t0) / (next[0] - t0)) : ms0;
  };

  // The drawn elements, by position.
  const moduleElements = film.modules.map(({ id }) => document.querySelector(`#modules [data-module="${id}"]`));
  const bodies = moduleElements.map((element) => element.querySelector(".body"));
  const phaseCells = film.modules.map(({ id }) => document.querySelector(`[data-row="${id}"] .phase`));
  const spotElements = film.spots.map(({ id }) => document.querySelector(`.target [data-spot="${id}"]`));
  const ways = film.modules.map(() => ({ line: make("path", byId("paths")), drawn: undefined }));
  const CROWD = 40;
  byId("paths").classList.toggle("crowded", ways.length > CROWD);
  const links = film.links.map(([one, other, fate, from, until]) => ({
    one, other, from, until: until ?? Infinity, line: make("line", byId("links"), `link ${fate}`),
    cross: fate === "broken" ? make("path", byId("crosses"), "cross") : null,
  }));
  const arm = film.side * 0.15;
  for (const { cross } of links) cross?.setAttribute("d", `M-${arm} -${arm}L${arm} ${arm}M-${arm} ${arm}L${arm} -${arm}`);
  const picked = new Set();

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
  const draw = (line, x1, y1, x2, y2) => {
    line.setAttribute("x1", x1);
    line.setAttribute("y1", y1);
    line.setAttribute("x2", x2);
    line.setAttribute("y2", y2);
  };

  // The way on which the film shows a module around a time, from where it last stood until it is at its end.
  const ENDS = new Set(["SETTLED", "SPARE", "LISTENING", "GATHERED"]);
  const wayAt = ({ track, phases }, time) => {
    const isEnd = ([, phase]) => ENDS.has(phase);
    const from = phases.findLast((entry) => entry[0] <= time && isEnd(entry))?.[0] ?? 0;
    const until = phases.find((entry) => entry[0] > time && isEnd(entry))?.[0] ?? film.length;
    const passed = track.filter(([at]) => from < at && at < until).map(([, x, y]) => [x, y]);
    return { key: from, points: [poseAt(track, from).slice(0, 2), ...passed, poseAt(track, until).slice(0, 2)] };
  };

  const isLong = (points) => points.some(([x, y]) => Math.hypot(x - points[0][0], y - points[0][1]) > film.side * 0.1);

  // Draws the planned path where the modules follow the plan that the page knows, else the way that the module goes.
  const drawWay = (way, module, spot) => {
    const follows = valueAt(film.planned, time, false) && module.path;
    const recorded = follows ? null : wayAt(module, time);
    const key = follows ? "plan" : `${recorded.key} ${spot?.id}`;
    if (way.drawn === key) return;
    way.drawn = key;
    let points = follows ? module.path : recorded.points;
    const known = isLong(points);
    if (!known && spot) points = [points[0], [spot.x, spot.y]];
    const corners = points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`);
    way.line.setAttribute("class", known ? "path" : "claim");
    way.line.setAttribute("d", isLong(points) ? `M${corners.join("L")}` : "");
  };

  const stepButtons = film.steps.map((step) => {
    const item = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = step.text;
    button.addEventListener("click", () => {
      if (step.at < begin) setTurns(true);
      seek(step.at);
    });
    item.append(button);
    byId("steps").append(item);
    return button;
  });

  // The film begins at the first motion; the turns before it are shown on demand.
  let begin = film.begin;
  let time = begin;
  let playing = false;
  let shownStep = -1;

  const drawRings = (poses, step) => {
    const marks = byId("marks");
    const wanted = [];
    for (const module of step?.acting ?? []) wanted.push([module, "ring acting"]);
    for (const module of step?.evicted ?? []) wanted.push([module, "ring evicted"]);
    for (const module of picked) wanted.push([module, "ring picked"]);
    while (marks.childElementCount > wanted.length) marks.lastElementChild.remove();
    while (marks.childElementCount < wanted.length) make("circle", marks);
    wanted.forEach(([module, className], index) => {
      const ring = marks.children[index];
      setAttribute(ring, "class", className);
      ring.setAttribute("cx", poses[module][0]);
      ring.setAttribute("cy", poses[module][1]);
      ring.setAttribute("r", film.side * (className.endsWith("picked") ? 1.05 : 0.82));
    });
  };

  const render = () => {
    const poses = film.modules.map(({ track }) => poseAt(track, time));
    const phases = film.modules.map((module) => valueAt(module.phases, time, "ABSENT"));
    const spotOf = new Map();
    film.spots.forEach((spot, index) => {
      const holder = valueAt(spot.holders, time, null);
      const state = holder === null ? "free" : phases[holder] === "SETTLED" ? "filled" : "claimed";
      setAttribute(spotElements[index], "data-state", state);
      if (holder !== null) spotOf.set(holder, spot);
    });
    film.modules.forEach((module, index) => {
      const [x, y, turn] = poses[index];
      setAttribute(moduleElements[index], "transform", `translate(${x.toFixed(2)} ${y.toFixed(2)})`);
      setAttribute(bodies[index], "transform", `rotate(${turn.toFixed(1)})`);
      setAttribute(moduleElements[index], "data-phase", phases[index]);
      const spot = spotOf.get(index);
      setText(phaseCells[index], PHASES[phases[index]] + (spot === undefined ? "" : `, spot ${spot.id}`));
      const goes = phases[index] === "MOVING" || (spot !== undefined && phases[index] !== "SETTLED");
      show(ways[index].line, goes);
      if (goes) drawWay(ways[index], module, spot);
    });
    for (const link of links) {
      const visible = link.from <= time && time < link.until;
      show(link.line, visible);
      if (link.cross) show(link.cross, visible);
      if (!visible) continue;
      const [[x1, y1], [x2, y2]] = [poses[link.one], poses[link.other]];
      draw(link.line, x1, y1, x2, y2);
      link.cross?.setAttribute("transform", `translate(${(x1 + x2) / 2} ${(y1 + y2) / 2})`);
    }
    const count = film.modules.length;
    setText(byId("joined"), `${phases.filter((phase) => phase !== "ABSENT").length} of ${count}`);
    setText(byId("placed"), `${spotOf.size} of ${count}`);
    setText(byId("settled"), `${phases.filter((phase) => phase === "SETTLED").length} of ${count}`);
    setText(byId("stage"), valueAt(film.stages, time, ""));
    setText(byId("clock"), `${(recordedAt(time) / 1000).toFixed(2)} s`);
    const step = lastAt(film.steps, time, at);
    const text = film.steps[step]?.text ?? "";
    setText(byId("now"), text);
    setText(byId("step"), `${step + 1} of ${film.steps.length}`);
    if (step !== shownStep) {
      stepButtons[shownStep]?.removeAttribute("aria-current");
      stepButtons[step]?.setAttribute("aria-current", "step");
      if (byId("steps-box").open) reveal(stepButtons[step]);
      shownStep = step;
    }
    drawRings(poses, film.steps[step]);
    scrub.value = time;
    scrub.setAttribute("aria-valuetext", `step ${step + 1} of ${film.steps.length}: ${text}`);
    player.dataset.time = time;
  };

  // Scrolls only the list of steps.
  const reveal = (button) => {
    if (!button) return;
    const list = byId("steps");
    const offset = button.getBoundingClientRect().top - list.getBoundingClientRect().top;
    if (offset < 0 || offset > list.clientHeight - button.offsetHeight) {
      list.scrollTop += offset - list.clientHeight / 2;
    }
  };

  const setPlaying = (wanted) => {
    playing = wanted;
    document.body.classList.toggle("playing", playing);
    byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    // While the film runs, a screen reader could not read every step in time.
    byId("now").setAttribute("aria-live", playing ? "off" : "polite");
    if (playing) {
      if (time >= film.length) time = begin;
      previous = undefined;
      requestAnimationFrame(tick);
    }
  };

  let previous;
  const tick = (now) => {
    if (!playing) return;
    // After a pause of the browser, the film continues where it stopped.
    const passed = previous === undefined ? 0 : Math.min((now - previous) / 1000, 0.25);
    previous = now;
    time = Math.min(time + passed * Number(speed.value), film.length);
    render();
    if (time >= film.length) setPlaying(false);
    else requestAnimationFrame(tick);
  };

  const seek = (wanted) => {
    time = Math.min(Math.max(wanted, begin), film.length);
    render();
  };
  const setTurns = (wanted) => {
    begin = wanted ? 0 : film.begin;
    scrub.min = begin;
    byId("turns").setAttribute("aria-pressed", String(wanted));
  };
  const goStep = (direction) => {
    setPlaying(false);
    const times = film.steps.map(at);
    const target = direction > 0
      ? times.find((step) => step > time + 1e-6) ?? film.length
      : times.findLast((step) => step < time - 1e-6) ?? begin;
    seek(target);
  };

  byId("play").addEventListener("click", () => setPlaying(!playing));
  byId("start").addEventListener("click", () => seek(begin));
  byId("finish").addEventListener("click", () => seek(film.length));
  byId("back").addEventListener("click", () => goStep(-1));
  byId("forward").addEventListener("click", () => goStep(1));
  byId("turns").addEventListener("click", () => {
    setTurns(begin > 0);
    seek(begin);
  });
  scrub.addEventListener("input", () => {
    setPlaying(false);
    seek(Number(scrub.value));
  });
  for (const button of document.querySelectorAll(".pick")) {
    button.addEventListener("click", () => {
      const module = film.modules.findIndex(({ id }) => id === Number(button.textContent));
      const chosen = !picked.delete(module);
      if (chosen) picked.add(module);
      button.setAttribute("aria-pressed", String(chosen));
      render();
    });
  }
  byId("steps-box").addEventListener("toggle", () => reveal(stepButtons[shownStep]));

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const target = event.target;
    // A control that has the focus handles its own keys.
    const pressesButton = target.closest("button, summary, a");
    const scrolls = target.closest("select, .scroll, #steps");
    if (event.key === " " && !pressesButton && !target.closest("select")) setPlaying(!playing);
    else if (scrolls) return;
    else if (event.key === "ArrowRight") goStep(1);
    else if (event.key === "ArrowLeft") goStep(-1);
    else if (event.key === "Home") seek(begin);
    else if (event.key === "End") seek(film.length);
    else return;
    event.preventDefault();
  });

  // A small picture shows no texts that would be too small to read, and the ground takes their room.
  const picture = byId("picture");
  const [, , wide, high] = picture.getAttribute("viewBox").split(" ").map(Number);
  const floor = picture.querySelector(".floor");
  const ground = picture.querySelector(".ground").transform.baseVal[0].matrix;
  const GRID_TEXT_MIN = 7.5 / 11;
  const NUMBER_SIDE_MIN = 12;
  const fit = () => {
    const box = picture.getBoundingClientRect();
    const scale = (width, height) => Math.min(box.width / width, box.height / height);
    const bare = scale(wide, high) < GRID_TEXT_MIN;
    const size = [Number(floor.getAttribute("width")) + 4, Number(floor.getAttribute("height")) + 4];
    const view = bare ? [ground.e - 2, ground.f - 2, ...size] : [0, 0, wide, high];
    picture.setAttribute("viewBox", view.join(" "));
    picture.classList.toggle("bare", bare);
    picture.classList.toggle("unnumbered", film.side * scale(view[2], view[3]) < NUMBER_SIDE_MIN);
  };
  addEventListener("resize", fit);

  scrub.max = film.length;
  scrub.min = begin;
  for (const id of ["player", "counters", "steps-box"]) byId(id).hidden = false;
  for (const id of ["turns", "turns-hint"]) byId(id).hidden = begin === 0;
  fit();
  render();
})();
