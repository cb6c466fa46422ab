import { meddle, state, until } from "../browser.mjs";

export const name = "webgpu";

/// A script that makes bodies fall as much faster as `times` says.
const falling = (times) => `
  const right = GPUDevice.prototype.createShaderModule;
  GPUDevice.prototype.createShaderModule = function (given) {
    const code = given.code.replaceAll("masses[i].acceleration * pass_row", "masses[i].acceleration * ${times} * pass_row");
    return right.call(this, { ...given, code });
  };`;
export const mistakes = [
  { fails: "pile, plain: WebGPU computes what the CPU does", script: falling("1.1"), scenes: ["pile"], modes: [false], names: [] },
  // The number of single precision after 1.
  { fails: "pile, exact: WebGPU has the bits of the CPU", script: falling("1.0000001"), scenes: ["pile"], modes: [true], names: [] },
  {
    fails: "exact: all shaders are guarded",
    script: meddle(`
      const right = drystone.backend;
      drystone.backend = (name) => right(name, false)`),
    scenes: ["pile"],
    modes: [true],
    names: [],
  },
  { fails: "conform fails no check", script: falling("1.1"), scenes: [], modes: [], names: ["integrate_velocities"] },
];

/// Largest difference after a step of what both backends began alike, relative to 1 plus its size: PLAIN_STEP of drystone-conform.
const LIMIT = 1e-5;
const SCENES = { wall: { rows: 4, columns: 4 }, pile: { n: 30 }, drop: {}, chain: {}, car: {}, ragdoll: {} };
const STEPS = 40;
/// Parts of names of checks. A scene would take software more than two minutes in both modes, to compile shaders.
const NAMES = ["integrate_velocities", "solve_contacts", "large", "refused"];

/// Steps a scene on the CPU and on WebGPU beside it, and compares the numbers.
async function beside(page, check, scene, isExact) {
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
  const [what, holds] = isExact
    ? [`${scene}, exact: WebGPU has the bits of the CPU`, first === null]
    : [`${scene}, plain: WebGPU computes what the CPU does`, apart <= LIMIT * (1 + size)];
  check.holds(what, ran && holds, message || `${steps} steps, ${told}`);
}

export async function run({ open, check, scenes = Object.keys(SCENES), modes = [true, false], names = NAMES, isShort }) {
  const page = await open({ hash: "#scene=stack" });
  // Notes of each shader that computes whether it is guarded.
  await page.evaluate(() => {
    const right = GPUDevice.prototype.createShaderModule;
    GPUDevice.prototype.createShaderModule = function (given) {
      if (given.code.includes("@compute")) window.guarded.push(given.code.includes("fn guarded_1("));
      return right.call(this, given);
    };
  });
  for (const isExact of modes) {
    await page.evaluate(() => (window.guarded = []));
    await page.evaluate((isExact) => window.drystone.backend("both", isExact), isExact);
    for (const scene of scenes) await beside(page, check, scene, isExact);
    const guarded = await page.evaluate(() => window.guarded);
    const [what, holds] = isExact ? ["exact: all shaders are guarded", guarded.every(Boolean)] : ["plain: no shader is guarded", !guarded.some(Boolean)];
    check.holds(what, guarded.length > 0 && holds, `${guarded.length} shaders`);
  }
  if (!isShort) await alone(open, check);
  if (names.length === 0) return;
  const tried = await open({ hash: "#scene=stack" });
  await tried.evaluate(() => window.drystone.pause(true));
  const lines = await tried.evaluate((names) => window.drystone.conform(names), names);
  check.equal("conform fails no check", lines.slice(0, -1).filter((line) => !line.startsWith("passed")), []);
  if (isShort) return;
  const count = (mode, group) => lines.filter((line) => line.startsWith(`passed: ${mode}, ${group}, `)).length;
  for (const mode of ["exact", "plain"]) {
    const counts = ["kernels", "limits"].map((group) => count(mode, group));
    check.equal(`conform checks kernels and limits in ${mode} mode`, counts, [2, 3]);
  }
  check.holds("conform counts its checks", / 10 passed, 0 failed$/.test(lines.at(-1)), lines.at(-1));
}

/// A link runs a scene on WebGPU alone, and the control chooses exact mode.
async function alone(open, check) {
  const page = await open({ hash: "#scene=pile&p.n=30&backend=webgpu&exact=false" });
  const runs = async (isExact) => {
    const isSo = ({ steps, backend, adapter }) => steps > 10 && backend === "gpu" && adapter.endsWith(", exact") === isExact;
    return (await until(page, isSo, 60_000)) && (await page.isChecked("#exact")) === isExact;
  };
  check.holds("a link runs a scene on plain WebGPU alone", await runs(false), (await state(page)).adapter);
  await page.check("#exact");
  check.holds("the control chooses exact WebGPU", await runs(true), (await state(page)).adapter);
  check.equal("the link tells of it", new URL(page.url()).hash, "#scene=pile&p.n=30&backend=webgpu");
}
