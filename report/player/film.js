// A film as data: what there is to see at each time, for whoever draws it. Times are seconds of the film. Places are pixels of the
// picture, with y downwards; where the film says how its pixels lie on the ground, they are units, with y upwards.

/** The position of the last entry of a list, by time, that is not later; -1 before all. */
function lastAt(list, time, timeOf = (entry) => entry[0]) {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (timeOf(list[middle]) <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

const valueAt = (list, time, otherwise) => list[lastAt(list, time)]?.[1] ?? otherwise;
const between = (from, to, share) => from + (to - from) * share;
/** In the direction of the smaller angle. */
const angleBetween = (from, to, share) => from + (((((to - from) % 360) + 540) % 360) - 180) * share;
const timeIn = ({ at }) => at;
/** The phases in which a module is at an end of its way. */
const ENDS = new Set(["SETTLED", "SPARE", "LISTENING", "GATHERED"]);

export class Film {
  constructor(data) {
    const { ground, unit } = data;
    this.direction = ground ? -1 : 1;
    /** The length of a unit. */
    this.unit = ground ? 1 : unit;
    const place = ground ? (x, y) => ({ x: ground.left_units + x / unit, y: ground.top_units - y / unit }) : (x, y) => ({ x, y });
    const { length, begin, side, clock, steps, stages, planned } = data;
    Object.assign(this, { length, begin, clock, steps, stages, planned });
    /** The side of a module's square. */
    this.side = ground ? side / unit : side;
    this.modules = data.modules.map(({ id, track, path = [], phases }) => ({
      id, phases, path: path.map(([x, y]) => place(x, y)), track: track.map(([at, x, y, turn]) => ({ at, turn, ...place(x, y) })),
    }));
    this.spots = data.spots.map(({ id, x, y, turn = 0, holders }) => ({ id, holders, theta: this.angle(turn), ...place(x, y) }));
    this.links = data.links.map(([one, other, fate, from, until]) => ({ one, other, fate, from, until: until ?? Infinity }));
  }

  /** A clockwise angle in degrees as radians in the direction from x to y. */
  angle(turn) {
    return (this.direction * turn * Math.PI) / 180;
  }

  pose(track, time) {
    const index = Math.max(lastAt(track, time, timeIn), 0);
    const [from, to] = [track[index], track[index + 1]];
    if (!to || time <= from.at) return { x: from.x, y: from.y, theta: this.angle(from.turn), stands: !to || (to.x === from.x && to.y === from.y) };
    const share = (time - from.at) / (to.at - from.at);
    return {
      x: between(from.x, to.x, share), y: between(from.y, to.y, share), theta: this.angle(angleBetween(from.turn, to.turn, share)),
      stands: from.x === to.x && from.y === to.y && from.turn === to.turn,
    };
  }

  /** All that is to be seen at a time. */
  at(time) {
    const modules = this.modules.map(({ id, track, phases }) => {
      const phase = valueAt(phases, time, "ABSENT");
      const pose = this.pose(track, time);
      return { id, phase, ...pose, waits: phase === "WAITING" || (phase === "MOVING" && pose.stands), spot: null };
    });
    const spots = this.spots.map(({ id, x, y, theta, holders }) => {
      const holder = valueAt(holders, time, null);
      if (holder !== null) modules[holder].spot = id;
      const state = holder === null ? "free" : modules[holder].phase === "SETTLED" ? "filled" : "claimed";
      return { id, x, y, theta, state };
    });
    for (const module of modules) module.goes = module.phase === "MOVING" || (module.spot !== null && module.phase !== "SETTLED");
    const links = this.links.filter(({ from, until }) => from <= time && time < until);
    const step = lastAt(this.steps, time, timeIn);
    const { text = "", acting = [], evicted = [] } = this.steps[step] ?? {};
    return { modules, spots, links, step, caption: text, acting, evicted, stage: valueAt(this.stages, time, "") };
  }

  /**
   * The way of a module around a time, and whether it is known: the planned path where the modules follow the plan that the film
   * knows, else the way that the module goes from where it last stood until it is at its end.
   */
  way(index, time) {
    const { path, track, phases } = this.modules[index];
    if (valueAt(this.planned, time, false) && path.length > 1) return { key: "plan", points: path, known: this.isLong(path) };
    const isEnd = ([, phase]) => ENDS.has(phase);
    const from = phases.findLast((entry) => entry[0] <= time && isEnd(entry))?.[0] ?? 0;
    const until = phases.find((entry) => entry[0] > time && isEnd(entry))?.[0] ?? this.length;
    const passed = track.filter(({ at }) => from < at && at < until);
    const points = [this.pose(track, from), ...passed, this.pose(track, until)];
    return { key: from, points, known: this.isLong(points) };
  }

  isLong(points) {
    return points.some(({ x, y }) => Math.hypot(x - points[0].x, y - points[0].y) > this.side * 0.1);
  }

  /** The way of a module from the first motion up to a time. */
  trail(index, time) {
    const { track } = this.modules[index];
    const passed = track.slice(Math.max(0, lastAt(track, this.begin, timeIn)), lastAt(track, time, timeIn) + 1);
    return [...passed, this.pose(track, time)];
  }

  /** The cells of the lattice of the target that a module is on: one where it stands on it, two or four on its way between cells. */
  cells(module) {
    const [lattice] = this.spots;
    return lattice ? cellsOf(module, lattice, this.unit) : [];
  }

  /** The recorded seconds at a time of the film. */
  seconds(time) {
    const index = Math.max(lastAt(this.clock, time), 0);
    const [from, passed] = this.clock[index] ?? [0, 0];
    const next = this.clock[index + 1];
    return (next ? between(passed, next[1], (time - from) / (next[0] - from)) : passed) / 1000;
  }

  /** When the step before or after a time begins; beyond them, the first or the last time that is shown. */
  neighbour(time, direction, [first, last]) {
    const times = this.steps.map(timeIn);
    return direction > 0 ? times.find((at) => at > time + 1e-6) ?? last : times.findLast((at) => at < time - 1e-6) ?? first;
  }

  /** When the step of a time began. */
  beginOfStep(time) {
    return this.steps[lastAt(this.steps, time, timeIn)]?.at ?? 0;
  }
}

/** The cells of a lattice through a place that a body is on. */
function cellsOf({ x, y }, { x: left, y: low, theta }, unit) {
  const [cosine, sine] = [Math.cos(theta), Math.sin(theta)];
  const along = [(x - left) * cosine + (y - low) * sine, (y - low) * cosine - (x - left) * sine];
  const near = (at) => (Math.abs(at - Math.round(at)) < 0.02 ? [Math.round(at)] : [Math.floor(at), Math.ceil(at)]);
  const [columns, rows] = along.map((length) => near(length / unit));
  return columns.flatMap((u) => rows.map((v) => ({ x: left + (u * cosine - v * sine) * unit, y: low + (u * sine + v * cosine) * unit, theta })));
}
