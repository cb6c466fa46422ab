import { state, until } from "../browser.mjs";

export const name = "webgpu";
export const mistakes = [
  {
    fails: "pile: WebGPU computes what the CPU does",
    // Bodies fall a tenth faster.
    script: `
      const right = GPUDevice.prototype.createShaderModule;
      GPUDevice.prototype.createShaderModule = function (given) {
        const code = given.code.replaceAll("masses[i].acceleration * pass_row", "masses[i].acceleration * 1.1 * pass_row");
        return right.call(this, { ...given, code });
      };`,
    only: ["pile"],
  },
];

/// Largest difference after a step of what both backends began alike, relative to 1 plus its size: PLAIN_STEP of src/conform.
const LIMIT = 1e-5;
const SCENES = { wall: { rows: 4, columns: 4 }, pile: { n: 30 }, drop: {}, chain: {}, car: {}, ragdoll: {} };
const STEPS = 40;

export async function run({ open, check, only = Object.keys(SCENES) }) {
  const page = await open({ hash: "#scene=stack" });
  await page.evaluate(() => window.drystone.backend("both"));
  for (const scene of only) {
    await page.evaluate(([scene, given]) => window.drystone.open(scene, given), [scene, SCENES[scene]]);
    await page.evaluate(() => window.drystone.pause(true));
    await page.evaluate(async (steps) => {
      while (window.drystone.state().steps < steps) await window.drystone.step();
    }, STEPS);
    const { steps, message, beside, first_difference: first } = await state(page);
    const [a, b] = (first?.values ?? [0, 0]).map((value) => [value].flat().map(Number));
    const [apart, size] = first ? [Math.max(...[a].flat().map((x, k) => Math.abs(x - [b].flat()[k]))), Math.max(...[a].flat().map(Math.abs))] : [0, 0];
    const told = first ? `first difference ${apart.toExponential(1)} after step ${first.step} in ${first.quantity}` : "the same bits";
    const ran = beside?.backend === "gpu" && beside.steps === steps && message === "";
    check.holds(`${scene}: WebGPU computes what the CPU does`, ran && apart <= LIMIT * (1 + size), message || `${steps} steps, ${told}`);
  }
  if (only.length === 1) return;
  await page.evaluate(() => window.drystone.open("pile", { n: 30 }));
  await page.evaluate(() => window.drystone.backend("webgpu"));
  check.holds("a scene runs on WebGPU alone", await until(page, ({ steps }) => steps > 10));
  await page.evaluate(() => window.drystone.pause(true));
  // All checks take software a quarter of an hour, most of it to compile shaders. The last line counts the verdicts.
  const lines = await page.evaluate(() => window.drystone.conform(["integrate_velocities", "chain", "wall", "large", "refused"]));
  check.equal("conform fails no check", lines.slice(0, -1).filter((line) => !line.startsWith("passed")), []);
  check.holds("conform checks kernels, scenes and limits", / 6 passed, 0 failed$/.test(lines.at(-1)), lines.at(-1));
}
