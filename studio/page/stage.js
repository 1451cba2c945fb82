// The ground: a canvas with zoom and pan that draws a scene in units.

/** Colours that differ for any colour vision (Okabe and Ito); of groups, in their order. */
const GROUPS = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#f0e442", "#56b4e9"];
const SINGLE = "#7fa8c9";
const THEMES = {
  light: { ground: "#fbfbfa", grid: "#ebedef", axis: "#d5d9de", ink: "#16191d", soft: "#5c6570", wall: "#8a929b", spot: "#5c6570", path: "#00629c", bad: "#a8321d", warn: "#b58400", good: "#006b4f" },
  dark: { ground: "#14171a", grid: "#212529", axis: "#363c43", ink: "#e8eaed", soft: "#a0a9b3", wall: "#6b747e", spot: "#a0a9b3", path: "#6cb7ec", bad: "#ff9a80", warn: "#e5c15c", good: "#5fcda4" },
};
const PIXELS_MIN = 3;
const PIXELS_MAX = 120;
const SIDE = 0.9;

export const groupColour = (index) => (index == null ? SINGLE : GROUPS[index % GROUPS.length]);

/** Whether black or white is legible on a colour. */
function inkOn(colour) {
  const [red, green, blue] = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
  return 0.299 * red + 0.587 * green + 0.114 * blue > 140 ? "#16191d" : "#ffffff";
}

export class Stage {
  constructor(canvas) {
    Object.assign(this, { canvas, scale: 40, middle: { x: 4, y: 3 }, scene: null, pinch: new Map() });
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.redraw());
    new ResizeObserver(() => this.redraw()).observe(canvas);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.touch(event));
    canvas.addEventListener("pointermove", (event) => this.pan(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => this.pinch.delete(event.pointerId));
  }

  /** Where an event is on the ground, in units. */
  placeOf(event) {
    const box = this.canvas.getBoundingClientRect();
    return {
      x: this.middle.x + (event.clientX - box.left - box.width / 2) / this.scale,
      y: this.middle.y - (event.clientY - box.top - box.height / 2) / this.scale,
    };
  }

  centre() {
    return this.middle;
  }

  wheel(event) {
    event.preventDefault();
    if (event.shiftKey) {
      this.middle.x += event.deltaY / this.scale;
      this.redraw();
    } else {
      this.zoom(Math.exp(-event.deltaY / 400), this.placeOf(event));
    }
  }

  zoom(factor, about = this.middle) {
    const before = this.scale;
    this.scale = Math.min(PIXELS_MAX, Math.max(PIXELS_MIN, this.scale * factor));
    const share = 1 - before / this.scale;
    this.middle = { x: this.middle.x + (about.x - this.middle.x) * share, y: this.middle.y + (about.y - this.middle.y) * share };
    this.redraw();
  }

  touch(event) {
    if (event.pointerType === "touch" || event.button === 1) this.pinch.set(event.pointerId, [event.clientX, event.clientY]);
  }

  /** Two fingers or the middle button pan; two fingers zoom. */
  pan(event) {
    const last = this.pinch.get(event.pointerId);
    if (!last || (event.pointerType === "touch" && this.pinch.size < 2)) return;
    const span = () => {
      const [one, other] = [...this.pinch.values()];
      return other ? Math.hypot(one[0] - other[0], one[1] - other[1]) : 1;
    };
    const before = span();
    const share = 1 / this.pinch.size;
    this.middle.x -= ((event.clientX - last[0]) / this.scale) * share;
    this.middle.y += ((event.clientY - last[1]) / this.scale) * share;
    this.pinch.set(event.pointerId, [event.clientX, event.clientY]);
    this.zoom(span() / before);
  }

  /** Brings all of these poses into view. */
  fit(poses) {
    if (poses.length === 0) return;
    const { width, height } = this.canvas.getBoundingClientRect();
    const xs = poses.map((pose) => pose.x);
    const ys = poses.map((pose) => pose.y);
    const least = (list) => list.reduce((one, other) => Math.min(one, other));
    const most = (list) => list.reduce((one, other) => Math.max(one, other));
    const [left, right, low, high] = [least(xs), most(xs), least(ys), most(ys)];
    this.middle = { x: (left + right) / 2, y: (low + high) / 2 };
    const scale = Math.min(width / (right - left + 3), height / (high - low + 3));
    this.scale = Math.min(56, Math.max(PIXELS_MIN, scale || 40));
    this.redraw();
  }

  /** Moves the view so that a place is in it. */
  reveal(place) {
    const { width, height } = this.canvas.getBoundingClientRect();
    const [halfWidth, halfHeight] = [width / 2 / this.scale - 1, height / 2 / this.scale - 1];
    this.middle.x = Math.min(place.x + halfWidth, Math.max(place.x - halfWidth, this.middle.x));
    this.middle.y = Math.min(place.y + halfHeight, Math.max(place.y - halfHeight, this.middle.y));
  }

  show(scene) {
    this.scene = scene;
    this.redraw();
  }

  redraw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = null;
      this.draw();
    });
  }

  draw() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const ratio = devicePixelRatio || 1;
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== wide || this.canvas.height !== high) Object.assign(this.canvas, { width: wide, height: high });
    const pen = this.canvas.getContext("2d");
    const theme = THEMES[this.dark.matches ? "dark" : "light"];
    const { scale } = this;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.fillStyle = theme.ground;
    pen.fillRect(0, 0, width, height);
    this.grid(pen, theme, width, height);
    if (!this.scene) return;
    this.pen = pen;
    this.theme = theme;
    const at = (pose) => [width / 2 + (pose.x - this.middle.x) * this.scale, height / 2 - (pose.y - this.middle.y) * this.scale];
    this.at = at;
    this.walls(this.scene);
    this.cells(this.scene);
    // Below the spots, so that no line crosses a number.
    for (const { way, colour } of this.scene.trails ?? []) this.way(way, colour, scale / 7);
    for (const way of this.scene.paths ?? []) this.way(way, theme.path, scale / 18);
    this.target(this.scene);
    this.modules(this.scene);
    this.marks(this.scene);
  }

  grid(pen, theme, width, height) {
    const step = this.scale < 8 ? 10 : this.scale < 16 ? 5 : 1;
    const left = this.middle.x - width / 2 / this.scale;
    const low = this.middle.y - height / 2 / this.scale;
    pen.lineWidth = 1;
    for (let x = Math.ceil((left - 0.5) / step) * step; x <= left + width / this.scale + 0.5; x += step) {
      const at = Math.round((x - 0.5 - left) * this.scale) + 0.5;
      pen.strokeStyle = x === 0 ? theme.axis : theme.grid;
      pen.beginPath();
      pen.moveTo(at, 0);
      pen.lineTo(at, height);
      pen.stroke();
    }
    for (let y = Math.ceil((low - 0.5) / step) * step; y <= low + height / this.scale + 0.5; y += step) {
      const at = Math.round(height - (y - 0.5 - low) * this.scale) + 0.5;
      pen.strokeStyle = y === 0 ? theme.axis : theme.grid;
      pen.beginPath();
      pen.moveTo(0, at);
      pen.lineTo(width, at);
      pen.stroke();
    }
  }

  walls({ obstacles = [], arena }) {
    const { pen, theme, scale } = this;
    const box = ({ x, y, width, height }) => {
      const [left, top] = this.at({ x: x - width / 2, y: y + height / 2 });
      return [left, top, width * scale, height * scale];
    };
    pen.fillStyle = theme.wall;
    for (const one of obstacles) pen.fillRect(...box(one));
    if (arena) {
      pen.strokeStyle = theme.wall;
      pen.lineWidth = 2;
      pen.strokeRect(...box(arena));
    }
  }

  lines(pairs, style, width, dash = []) {
    const { pen } = this;
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    pen.beginPath();
    for (const [one, other] of pairs) {
      pen.moveTo(...this.at(one));
      pen.lineTo(...this.at(other));
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  target({ spots = [], edges = [], states = new Map() }) {
    const { pen, theme, scale } = this;
    const byId = new Map(spots.map((spot) => [spot.id, spot]));
    const ends = edges.map(([one, other]) => [byId.get(one), byId.get(other)]).filter(([one, other]) => one && other);
    this.lines(ends, theme.spot, Math.max(1, scale / 14), [scale / 9, scale / 9]);
    for (const spot of spots) {
      const isClaimed = states.get(spot.id) === "claimed";
      this.square(spot, scale * 0.94, () => {
        pen.globalAlpha = 0.75;
        pen.fillStyle = theme.ground;
        pen.fill();
        pen.globalAlpha = 1;
        pen.setLineDash(isClaimed ? [] : [scale / 8, scale / 10]);
        pen.strokeStyle = isClaimed ? theme.path : theme.spot;
        pen.lineWidth = Math.max(1, scale / (isClaimed ? 18 : 26));
        pen.stroke();
        pen.setLineDash([]);
      });
      if (scale > 22) this.text(String(spot.id), spot, theme.soft, scale / 3.6);
    }
  }

  way(places, style, width) {
    const { pen } = this;
    pen.strokeStyle = style;
    pen.globalAlpha = 0.45;
    pen.lineWidth = Math.max(1, width);
    pen.beginPath();
    places.forEach((place, index) => (index ? pen.lineTo(...this.at(place)) : pen.moveTo(...this.at(place))));
    pen.stroke();
    pen.globalAlpha = 1;
  }

  /** The cells that bodies are on, in the colours of their modules. */
  cells({ cells = [] }) {
    const { pen, scale } = this;
    pen.globalAlpha = 0.28;
    for (const cell of cells) {
      this.square(cell, scale, () => {
        pen.fillStyle = cell.colour;
        pen.fill();
      });
    }
    pen.globalAlpha = 1;
  }

  modules({ modules = [], links = [] }) {
    const { pen, theme, scale } = this;
    const byId = new Map(modules.map((module) => [module.id, module]));
    for (const module of modules) {
      pen.globalAlpha = module.gone ? 0.3 : 1;
      this.square(module, scale * SIDE, () => {
        pen.fillStyle = module.colour;
        pen.fill();
        pen.lineWidth = Math.max(1, scale / 16);
        pen.strokeStyle = module.settled ? theme.good : "rgba(0,0,0,0.35)";
        pen.stroke();
      });
      if (scale > 14) this.heading(module);
      if (scale > 18) this.text(String(module.id), module, inkOn(module.colour), scale / 2.6, true);
      pen.globalAlpha = 1;
    }
    const ends = links.map(([one, other, fate]) => ({ one: byId.get(one), other: byId.get(other), fate })).filter(({ one, other }) => one && other);
    const middle = (list) => list.map(({ one, other }) => {
      const part = (share) => ({ x: one.x + (other.x - one.x) * share, y: one.y + (other.y - one.y) * share });
      return [part(0.38), part(0.62)];
    });
    const broken = ends.filter(({ fate }) => fate === "broken");
    this.lines(middle(ends.filter(({ fate }) => fate !== "broken")), theme.ink, Math.max(2, scale / 9));
    // A link that the plan does not keep.
    this.lines(middle(broken), theme.bad, Math.max(2, scale / 12), [scale / 14, scale / 14]);
  }

  /** A small arrow at the front. */
  heading(module) {
    const { pen, theme } = this;
    const [cosine, sine] = [Math.cos(module.theta ?? 0), Math.sin(module.theta ?? 0)];
    const corner = (along, across) => this.at({ x: module.x + along * cosine - across * sine, y: module.y + along * sine + across * cosine });
    pen.fillStyle = theme.ink;
    pen.beginPath();
    pen.moveTo(...corner(0.53, 0));
    pen.lineTo(...corner(0.4, 0.11));
    pen.lineTo(...corner(0.4, -0.11));
    pen.fill();
  }

  /** Rings about places, in the colours of their kinds. */
  rings(places, dash) {
    const { pen, theme, scale } = this;
    pen.setLineDash(dash);
    pen.lineWidth = Math.max(2, scale / 20);
    for (const { x, y, kind } of places) {
      pen.strokeStyle = theme[kind];
      pen.beginPath();
      pen.arc(...this.at({ x, y }), scale * 0.66, 0, 2 * Math.PI);
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  marks({ marks = [], waiting = [], cursor, waits = [] }) {
    const { pen, theme, scale } = this;
    this.lines(waits, theme.warn, Math.max(1, scale / 20), [3, 3]);
    this.rings(waiting, [2, 4]);
    this.rings(marks, []);
    if (cursor) {
      this.square({ ...cursor, theta: 0 }, scale, () => {
        pen.strokeStyle = theme.ink;
        pen.lineWidth = 2;
        pen.stroke();
      });
    }
  }

  square({ x, y, theta = 0 }, side, paint) {
    const { pen } = this;
    pen.save();
    pen.translate(...this.at({ x, y }));
    pen.rotate(-theta);
    pen.beginPath();
    pen.roundRect(-side / 2, -side / 2, side, side, side / 7);
    paint();
    pen.restore();
  }

  text(words, pose, colour, size, bold = false) {
    const { pen } = this;
    pen.fillStyle = colour;
    pen.font = `${bold ? "600 " : ""}${size}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillText(words, ...this.at(pose));
  }
}
