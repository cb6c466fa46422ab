// The page: its start, its controls, and its interface for tests.
import start, { Maze, Show, conform, hash_after } from "./drystone_web.js";
import * as device from "./device.js";
import * as link from "./link.js";
import * as maze from "./maze.js";
import * as numbers from "./numbers.js";
import * as panel from "./panel.js";
import { keys, listen } from "./pointer.js";
import {
  act, assignments, canvases, changes, chosen, drives, enqueue, file, frame, game, hasWebGPU, loop, open, openPicture, pause, paused, pointer, refuse, restart, say,
  setPace, shows, state, step, stepOnce, tilts, tried,
} from "./run.js";

const element = (id) => document.getElementById(id);

function save(name, content, type) {
  const url = URL.createObjectURL(new Blob([content], { type }));
  const anchor = Object.assign(document.createElement("a"), { href: url, download: name });
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

const stem = () => (file ? file.name.replace(/\.[^.]*$/, "") : chosen.scene);

async function openFile(given) {
  if (!given) return;
  const bytes = new Uint8Array(await given.arrayBuffer());
  await tried(async () => {
    await open({ ...chosen, maze: null, parameters: {}, backend: chosen.backend === "both" ? "cpu" : chosen.backend }, { name: given.name, bytes });
    say(`${given.name} runs.`);
  });
}

function controls() {
  const on = (id, event, call) => element(id).addEventListener(event, call);
  for (const { name } of panel.scenes) element("scene").append(new Option(name, name));
  for (const { name } of panel.described.presets) element("preset").append(new Option(name, name));
  for (const name of Show.colors()) element("color").append(new Option(name, name));
  for (const name of Maze.boards()) element("board").append(new Option(name, name));
  on("play", "click", () => pause(!paused));
  on("step", "click", stepOnce);
  on("restart", "click", restart);
  on("whole", "click", () => act.whole());
  on("scene", "change", ({ target }) => target.value && panel.choose(target.value));
  on("gallery", "click", panel.gallery);
  on("tab-gallery", "click", () => game && tried(() => open({ ...chosen, maze: null }, file)));
  on("tab-maze", "click", () => !game && tried(() => open({ ...chosen, maze: element("board").value })));
  on("board", "change", ({ target }) => tried(() => open({ ...chosen, maze: target.value })));
  element("tilt").hidden = !maze.hasTilt();
  on("tilt", "click", () => tilts.follow().then(() => say("The board follows the tilt of this device."), refuse));
  on("preset", "change", ({ target }) => panel.choosePreset(target.value));
  on("defaults", "click", () => panel.choosePreset(element("preset").value));
  for (const form of document.querySelectorAll("form:not([method])")) form.addEventListener("submit", (event) => event.preventDefault());
  for (const input of document.querySelectorAll('input[name="backend"]')) {
    if (input.value !== "cpu") input.disabled = !hasWebGPU();
    input.addEventListener("change", () => tried(() => open({ ...chosen, backend: input.value }, file)).then(panel.panel));
  }
  on("exact", "change", ({ target }) => tried(() => open({ ...chosen, exact: target.checked }, file)).then(panel.panel));
  element("backend-note").textContent = hasWebGPU()
    ? "Both runs the scene on the CPU and on WebGPU, and reports the first number that differs. Exact WebGPU has the bits of the CPU, but is slower."
    : "This browser has no WebGPU: everything runs on the CPU.";
  element("conform").hidden = !hasWebGPU();
  on("conform", "click", panel.check);
  for (const id of ["color", "contacts", "joints", "boxes"]) on(id, "change", () => tried(panel.look));
  on("pace", "change", ({ target }) => setPace(Number(target.value)));
  on("open-file", "click", () => element("file").click());
  on("file", "change", ({ target }) => openFile(target.files[0]).then(() => (target.value = "")));
  on("save-scene", "click", () => tried(() => save(`${stem()}.json`, shows[0].scene_file(), "application/json")));
  on("save-recording", "click", () => tried(() => save(`${stem()}.drystone`, shows[0].recording(), "application/octet-stream")));
  on("copy-link", "click", () =>
    tried(async () => {
      if (file) throw new Error("a file has no link: save the scene and send the file");
      await navigator.clipboard.writeText(location.href);
      say("The link is copied.");
    }));
  addEventListener("hashchange", () => tried(() => follow(location.hash)));
  addEventListener("keydown", shortcut);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", numbers.redraw);
  dropping();
}

/// Opens the content of a link, or reports why it cannot.
async function follow(hash) {
  const found = link.read(hash);
  if (!found) return false;
  try {
    await open(found);
  } catch (error) {
    if (found.backend === "cpu") throw error;
    // Without WebGPU, the CPU runs the scene of the link.
    await open({ ...found, backend: "cpu" });
    say(`${error.message}. The CPU runs the scene.`, true);
  }
  return true;
}

function dropping() {
  let depth = 0;
  const show = (by) => (element("drop").hidden = (depth = Math.max(depth + by, 0)) === 0);
  addEventListener("dragenter", (event) => (event.preventDefault(), show(1)));
  addEventListener("dragleave", () => show(-1));
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    show(-depth);
    openFile(event.dataTransfer.files[0]);
  });
}

function shortcut(event) {
  const { key, target } = event;
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
  if (target.matches("input:not([type=radio]):not([type=checkbox]), select, textarea")) return;
  // Keys on a button belong to the button.
  if (key === " " && target.matches("button, summary, input")) return;
  const at = target === element("picture") && element("picture").matches(":focus-visible") ? [0, 0] : pointer;
  const calls = {
    " ": () => drives !== "character" && pause(!paused),
    p: () => pause(!paused),
    n: () => !game && stepOnce(),
    r: restart,
    f: act.whole,
    b: () => !game && act.throw(at),
    x: () => !game && act.delete(at),
    Delete: () => !game && act.delete(at),
  };
  const call = calls[key.length === 1 ? key.toLowerCase() : key];
  if (call) {
    event.preventDefault();
    call();
  }
}

/// Listens to pointers and keys on the pictures.
function hear() {
  for (const id of canvases) listen(element(id), act, () => document.querySelector('input[name="tool"]:checked').value);
  keys(element("picture"), act);
}

/// Loads the solver and shows the first picture.
async function begin() {
  await start({ module_or_path: new URL("drystone_web_bg.wasm", import.meta.url) });
  panel.begin();
  let note = null;
  try {
    await openPicture();
  } catch (error) {
    note = `There is no picture: ${error.message}. The numbers of the run are still shown.`;
  }
  controls();
  hear();
  changes.addEventListener("canvases", hear);
  if (!device.known() && !location.hash) await device.measure();
  await enqueue(async () => {
    const usual = { ...chosen, parameters: panel.first("pile") };
    try {
      if (!(await follow(location.hash))) await open(usual);
    } catch (error) {
      await open(usual);
      note = error.message;
    }
    await frame(performance.now());
  });
  element("loading").hidden = true;
  element("tools").hidden = element("whole").hidden = false;
  if (note) say(note, true);
  loop();
}

/// Converts a list of `name=value` to an object. An object stays as it is.
const named = (parameters) =>
  Array.isArray(parameters) ? Object.fromEntries(parameters.map((p) => p.split(/=(.*)/s).slice(0, 2))) : { ...parameters };

const ready = begin().catch((error) => {
  element("loading").textContent = `The page cannot run here: ${error.message}`;
  throw error;
});

// For tests and for the browser's console.
window.drystone = {
  ready,
  state,
  hash_after: (scene, given, steps) => ready.then(() => enqueue(() => hash_after(scene, assignments(given), steps))),
  open: (scene, given = {}, values = {}) =>
    ready.then(() => enqueue(() => open({ ...chosen, maze: null, scene, parameters: named(given), settings: { ...values } }))),
  maze: (board) => ready.then(() => enqueue(() => open({ ...chosen, maze: board }))),
  backend: (name, exact = true) => ready.then(() => enqueue(() => open({ ...chosen, backend: name, exact }, file))),
  pause: (value) => ready.then(() => enqueue(() => pause(value))),
  step: () => ready.then(() => enqueue(step)),
  restart: () => ready.then(() => enqueue(() => open(chosen, file))),
  conform: async (names = [], short = true) => {
    await ready;
    const lines = [];
    lines.push(await conform(short, names, (line) => lines.push(line)));
    return lines;
  },
};

