import { meddle } from "../browser.mjs";
import { SCENES, STEPS, hashAfter } from "../native.mjs";

export const name = "hashes";
export const mistakes = [
  {
    fails: "chain has the hash of the native program",
    script: meddle(`
      const right = drystone.hash_after;
      drystone.hash_after = async (...given) => (await right(...given)).replace(/.$/, (digit) => (digit === "0" ? "1" : "0"))`),
  },
  // A step that is a little too long: the hash is that of another run.
  {
    fails: "pile has the hash of the native program",
    script: meddle(`
      const right = drystone.hash_after;
      drystone.hash_after = (scene, given, steps) => right(scene, given, steps + 1)`),
  },
];

export async function run({ open, check }) {
  const page = await open();
  await page.evaluate(() => window.drystone.pause(true));
  for (const [scene, parameters] of SCENES) {
    const found = await page.evaluate((given) => window.drystone.hash_after(...given), [scene, parameters, STEPS]);
    const wanted = await hashAfter(scene, parameters, STEPS);
    check.holds(`${scene} has the hash of the native program`, found === wanted, `${found} after ${STEPS} steps, native ${wanted}`);
  }
}
