// The engine in a thread of its own, where the page has no server: a long plan does not hold up the page.

import load, { answer } from "./playground.js";

self.addEventListener("message", ({ data: [number, request] }) => self.postMessage([number, answer(request)]));
await load();
self.postMessage([0, null]);
