// Asks the engine: the functions of the core, behind the server of this page or, where there is none, as WebAssembly.

/** A request that was refused: its message is for people, `place` says which modules, spots and boxes it is about. */
export class Refused extends Error {
  constructor({ text, modules = [], spots = [], obstacles = [] }) {
    super(text);
    this.place = { modules, spots, obstacles };
  }
}

/** Asks the server of this page. */
let answer = async (request) => {
  const response = await fetch("api/engine", {
    method: "POST", headers: { "Content-Type": "application/json" }, body: request,
  });
  return response.text();
};

/**
 * Finds the engine, and returns the state of the server that has it. Without a server it is the file `playground.js` next to the
 * page, which studio/playground/build.sh makes, and the state is null.
 */
export async function findEngine() {
  const response = await fetch("api/state").catch(() => null);
  if (response?.ok) return response.json();
  const worker = new Worker("engine_worker.js", { type: "module" });
  const waiting = new Map();
  const fail = ({ message }) => {
    for (const { failed } of waiting.values()) failed(new Error(message || "the engine of this page cannot be loaded"));
    waiting.clear();
  };
  worker.addEventListener("error", fail);
  worker.addEventListener("message", ({ data: [number, answered] }) => {
    waiting.get(number)?.done(answered);
    waiting.delete(number);
  });
  const awaited = (number) => new Promise((done, failed) => waiting.set(number, { done, failed }));
  let asked = 0;
  answer = (request) => {
    asked += 1;
    worker.postMessage([asked, request]);
    return awaited(asked);
  };
  // It says so when it is loaded.
  await awaited(0);
  return null;
}

/** Asks for something, and returns it; throws `Refused`. */
export async function ask(call, fields = {}) {
  const answered = JSON.parse(await answer(JSON.stringify({ call, ...fields })));
  if (answered.error) {
    throw new Refused(answered.error);
  }
  return answered.ok;
}

/** Sends an order to the server; throws `Refused`. */
export async function order(path, body = {}) {
  const response = await fetch(`api/${path}`, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
  });
  const answered = await response.json().catch(() => ({ error: { text: `the studio answers ${response.status}` } }));
  if (answered.error) {
    throw new Refused(answered.error);
  }
}
