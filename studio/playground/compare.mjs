// Compares the engine as WebAssembly with the program `formation`: equal plans for the shipped scenarios and for generated ones, and equal
// events of simulated runs with faults.
// Usage: node studio/playground/compare.mjs OUT FORMATION [SEEDS]

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [out, formation, seeds = "200"] = process.argv.slice(2);
const { initSync, answer } = await import(pathToFileURL(resolve(out, "playground.js")));
initSync({ module: readFileSync(join(out, "playground_bg.wasm")) });
const ask = (request) => JSON.parse(answer(JSON.stringify(request)));

const folder = mkdtempSync(join(tmpdir(), "formation-playground-"));
/** What differs by the clock, and what the program adds for people. */
const plain = ({ planning_us, without_spread, ...plan }) => plan;

function compare(name, text) {
  const file = join(folder, "scenario.yaml");
  writeFileSync(file, text);
  const here = ask({ call: "plan", text });
  assert.equal(here.error, undefined, `${name}: ${JSON.stringify(here.error)}`);
  let printed;
  try {
    printed = execFileSync(formation, ["plan", file, "--json"], { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
  } catch (error) {
    // A plan with a hole is printed, and ends with a status.
    printed = error.stdout;
  }
  assert.deepEqual(plain(here.ok.plan), plain(JSON.parse(printed)), name);
}

try {
  const { scenarios } = ask({ call: "scenarios" }).ok;
  for (const { name, text } of scenarios) compare(name, text);
  for (let seed = 1; seed <= Number(seeds); seed += 1) {
    const size = String(5 + (seed % 36));
    const kind = [["--mixed", "--apart"], ["--apart"], ["--configuration-size", "4", "--apart"]][seed % 3];
    const text = execFileSync(formation, ["generate", "--modules", size, "--spots", size, "--seed", String(seed), ...kind], { encoding: "utf8" });
    compare(`seed ${seed}`, text);
  }
  const ten = scenarios.find(({ name }) => name === "singletons_10").text;
  const file = join(folder, "ten.yaml");
  writeFileSync(file, ten);
  for (let seed = 1; seed <= 10; seed += 1) {
    const here = ask({ call: "simulate", text: ten, seed, faults: "mixed" }).ok;
    const run = ["simulate", file, "--seeds", "1", "--first-seed", String(seed), "--faults", "mixed", "--json"];
    const there = JSON.parse(execFileSync(formation, run, { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] }));
    assert.deepEqual(here.events, there.transcript, `simulated seed ${seed}`);
  }
  assert.match(ask({ call: "plan", text: "[[[" }).error.text, /line/);
  console.log(`${scenarios.length} shipped and ${seeds} generated scenarios: equal plans; ten seeds with faults: equal events`);
} finally {
  rmSync(folder, { recursive: true });
}
