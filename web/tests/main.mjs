// Goes through the page in a browser: node main.mjs [--self-test] [--node] [--pictures] [GROUP ...]. web/test prepares what this needs.
import { mkdir } from "node:fs/promises";
import { resolve } from "node:path";

import { Browser } from "./browser.mjs";
import { Checks } from "./checks.mjs";
import { serve } from "./serve.mjs";
import * as colors from "./groups/colors.mjs";
import * as drive from "./groups/drive.mjs";
import * as files from "./groups/files.mjs";
import * as gallery from "./groups/gallery.mjs";
import * as hashes from "./groups/hashes.mjs";
import * as hidden from "./groups/hidden.mjs";
import * as keyboard from "./groups/keyboard.mjs";
import * as links from "./groups/links.mjs";
import * as loading from "./groups/loading.mjs";
import * as lost from "./groups/lost.mjs";
import * as maze from "./groups/maze.mjs";
import * as node from "./groups/node.mjs";
import * as phone from "./groups/phone.mjs";
import * as webgpu from "./groups/webgpu.mjs";
import * as without from "./groups/without.mjs";

const GROUPS = [node, loading, hashes, webgpu, without, lost, gallery, maze, drive, files, links, phone, keyboard, colors, hidden];
const root = resolve(import.meta.dirname, "../..");

/// Runs a group, and with it a mistake on purpose if one is given. Whatever the console of a page says is a failure.
async function run(group, browser, print, mistake = {}) {
  const check = new Checks(group.name, print);
  const { script, fails, profile = {}, ...given } = mistake;
  const pages = [];
  // One page at a time: several with WebGPU by software are more than Chromium bears.
  const close = () => pages.at(-1)?.context().close();
  const open = async (options = {}) => {
    await close();
    const scripts = [options.script, script].filter(Boolean).join("\n");
    const page = await browser.open({ ...options, ...profile, script: scripts || null });
    pages.push(page);
    return page;
  };
  try {
    await group.run({ open, check, script, address: browser.address, isShort: fails !== undefined, ...given });
  } catch (error) {
    check.holds("the group runs to its end", false, error.message.split("\n")[0]);
  }
  if (pages.length > 0) check.equal("the console stays silent", [...new Set(pages.flatMap((page) => page.said))], []);
  await close();
  return check;
}

/// Each mistake on purpose has to fail the check that it names.
async function selfTest(group, browser) {
  const check = new Checks(`self-test of ${group.name}`);
  for (const mistake of group.mistakes) {
    const lines = [];
    const { failed } = await run(group, browser, (line) => lines.push(line), mistake);
    const isFound = failed.includes(mistake.fails);
    check.holds(`a mistake fails "${mistake.fails}"`, isFound, isFound ? "" : lines.filter((line) => line.startsWith("FAIL")).join("; ") || "nothing fails");
  }
  return check;
}

/// The pictures of the README.
async function pictures(browser) {
  const folder = resolve(root, "docs/gallery");
  await mkdir(folder, { recursive: true });
  const sizes = { web: { viewport: { width: 1200, height: 720 } }, "web-phone": { viewport: { width: 390, height: 780 }, isMobile: true, hasTouch: true } };
  for (const [name, size] of Object.entries(sizes)) {
    const page = await browser.open({ hash: "#scene=pile&p.n=300", colorScheme: "light", ...size });
    await page.evaluate(async () => {
      window.drystone.pause(true);
      while (window.drystone.state().steps < 100) await window.drystone.step();
    });
    await page.waitForTimeout(1500);
    await page.screenshot({ path: resolve(folder, `${name}.png`) });
    console.log(`docs/gallery/${name}.png`);
    await page.context().close();
  }
}

const given = process.argv.slice(2);
const names = given.filter((word) => !word.startsWith("--"));
const unknown = names.filter((name) => !GROUPS.some((group) => group.name === name));
if (unknown.length > 0) {
  console.error(`no group has the name ${unknown[0]}; the groups are ${GROUPS.map((group) => group.name).join(", ")}`);
  process.exit(2);
}
const chosen = given.includes("--node") ? [node] : GROUPS.filter((group) => names.length === 0 || names.includes(group.name));

const server = await serve([resolve(root, "web/dist")]);
const browser = new Browser(server.address);
let [passed, failed] = [0, 0];
const count = (check) => {
  passed += check.passed;
  failed += check.failed.length;
};
try {
  if (given.includes("--pictures")) await pictures(browser);
  else
    for (const group of chosen) {
      if (!given.includes("--self-test")) count(await run(group, browser, console.log));
      else count(await selfTest(group, browser));
    }
} finally {
  await browser.close();
  await server.close();
}
if (!given.includes("--pictures")) console.log(`${passed} passed, ${failed} failed`);
process.exitCode = failed > 0 ? 1 : 0;
