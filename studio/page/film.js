// A film that the engine made: where all modules are at a time, and the player that runs it.

/** The last element of a list, by time, that is not later. */
function lastBefore(list, time) {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (list[middle][0] <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

export class Film {
  constructor(data) {
    const { left_units: left, top_units: top, pixels_per_unit: scale } = data.ground;
    const place = (x, y) => ({ x: left + x / scale, y: top - y / scale });
    this.length = data.length;
    this.begin = data.begin;
    this.clock = data.clock;
    this.steps = data.steps;
    this.links = data.links;
    this.planned = data.planned;
    this.modules = data.modules.map(({ id, track, phases }) => ({
      id, phases,
      track: track.map(([at, x, y, turn]) => [at, { ...place(x, y), theta: (-turn * Math.PI) / 180 }]),
    }));
    const paths = data.modules.map(({ path = [] }) => path.map(([x, y]) => place(x, y)));
    this.paths = paths.filter((path) => path.length > 1);
  }

  /** The modules at a time, with their phases and links, and the sentence of the last step. */
  at(time) {
    const modules = this.modules.map(({ id, track, phases }) => {
      const index = Math.max(0, lastBefore(track, time));
      const [from, pose] = track[index];
      const next = track[index + 1];
      const phase = phases[lastBefore(phases, time)]?.[1];
      if (!next || next[0] <= from) return { id, phase, ...pose };
      const share = Math.max(0, (time - from) / (next[0] - from));
      const between = (one, other) => one + (other - one) * share;
      return { id, phase, x: between(pose.x, next[1].x), y: between(pose.y, next[1].y), theta: between(pose.theta, next[1].theta) };
    });
    const held = this.links.filter(([, , , from, to]) => from <= time && (to == null || time < to));
    const links = held.map(([one, other]) => [this.modules[one].id, this.modules[other].id]);
    let caption = "";
    for (const { at, text } of this.steps) {
      if (at > time) break;
      caption = text;
    }
    // Paths are those of the first plan.
    const isPlanned = this.planned[lastBefore(this.planned, time)]?.[1] ?? false;
    return { modules, links, caption, paths: isPlanned ? this.paths : [] };
  }

  /** The way of each module from the first motion up to a time. */
  trails(time) {
    return this.modules.map(({ track }) => {
      const passed = track.slice(Math.max(0, lastBefore(track, this.begin)), lastBefore(track, time) + 1);
      return passed.map(([, place]) => place);
    });
  }

  /** The recorded seconds at a time of the film. */
  seconds(time) {
    const index = Math.max(0, lastBefore(this.clock, time));
    const [from, passed] = this.clock[index] ?? [0, 0];
    const next = this.clock[index + 1];
    const share = next && next[0] > from ? (time - from) / (next[0] - from) : 0;
    return (passed + (next ? (next[1] - passed) * Math.max(0, share) : 0)) / 1000;
  }
}

/** Plays films with the controls of the page; `show` is called with the time of each frame, or with null when none is shown. */
export class Player {
  constructor(show) {
    this.show = show;
    this.film = null;
    this.time = null;
    this.calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const part = (id) => document.getElementById(id);
    [this.button, this.scrub, this.clock, this.speed, this.turns] = ["play", "scrub", "clock", "speed", "turns"].map(part);
    this.button.addEventListener("click", () => this.toggle());
    this.scrub.addEventListener("input", () => this.seek(this.scrub.valueAsNumber));
    this.turns.addEventListener("change", () => {
      this.limit();
      this.time = this.first();
      this.toggle();
    });
  }

  /** Where the film begins: at the first motion, or with the turns in which spots are chosen. */
  first() {
    return this.film && !this.turns.checked ? this.film.begin : 0;
  }

  limit() {
    this.scrub.min = this.first();
    this.scrub.value = this.first();
  }

  /** Takes in another film, and shows the drawing until it is played. */
  load(film) {
    this.pause();
    this.film = film;
    this.time = null;
    this.button.disabled = this.scrub.disabled = !film;
    this.turns.disabled = !film || film.begin === 0;
    this.scrub.max = film ? film.length : 1;
    this.limit();
    this.clock.textContent = film ? `${film.seconds(film.length).toFixed(1)} s` : "";
    this.show(null);
  }

  toggle() {
    if (this.playing) {
      this.pause();
      return;
    }
    if (!this.film) return;
    if (this.time == null || this.time >= this.film.length) this.time = this.first();
    if (this.calm) {
      this.seek(this.film.length);
      return;
    }
    this.playing = performance.now();
    this.button.textContent = "❚❚";
    this.button.setAttribute("aria-label", "Pause");
    requestAnimationFrame((now) => this.frame(now));
  }

  pause() {
    this.playing = null;
    this.button.textContent = "▶";
    this.button.setAttribute("aria-label", "Play");
  }

  frame(now) {
    if (!this.playing) return;
    this.seek(Math.min(this.film.length, this.time + ((now - this.playing) / 1000) * Number(this.speed.value)));
    this.playing = now;
    if (this.time >= this.film.length) this.pause();
    else requestAnimationFrame((next) => this.frame(next));
  }

  seek(time) {
    this.time = time;
    this.scrub.value = time;
    this.clock.textContent = `${this.film.seconds(time).toFixed(1)} s`;
    this.show(time);
  }

  /** Shows the drawing again. */
  leave() {
    this.pause();
    this.time = null;
    this.scrub.value = this.first();
    this.show(null);
  }
}
