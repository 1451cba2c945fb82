// What is drawn: a scenario as lists of spots, modules, links and boxes, with undo.

const UNDO_MAX = 200;
const NEAR = 0.05;

const pair = (one, other) => (one < other ? [one, other] : [other, one]);
const key = ([one, other]) => `${one} ${other}`;

/** Whether two poses are neighbours whose ports meet: one unit apart along a side of either. */
export function canDock(one, other) {
  const [dx, dy] = [other.x - one.x, other.y - one.y];
  if (Math.abs(Math.hypot(dx, dy) - 1) > NEAR) return false;
  const onSide = (angle) => Math.abs(Math.sin(2 * angle)) < 2 * NEAR;
  const direction = Math.atan2(dy, dx);
  return onSide(direction - (one.theta ?? 0)) && onSide(direction - (other.theta ?? 0));
}

/** The least identifier that none of these has. */
function free(items) {
  const taken = new Set(items.map((item) => item.id));
  let id = 1;
  while (taken.has(id)) id += 1;
  return id;
}

export class Drawing {
  constructor() {
    this.past = [];
    this.future = [];
    this.listeners = [];
    this.load({ name: "drawn", target: { spots: [], edges: [] } });
    this.past = [];
  }

  /** Takes in a scenario as the engine reads it. */
  load(scenario) {
    const { target, configurations = [], singletons = [], obstacles = [], ...rest } = scenario;
    const { spots = [], edges = [], ...targetRest } = target;
    const modules = [...singletons.map((module) => ({ ...module, group: null }))];
    const links = [];
    const leaders = [];
    for (const { id, leader, modules: members, edges: docked = [] } of configurations) {
      modules.push(...members.map((module) => ({ ...module, group: id })));
      links.push(...docked.map(([one, other]) => pair(one, other)));
      if (leader != null) leaders.push(leader);
    }
    this.remember();
    this.now = { spots, edges: edges.map(([one, other]) => pair(one, other)), modules, links, leaders, obstacles, rest, targetRest };
    this.changed();
  }

  /** The scenario, as JSON. Docked modules are a configuration. */
  scenario() {
    const { spots, edges, modules, links, leaders, obstacles, rest, targetRest } = this.now;
    const groups = this.groups();
    const configurations = [];
    const singletons = [];
    const taken = new Set();
    const plain = ({ group, ...module }) => module;
    for (const members of groups) {
      const own = members.map((module) => module.group).find((id) => id != null && !taken.has(id));
      if (members.length === 1 && members[0].group == null) {
        singletons.push(plain(members[0]));
        continue;
      }
      let id = own ?? 1;
      while (taken.has(id) || (own == null && modules.some((module) => module.group === id))) id += 1;
      taken.add(id);
      const ids = new Set(members.map((module) => module.id));
      const leader = leaders.find((one) => ids.has(one));
      configurations.push({
        id, ...(leader == null ? {} : { leader }), modules: members.map(plain), edges: links.filter(([one]) => ids.has(one)),
      });
    }
    configurations.sort((one, other) => one.id - other.id);
    return { ...rest, target: { ...targetRest, spots, edges }, configurations, singletons, obstacles };
  }

  /** The modules in groups that are docked together. */
  groups() {
    const { modules, links } = this.now;
    const groupOf = new Map(modules.map((module) => [module.id, [module]]));
    for (const [one, other] of links) {
      const [first, second] = [groupOf.get(one), groupOf.get(other)];
      if (!first || !second || first === second) continue;
      first.push(...second);
      for (const module of second) groupOf.set(module.id, first);
    }
    return [...new Set(groupOf.values())];
  }

  /** The number of the group of each docked module, by which groups have colours. */
  groupNumbers() {
    const docked = this.groups().filter((members) => members.length > 1);
    return new Map(docked.flatMap((members, number) => members.map(({ id }) => [id, number])));
  }

  /** A change that can be undone. */
  change(edit) {
    this.remember();
    edit(this.now);
    this.changed();
  }

  remember() {
    if (!this.now) return;
    this.past.push(JSON.stringify(this.now));
    if (this.past.length > UNDO_MAX) this.past.shift();
    this.future = [];
  }

  undo() {
    if (this.past.length === 0) return;
    this.future.push(JSON.stringify(this.now));
    this.now = JSON.parse(this.past.pop());
    this.changed();
  }

  redo() {
    if (this.future.length === 0) return;
    this.past.push(JSON.stringify(this.now));
    this.now = JSON.parse(this.future.pop());
    this.changed();
  }

  changed() {
    for (const listener of this.listeners) listener();
  }

  spotAt(x, y) {
    return this.now.spots.find((spot) => Math.hypot(spot.x - x, spot.y - y) < 0.5);
  }

  moduleAt(x, y) {
    return this.now.modules.find((module) => Math.hypot(module.x - x, module.y - y) < 0.5);
  }

  wallAt(x, y) {
    return this.now.obstacles.findIndex((box) => Math.abs(box.x - x) < box.width / 2 && Math.abs(box.y - y) < box.height / 2);
  }

  addSpot(x, y) {
    const { spots, edges } = this.now;
    const spot = { id: free(spots), x, y, theta: 0 };
    edges.push(...spots.filter((other) => canDock(spot, other)).map((other) => pair(spot.id, other.id)));
    spots.push(spot);
  }

  /** Adds a module; docked to its neighbours of a group if there is one. */
  addModule(x, y, members = null) {
    const { modules, links } = this.now;
    const module = { id: free(modules), x, y, theta: 0, group: null };
    if (members) {
      const near = modules.filter((other) => members.has(other.id) && canDock(module, other));
      links.push(...near.map((other) => pair(module.id, other.id)));
    }
    modules.push(module);
    return module.id;
  }

  addWall(x, y) {
    this.now.obstacles.push({ x, y, width: 1, height: 1 });
  }

  removeSpot({ id }) {
    this.now.spots = this.now.spots.filter((spot) => spot.id !== id);
    this.now.edges = this.now.edges.filter((edge) => !edge.includes(id));
  }

  removeModule({ id }) {
    this.now.modules = this.now.modules.filter((module) => module.id !== id);
    this.now.links = this.now.links.filter((link) => !link.includes(id));
    this.now.leaders = this.now.leaders.filter((leader) => leader !== id);
  }

  removeWall(index) {
    this.now.obstacles.splice(index, 1);
  }

  /** Docks two neighbours, or undocks them. */
  toggleLink(list, one, other) {
    const link = pair(one.id, other.id);
    const found = list.findIndex((known) => key(known) === key(link));
    if (found >= 0) {
      list.splice(found, 1);
    } else if (canDock(one, other)) {
      list.push(link);
    }
  }

  /** Moves spots by whole units; their docks follow. */
  moveSpots(spots, dx, dy) {
    const moved = new Set(spots.map((spot) => spot.id));
    for (const spot of spots) {
      spot.x += dx;
      spot.y += dy;
    }
    const all = this.now.spots;
    const stays = ([one, other]) => moved.has(one) === moved.has(other);
    this.now.edges = this.now.edges.filter(stays);
    for (const spot of spots) {
      const near = all.filter((other) => !moved.has(other.id) && canDock(spot, other));
      this.now.edges.push(...near.map((other) => pair(spot.id, other.id)));
    }
  }
}
