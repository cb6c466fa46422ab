// Boxes at 60 steps a second in a browser, beside Rapier: node measure.mjs [--quick]. web/measure prepares what this needs. Prints the tables of
// docs/web.md.
import { cpus, loadavg } from "node:os";
import { resolve } from "node:path";

import { Browser } from "./browser.mjs";
import { serve } from "./serve.mjs";

const isQuick = process.argv.includes("--quick");
const CPU = [
  ...[2, 4, 8].map((substeps) => ({ name: `drystone, ${substeps} substeps`, engine: "drystone", backend: "cpu", substeps })),
  { name: "Rapier, 4 substeps", engine: "rapier" },
  { name: "Rapier SIMD, 4 substeps", engine: "rapier-simd" },
  { name: "Rapier SIMD, 8 substeps", engine: "rapier-simd", substeps: 8 },
  { name: "Rapier SIMD, 16 substeps", engine: "rapier-simd", substeps: 16 },
];
const WEBGPU = { name: "drystone on WebGPU, 8 substeps", engine: "drystone", backend: "webgpu", substeps: 8 };
const SIZES = isQuick ? [250, 500, 1000] : [250, 500, 1000, 2000, 4000];
/// A software adapter is slow.
const LARGEST_WEBGPU = 500;
const [STEPS, BLOCK, ROUNDS] = isQuick ? [200, 4, 1] : [300, 4, 3];
const FRAME = 1000 / 60;

const sorted = (values) => [...values].sort((a, b) => a - b);
const quantile = (values, q) => sorted(values)[Math.round(q * (values.length - 1))];
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const short = (x) => String(Number(x.toPrecision(3)));

/// Boxes for the least time of a step, between the sizes that were measured; as bounds beyond them.
function boxesAt(rows) {
  const times = rows.map(({ boxes, ms }) => [Math.log(boxes), Math.log(ms)]);
  const wanted = Math.log(FRAME);
  if (times[0][1] > wanted) return `< ${rows[0].boxes}`;
  for (let k = 1; k < times.length; k += 1) {
    const [[n0, t0], [n1, t1]] = [times[k - 1], times[k]];
    if (t1 >= wanted) return short(Math.exp(n0 + ((n1 - n0) * (wanted - t0)) / (t1 - t0)));
  }
  return `> ${rows.at(-1).boxes}`;
}

const root = resolve(import.meta.dirname, "../..");
const server = await serve(["web/dist", "web/tests", "web/node_modules"].map((folder) => resolve(root, folder)));
const browser = new Browser(server.address);
try {
  const page = await browser.open({ path: "measure.html", wait: false });
  const versions = await page.evaluate(() => window.ready);
  const { product } = await (await page.context().browser().newBrowserCDPSession()).send("Browser.getVersion");
  const found = new Map();
  for (let round = 0; round < ROUNDS; round += 1) {
    for (const boxes of SIZES) {
      const entrants = boxes <= LARGEST_WEBGPU ? [...CPU, WEBGPU] : CPU;
      const results = await page.evaluate((given) => window.race(given), { boxes, entrants, steps: STEPS, block: BLOCK });
      results.forEach(({ times, overlaps, fallen }, k) => {
        const name = entrants[k].name;
        if (fallen > 0) throw new Error(`${name}: ${fallen} of ${boxes} boxes fell through the floor`);
        const row = found.get(name)?.get(boxes) ?? { boxes, times: [], means: [], deepest: [] };
        row.times.push(...times);
        row.means.push(...overlaps.map(([mean]) => mean));
        row.deepest.push(...overlaps.map(([, deepest]) => deepest));
        found.set(name, (found.get(name) ?? new Map()).set(boxes, row));
      });
      console.error(`round ${round + 1}, ${boxes} boxes; load ${loadavg()[0].toFixed(1)} of ${cpus().length} cores`);
    }
  }
  if (page.said.length > 0) throw new Error(page.said.join("; "));
  const rows = [...found].map(([name, sizes]) => [name, [...sizes.values()].map((row) => ({ ...row, ms: Math.min(...row.times) }))]);

  console.log(`${product}, ${cpus()[0].model}, ${cpus().length} cores; Rapier ${versions.rapier}, SIMD ${versions.simd}\n`);
  console.log("| engine | boxes at 60 steps a second, by the least time |\n|---|--:|");
  for (const [name, sizes] of rows) console.log(`| ${name} | ${boxesAt(sizes)} |`);
  for (const boxes of SIZES) {
    console.log(`\n| ${boxes} boxes | least time of a step (ms) | quartiles | mean overlap (mm) | deepest (mm) |\n|---|--:|--:|--:|--:|`);
    for (const [name, sizes] of rows) {
      const row = sizes.find((size) => size.boxes === boxes);
      if (!row) continue;
      const quartiles = [0.25, 0.75].map((q) => short(quantile(row.times, q))).join(" to ");
      console.log(`| ${name} | ${short(row.ms)} | ${quartiles} | ${short(mean(row.means))} | ${short(mean(row.deepest))} |`);
    }
  }
} finally {
  await browser.close();
  await server.close();
}
