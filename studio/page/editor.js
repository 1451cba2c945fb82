// Mouse, touch and keyboard on the ground: each tool applies to cells.

const TOOLS = ["spot", "module", "group", "wall", "dock", "move", "erase"];

/** Binds the tools to a stage and a drawing. `locked` says when nothing may be drawn, `fixed` when modules stay as they are. */
export class Editor {
  constructor(stage, drawing, { locked, fixed, onPick }) {
    Object.assign(this, { stage, drawing, locked, fixed, onPick, tool: "spot", stroke: null, cursor: null });
    const canvas = stage.canvas;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.moveTo(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => this.up());
    canvas.addEventListener("keydown", (event) => this.press(event));
    this.buttons = [...document.querySelectorAll("[data-tool]")];
    for (const button of this.buttons) button.addEventListener("click", () => this.choose(button.dataset.tool));
  }

  choose(tool) {
    this.tool = tool;
    for (const button of this.buttons) button.setAttribute("aria-pressed", String(button.dataset.tool === tool));
  }

  down(event) {
    if (event.button !== 0 || event.isPrimary === false) return;
    const place = this.stage.placeOf(event);
    if (this.locked()) {
      this.onPick(place);
      return;
    }
    this.stage.canvas.setPointerCapture(event.pointerId);
    this.cursor = null;
    this.begin(place);
  }

  begin(place) {
    const { drawing, tool } = this;
    const cell = [Math.round(place.x), Math.round(place.y)];
    drawing.remember();
    this.stroke = { last: null, from: place, erases: false, members: null };
    if (tool === "spot") this.stroke.erases = Boolean(drawing.spotAt(...cell));
    if (tool === "module") this.stroke.erases = Boolean(drawing.moduleAt(...cell));
    if (tool === "wall") this.stroke.erases = drawing.wallAt(...cell) >= 0;
    if (tool === "group") {
      const start = drawing.moduleAt(...cell);
      const group = start && drawing.groups().find((members) => members.some((module) => module.id === start.id));
      this.stroke.members = new Set(group ? group.map((module) => module.id) : []);
    }
    if (tool === "dock") this.dock(place);
    if (tool === "move") this.grab(place);
    this.apply(place);
  }

  moveTo(event) {
    if (!this.stroke) return;
    for (const part of event.getCoalescedEvents?.() ?? [event]) this.apply(this.stage.placeOf(part));
  }

  up() {
    this.stroke = null;
  }

  /** Applies the tool to the cell of a place, once for each cell of a stroke. */
  apply(place) {
    const { drawing, stroke, tool } = this;
    const [x, y] = [Math.round(place.x), Math.round(place.y)];
    if (tool === "move") return this.drag(place);
    if (stroke.last === `${x} ${y}`) return;
    stroke.last = `${x} ${y}`;
    const [spot, module, wall] = [drawing.spotAt(x, y), drawing.moduleAt(x, y), drawing.wallAt(x, y)];
    const fixed = this.fixed();
    if (fixed && (tool === "module" || tool === "group")) return;
    if (tool === "erase") {
      if (module && !fixed) drawing.removeModule(module);
      else if (wall >= 0) drawing.removeWall(wall);
      else if (spot) drawing.removeSpot(spot);
    } else if (tool === "spot") {
      if (stroke.erases && spot) drawing.removeSpot(spot);
      if (!stroke.erases && !spot) drawing.addSpot(x, y);
    } else if (tool === "module") {
      if (stroke.erases && module) drawing.removeModule(module);
      if (!stroke.erases && !module) drawing.addModule(x, y);
    } else if (tool === "group" && !module) {
      stroke.members.add(drawing.addModule(x, y, stroke.members));
    } else if (tool === "wall") {
      if (stroke.erases && wall >= 0) drawing.removeWall(wall);
      if (!stroke.erases && wall < 0) drawing.addWall(x, y);
    }
    drawing.changed();
  }

  /** Docks or undocks the two that are nearest to a place: modules if both are, else spots. */
  dock(place) {
    const { drawing } = this;
    const nearest = (items) => {
      const sorted = items.map((item) => [Math.hypot(item.x - place.x, item.y - place.y), item]);
      sorted.sort(([one], [other]) => one - other);
      return sorted.length > 1 && sorted[1][0] < 1.2 ? [sorted[0][1], sorted[1][1]] : null;
    };
    const modules = nearest(drawing.now.modules);
    const spots = nearest(drawing.now.spots);
    if (modules && !this.fixed()) drawing.toggleLink(drawing.now.links, ...modules);
    else if (spots) drawing.toggleLink(drawing.now.edges, ...spots);
  }

  grab(place) {
    const { drawing, stroke } = this;
    const module = !this.fixed() && drawing.moduleAt(place.x, place.y);
    const spot = drawing.spotAt(place.x, place.y);
    const wall = drawing.wallAt(place.x, place.y);
    if (module) {
      stroke.modules = drawing.groups().find((members) => members.includes(module));
    } else if (spot) {
      stroke.spots = [spot];
    } else if (wall >= 0) {
      stroke.wall = drawing.now.obstacles[wall];
    }
  }

  drag(place) {
    const { drawing, stroke } = this;
    const [dx, dy] = [Math.round(place.x - stroke.from.x), Math.round(place.y - stroke.from.y)];
    if (dx === 0 && dy === 0) return;
    stroke.from = { x: stroke.from.x + dx, y: stroke.from.y + dy };
    for (const moved of [...(stroke.modules ?? []), ...(stroke.wall ? [stroke.wall] : [])]) {
      moved.x += dx;
      moved.y += dy;
    }
    if (stroke.spots) drawing.moveSpots(stroke.spots, dx, dy);
    drawing.changed();
  }

  press(event) {
    const digit = Number(event.key);
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (digit >= 1 && digit <= TOOLS.length && !event.ctrlKey) {
      this.choose(TOOLS[digit - 1]);
    } else if (steps[event.key]) {
      const [dx, dy] = steps[event.key];
      const at = this.cursor ?? this.stage.centre();
      this.cursor = { x: Math.round(at.x) + dx, y: Math.round(at.y) + dy };
      this.stage.reveal(this.cursor);
      if (event.shiftKey && this.stroke) this.apply(this.cursor);
    } else if (event.key === "Enter" || event.key === " ") {
      if (!this.cursor) return;
      if (this.locked()) {
        this.onPick(this.cursor);
      } else {
        this.begin(this.cursor);
        this.up();
      }
    } else if (event.key === "Delete" && this.cursor && !this.locked()) {
      const tool = this.tool;
      this.tool = "erase";
      this.begin(this.cursor);
      this.up();
      this.tool = tool;
    } else {
      return;
    }
    event.preventDefault();
    this.drawing.changed();
  }
}
