import { readFile } from "node:fs/promises";
import { resolve } from "node:path";

import { SCENES, STEPS, hashAfter } from "../native.mjs";

export const name = "node";
export const mistakes = [{ fails: "pile has the hash of the native program", steps: STEPS - 1, only: ["pile"] }];

/// The module of the page under Node, without a page.
export async function run({ check, steps = STEPS, only = null }) {
  const dist = resolve(import.meta.dirname, "../../dist");
  const { default: start, hash_after } = await import(`${dist}/drystone_web.js`);
  await start({ module_or_path: await readFile(`${dist}/drystone_web_bg.wasm`) });
  for (const [scene, parameters] of SCENES.filter(([scene]) => only?.includes(scene) ?? true)) {
    const given = Object.entries(parameters).map(([name, value]) => `${name}=${value}`);
    const [found, wanted] = [await hash_after(scene, given, steps), await hashAfter(scene, parameters, STEPS)];
    check.holds(`${scene} has the hash of the native program`, found === wanted, `${found} after ${steps} steps, native ${wanted}`);
  }
}
