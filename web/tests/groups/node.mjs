import { readFile } from "node:fs/promises";
import { resolve } from "node:path";

import { SCENES, STEPS, hashAfter } from "../native.mjs";

export const name = "node";
export const mistakes = [
  { fails: "pile has the hash of the native program", steps: STEPS - 1, only: ["pile"] },
  { fails: "course: the character climbs the stairs", forward: 0.1, only: [] },
  { fails: "vehicle: it drives forward and to the left", right: 1, only: [] },
];

/// The module of the page under Node, without a page.
export async function run({ check, steps = STEPS, only = null, forward = 1, right = -1 }) {
  const dist = resolve(import.meta.dirname, "../../dist");
  const { default: start, hash_after, Show } = await import(`${dist}/drystone_web.js`);
  await start({ module_or_path: await readFile(`${dist}/drystone_web_bg.wasm`) });
  for (const [scene, parameters] of SCENES.filter(([scene]) => only?.includes(scene) ?? true)) {
    const given = Object.entries(parameters).map(([name, value]) => `${name}=${value}`);
    const [found, wanted] = [await hash_after(scene, given, steps), await hashAfter(scene, parameters, STEPS)];
    check.holds(`${scene} has the hash of the native program`, found === wanted, `${found} after ${steps} steps, native ${wanted}`);
  }

  /// Drives a scene for some steps, and returns where the driven body is and looks.
  const drive = async (scene, steps, input) => {
    const show = Show.scene(scene, [], "{}");
    show.steer(...input);
    for (let step = 0; step < steps; step += 1) await show.step();
    const { driven } = JSON.parse(show.numbers());
    show.free();
    return driven;
  };
  const [x, y] = (await drive("course", 120, [forward, 0, false])).at;
  check.holds("course: the character climbs the stairs", x > 3.5 && y > 1.8, `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`);
  const { at, ahead } = await drive("vehicle", 120, [1, right, false]);
  check.holds("vehicle: it drives forward and to the left", at[0] > 1.5 && at[2] < -0.5 && ahead[2] < -0.3, `at ${at.map((a) => a.toFixed(2))} m`);
}
