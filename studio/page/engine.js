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

/** Finds the engine, and returns whether a server has it. Without one, it is the file `playground.js` next to the page, which studio/playground/build.sh makes. */
export async function findEngine() {
  const state = await fetch("api/state").catch(() => null);
  if (state?.ok) return true;
  const worker = new Worker("engine_worker.js", { type: "module" });
  const waiting = new Map();
  let asked = 0;
  await new Promise((ready, failed) => {
    worker.addEventListener("error", ({ message }) => failed(new Error(message || "the engine of this page cannot be loaded")));
    worker.addEventListener("message", ({ data: [number, answered] }) => {
      if (number === 0) ready();
      waiting.get(number)?.(answered);
      waiting.delete(number);
    });
  });
  answer = (request) => new Promise((done) => {
    asked += 1;
    waiting.set(asked, done);
    worker.postMessage([asked, request]);
  });
  return false;
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
