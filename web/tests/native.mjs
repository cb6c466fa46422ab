// The native program, whose numbers those of the page have to equal.
import { execFile } from "node:child_process";
import { resolve } from "node:path";
import { promisify } from "node:util";

const run = promisify(execFile);
const root = resolve(import.meta.dirname, "../..");

/// Runs `drystone` with arguments and reads the JSON object that it prints. `web/test` names the program.
export async function drystone(...parameters) {
  const program = process.env.DRYSTONE ?? resolve(root, "target/debug/drystone");
  const { stdout } = await run(program, [...parameters, "--json"], { maxBuffer: 1 << 28 });
  return JSON.parse(stdout);
}

/// Scenes of every kind: boxes, rounds, meshes, joints, motors, sensors, bodies that come and go.
export const SCENES = [
  ["pile", { n: 200 }],
  ["pile-mixed", { n: 60 }],
  ["wall", { rows: 8, columns: 8 }],
  ["drop", {}],
  ["coins", { n: 20 }],
  ["chain", {}],
  ["car", {}],
  ["ragdoll", {}],
  ["arch", {}],
  ["galton", {}],
];
export const STEPS = 120;

/// The hash of all poses and velocities after some steps of a scene on the CPU.
export async function hashAfter(scene, parameters, steps) {
  const given = Object.entries(parameters).flatMap(([name, value]) => ["-p", `${name}=${value}`]);
  return (await drystone("run", scene, ...given, "--steps", steps, "--backend", "cpu")).hash;
}
