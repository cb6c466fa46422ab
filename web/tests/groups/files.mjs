import { execFile } from "node:child_process";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";

import { state, until } from "../browser.mjs";
import { drystone } from "../native.mjs";

export const name = "files";
export const mistakes = [
  { fails: "a scene file that is dropped runs", script: `addEventListener("drop", (event) => event.stopImmediatePropagation(), true)` },
];

/// Drops a file onto the page as a hand does, but for the pointer.
async function drop(page, name, content) {
  const transfer = await page.evaluateHandle(
    ({ name, text }) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
      return transfer;
    },
    { name, text: Buffer.from(content).toString("base64") },
  );
  for (const event of ["dragenter", "dragover", "drop"]) await page.dispatchEvent("#stage", event, { dataTransfer: transfer });
}

async function download(page, button) {
  const [file] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
  return readFile(await file.path());
}

const isLine = (text) => text.length > 0 && !text.includes("\n");

export async function run({ open, check, isShort = false }) {
  const folder = await mkdtemp(join(tmpdir(), "drystone-web-"));
  try {
    const page = await open({ hash: "#scene=stack", acceptDownloads: true });
    const [scene, recording] = ["a.json", "a.drystone"].map((name) => join(folder, name));
    const pile = ["run", "pile", "-p", "n=12", "--steps", 30, "--backend", "cpu"];
    await drystone(...pile, "--out-scene", scene, "--record", recording);

    await drop(page, "native.json", await readFile(scene));
    const runs = await until(page, (now) => now.scene === "native.json" && now.steps > 2, isShort ? 3000 : 30_000);
    check.holds("a scene file that is dropped runs", runs, `${(await state(page)).message}`);
    if (isShort) return;
    await drop(page, "native.drystone", await readFile(recording));
    const ends = await until(page, (now) => now.scene === "native.drystone" && now.steps === 30);
    check.holds("a recording that is dropped runs to its end", ends, `${(await state(page)).steps} steps`);

    for (const [what, name, content] of [
      ["no JSON", "bad.json", "{"],
      ["a scene file with a mistake", "bad.json", '{"version": 1, "bodies": [{"kind": "loose"}]}'],
      ["half a recording", "half.drystone", (await readFile(recording)).subarray(0, 200)],
      ["a picture", "bad.png", "\x89PNG\r\n\x1a\n"],
      ["an empty file", "empty.json", ""],
    ]) {
      const before = await state(page);
      await drop(page, name, content);
      const refused = await until(page, ({ message }) => message.includes(name), 10_000);
      const { message, scene } = await state(page);
      check.holds(`${what} is refused in one line`, refused && isLine(message) && scene === before.scene, message);
    }

    await page.evaluate(() => window.drystone.open("chain", { links: 6 }));
    await until(page, ({ steps }) => steps > 20);
    await page.evaluate(() => window.drystone.pause(true));
    const saved = await state(page);
    const [ofScene, ofRun] = [await download(page, "#save-scene"), await download(page, "#save-recording")];
    const [sceneFile, runFile] = ["saved.json", "saved.drystone"].map((name) => join(folder, name));
    await Promise.all([writeFile(sceneFile, ofScene), writeFile(runFile, ofRun)]);
    await drop(page, "saved.json", ofScene);
    check.holds("a scene that was saved loads again", await until(page, (now) => now.scene === "saved.json" && now.bodies === saved.bodies));
    await drop(page, "saved.drystone", ofRun);
    const again = await until(page, (now) => now.scene === "saved.drystone" && now.steps === saved.steps);
    check.holds("a recording that was saved runs again", again, `${(await state(page)).steps} of ${saved.steps} steps`);
    const { bodies } = await drystone("run", sceneFile, "--steps", 5, "--backend", "cpu");
    check.equal("the native program runs the scene that was saved", bodies, saved.bodies);
    const program = process.env.DRYSTONE;
    const { stdout } = await promisify(execFile)(program, ["replay", runFile, "--backend", "cpu"]).catch((error) => error);
    check.holds("the native program replays the recording to the same bits", /no difference/.test(stdout), stdout.trim().split("\n").at(-1));
  } finally {
    await rm(folder, { recursive: true });
  }
}
