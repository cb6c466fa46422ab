// The page: what runs, the loop that steps and draws it, and the controls.
import start, { Maze, Picture, Show, catalogue, conform, first_difference, hash_after, settings } from "./drystone_web.js";
import * as device from "./device.js";
import * as fields from "./fields.js";
import * as link from "./link.js";
import * as maze from "./maze.js";
import * as numbers from "./numbers.js";
import { keys, listen } from "./pointer.js";

const element = (id) => document.getElementById(id);
/// Most steps between two pictures, and the time after which none begins (ms).
const [MOST_STEPS, PATIENCE] = [4, 25];
/// Settings above the fold.
const MAIN = ["substeps", "iterations", "relax", "friction"];

let scenes = [];
let described = { presets: [], settings: [] };
/// What the controls say.
let chosen = { maze: null, scene: "pile", parameters: {}, settings: {}, backend: "cpu" };
/// The bytes and name of the file that runs instead of a scene of the catalogue.
let file = null;
/// What runs: one show, or two beside each other; or a game.
let shows = [];
let game = null;
let pictures = [];
let paused = false;
let owed = 0;
let last = null;
let pointer = [0, 0];
let difference = null;
let pace = 1;
/// The width over the height that all of the scene was last shown for, or "by hand".
let framed = null;
const rates = { steps: 0, pictures: 0 };
const tilts = new maze.Tilts();
tilts.listens = () => game !== null;

// Calls of the solver may wait for a device and must not overlap: each begins when the one before has ended.
let line = Promise.resolve();
let isBusy = false;
function enqueue(call) {
  const result = line.then(() => {
    isBusy = true;
    return call();
  });
  line = result.catch(() => {}).finally(() => (isBusy = false));
  return result;
}

function say(text, isBad = false) {
  const message = element("message");
  message.textContent = text;
  message.className = isBad ? "bad" : "";
  clearTimeout(say.timer);
  if (!isBad) say.timer = setTimeout(() => (message.textContent = ""), 6000);
}

/// Shows the line of an error. What runs goes on, unless the solver itself broke.
function refuse(error) {
  if (error instanceof WebAssembly.RuntimeError) {
    paused = true;
    shows = [];
    game = null;
    say("The solver has stopped by a mistake of its own. Load the page again to go on.", true);
    throw error;
  }
  say(error.message ?? String(error), true);
}

/// Runs what a control asks for, and says why where it cannot be done.
const tried = (call) => enqueue(call).then((value) => value, refuse);

const hasWebGPU = () => pictures[0]?.api() === "WebGPU";
const aspect = () => {
  const { clientWidth, clientHeight } = element("picture");
  return clientHeight > 0 ? clientWidth / clientHeight : 1;
};
const assignments = (parameters) =>
  Array.isArray(parameters) ? parameters : Object.entries(parameters ?? {}).map(([name, value]) => `${name}=${value}`);
const named = (parameters) =>
  Array.isArray(parameters) ? Object.fromEntries(parameters.map((p) => p.split(/=(.*)/s).slice(0, 2))) : { ...parameters };

/// Opens what is chosen. Only where all of it can be opened does it replace what runs.
async function open(next, nextFile = null) {
  if (next.maze) {
    const opened = new Maze(next.maze);
    replace([], opened, next, null);
    return;
  }
  const make = () =>
    nextFile
      ? Show.file(nextFile.name, nextFile.bytes, JSON.stringify(next.settings))
      : Show.scene(next.scene, assignments(next.parameters), JSON.stringify(next.settings));
  const made = [];
  try {
    for (const backend of next.backend === "both" ? ["cpu", "webgpu"] : [next.backend]) {
      const show = make();
      made.push(show);
      await show.use_backend(backend);
    }
    if (made.length === 2 && made[0].is_recording()) throw new Error("a recording runs on one backend at a time");
  } catch (error) {
    made.forEach((show) => show.free());
    throw error;
  }
  replace(made, null, next, nextFile);
}

function replace(made, opened, next, nextFile) {
  const world = ({ scene, parameters }) => JSON.stringify([scene, parameters]);
  const isSame = shows.length > 0 && made.length > 0 && nextFile === file && world(next) === world(chosen);
  for (const show of made) if (isSame) show.look_as(shows[0]);
  if (!isSame || framed !== "by hand") framed = null;
  [...shows, ...(game ? [game] : [])].forEach((old) => old.free());
  [shows, game, chosen, file] = [made, opened, next, nextFile];
  [owed, last, difference, tilts.pressed] = [0, null, null, null];
  const isTwo = shows.length === 2;
  element("beside").hidden = !isTwo;
  document.querySelectorAll("figcaption").forEach((caption) => (caption.hidden = !isTwo));
  paused = false;
  numbers.restart();
  look();
  panel();
  if (nextFile === null) history.replaceState(null, "", link.write(chosen));
  else history.replaceState(null, "", location.pathname + location.search);
  say("");
}

const canvases = ["picture", "picture-beside"];
const MOST_LOSSES = 3;
let losses = 0;

/// The second picture, for the second of two shows; and new pictures for those whose device was lost.
async function besides() {
  if (losses > MOST_LOSSES) return;
  if (shows.length === 2 && pictures.length === 1) pictures.push(await Picture.open(element(canvases[1])));
  for (const [k, picture] of pictures.entries()) {
    if (!picture.is_lost()) continue;
    losses += 1;
    if (losses > MOST_LOSSES) {
      pictures.splice(0).forEach((lost) => lost.free());
      throw new Error("there is no picture: the device that draws was lost again and again. The numbers are those of the run");
    }
    pictures[k] = await Picture.open(element(canvases[k]));
    picture.free();
  }
}

/// Shows all of the scene and follows its bodies, until the view is turned or moved or a body is touched.
function whole() {
  if (framed === "by hand") return;
  if (framed !== aspect()) {
    framed = aspect();
    (game ? [game] : shows).forEach((show) => show.whole(framed));
  } else if (!paused) shows.forEach((show) => show.follow(framed));
}

/// Steps as much as time has passed since the last picture, and draws.
async function frame(now) {
  const seconds = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
  last = now;
  if (game) await play(seconds);
  else if (shows.length > 0) await advance(seconds);
  await besides();
  whole();
  draw();
  tell(now);
  if (seconds > 0) rates.pictures += 0.1 * (1 / seconds - rates.pictures);
}

async function play(seconds) {
  if (paused) return;
  await game.advance(seconds, ...tilts.wanted());
}

async function advance(seconds) {
  if (paused) return;
  try {
    await steps(seconds);
  } catch (error) {
    pause(true);
    throw error;
  }
}

async function steps(seconds) {
  const dt = shows[0].dt();
  owed = Math.min(owed + seconds * pace, MOST_STEPS * dt);
  const began = performance.now();
  let made = 0;
  while (owed >= dt && performance.now() - began < PATIENCE) {
    await step();
    owed -= dt;
    made += 1;
    if (shows[0].is_at_end()) {
      pause(true);
      say("The recording has ended.");
      break;
    }
  }
  if (seconds > 0) rates.steps += 0.1 * (made / seconds - rates.steps);
}

/// One step of all that runs; notes the first number that differs.
async function step() {
  for (const show of shows) await show.step();
  if (shows.length === 2 && difference === null) {
    const found = first_difference(shows[0], shows[1]);
    if (found !== undefined) {
      difference = JSON.parse(found);
      told();
    }
  }
}

function draw() {
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  const ground = getComputedStyle(document.documentElement).getPropertyValue("--picture").trim();
  const color = [1, 3, 5].map((k) => parseInt(ground.slice(k, k + 2), 16) / 255);
  pictures.forEach((picture, k) => {
    const canvas = element(canvases[k]);
    const size = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.round(x * scale));
    const what = game ?? shows[k];
    if (!picture || !what || size[0] === 0 || size[1] === 0) return;
    if (game) picture.draw_maze(game, ...size, ...color);
    else picture.draw(what, ...size, ...color);
  });
}

/// Numbers of what runs. While a step waits for a device they are those of the step before.
function state() {
  return isBusy && latest ? latest : counted();
}

function counted() {
  const common = {
    picture: pictures[0]?.api() ?? "none",
    paused,
    steps_a_second: paused ? 0 : rates.steps,
    fps: rates.pictures,
    message: element("message").textContent,
    maze: game ? JSON.parse(game.numbers()) : null,
  };
  const told = shows.map((show) => JSON.parse(show.numbers()));
  latest = shows.length === 0 ? common : {
    ...told[0],
    scene: file ? file.name : chosen.scene,
    parameters: { ...chosen.parameters },
    settings: { ...chosen.settings },
    first_difference: difference,
    beside: told[1] ?? null,
    ...common,
  };
  return latest;
}

let latest = null;
let shown = { at: 0, steps: -1 };
function tell(now) {
  if (now - shown.at < 100 || document.hidden) return;
  const told = counted();
  if (game) maze.show(told.maze);
  if (shows.length > 0) {
    numbers.show(told, told.steps !== shown.steps);
    shown.steps = told.steps;
    // The device was lost, and another backend goes on.
    if (told.fault && told.fault !== shown.fault) say(told.fault, true);
    shown.fault = told.fault;
  }
  shown.at = now;
}

function tick(now) {
  enqueue(() => frame(now))
    .catch(refuse)
    .finally(() => requestAnimationFrame(tick));
}

function pause(value) {
  paused = value;
  element("play").textContent = paused ? "Run" : "Pause";
}

const restart = () => tried(() => open(chosen, file));
const stepOnce = () =>
  tried(async () => {
    pause(true);
    if (shows.length > 0) await step();
  });

// Controls.

function look() {
  const [contacts, joints, boxes] = ["contacts", "joints", "boxes"].map((id) => element(id).checked);
  for (const show of shows) {
    show.color(element("color").value);
    show.overlay(contacts, joints, boxes);
  }
}

/// The difference between the two backends as a sentence.
function told() {
  const at = element("difference");
  if (shows.length < 2) at.textContent = "";
  else if (difference === null) at.textContent = "No number has differed yet.";
  else {
    const { step, body, quantity, values } = difference;
    at.textContent = `The first difference is after step ${step}: ${quantity} of body ${body} is ${values[0]} on the CPU and ${values[1]} on WebGPU.`;
  }
}

function panel() {
  const isMaze = game !== null;
  for (const part of document.querySelectorAll("[data-of]")) part.hidden = (part.dataset.of === "maze") !== isMaze;
  element("tab-gallery").setAttribute("aria-pressed", String(!isMaze));
  element("tab-maze").setAttribute("aria-pressed", String(isMaze));
  element("step").hidden = isMaze;
  pause(paused);
  told();
  if (isMaze) {
    element("board").value = chosen.maze;
    element("runs-on").lastElementChild.textContent = "CPU";
    element("picture").setAttribute("aria-label", `Picture of the maze ${chosen.maze}`);
    return;
  }
  element("runs-on").lastElementChild.textContent = { cpu: "CPU", webgpu: "WebGPU", both: "CPU and WebGPU" }[chosen.backend];
  element("picture").setAttribute("aria-label", `Picture of ${file ? file.name : chosen.scene}`);
  document.querySelector(`input[name="backend"][value="${chosen.backend}"]`).checked = true;
  element("settings").hidden = shows[0].is_recording();
  parameters();
  solver();
}

function parameters() {
  const entry = file ? null : scenes.find((scene) => scene.name === chosen.scene);
  const select = element("scene");
  select.querySelector("option[data-file]")?.remove();
  if (file) {
    const option = new Option(file.name, "", true, true);
    option.dataset.file = "";
    select.prepend(option);
  } else select.value = chosen.scene;
  element("summary").textContent = entry ? sentence(entry.summary) : shows[0].is_recording() ? "A recording." : "A scene file.";
  const changed = (name) => (value) =>
    tried(() => open({ ...chosen, parameters: { ...chosen.parameters, [name]: value } })).then(parameters);
  fields.replace(
    element("parameters"),
    (entry?.parameters ?? []).map((p) => {
      const value = Number(chosen.parameters[p.name] ?? p.default);
      const about = { prefix: "parameter", name: p.name, summary: `${sentence(p.summary)} From ${numbers.plain(p.least)} to ${numbers.plain(p.most)}.` };
      return fields.field({ ...about, value, slider: fields.slider(p), isChanged: value !== p.default }, changed(p.name));
    }),
  );
  const known = device.known();
  element("device").replaceChildren();
  if (entry?.name === "pile" && known) {
    const again = Object.assign(document.createElement("button"), { type: "button", id: "measure", textContent: "Measure again" });
    again.addEventListener("click", () => tried(() => measured()));
    element("device").append(`This device steps about ${known.boxes} boxes in real time, as the page has measured. `, again);
  }
}

/// A line of the library as a sentence; a name of one letter stays.
const sentence = (text) => `${/^\w\b/.test(text) && text[0] !== "a" ? text[0] : text[0].toUpperCase()}${text.slice(1)}.`;

/// Measures the device and opens a pile of the size that it bears.
async function measured() {
  const { boxes } = device.measure();
  await open({ ...chosen, maze: null, scene: "pile", parameters: { ...chosen.parameters, n: boxes } });
  say(`This device steps about ${boxes} boxes in real time.`);
}

function solver() {
  const preset = described.presets.find((p) => p.name === (chosen.settings.preset ?? described.preset));
  element("preset").value = preset.name;
  const change = async (next) => {
    await tried(() => {
      for (const show of shows) show.set_settings(JSON.stringify(next));
      chosen = { ...chosen, settings: next };
      if (!file) history.replaceState(null, "", link.write(chosen));
      say("");
    });
    solver();
  };
  solver.change = change;
  const make = (setting) => {
    const usual = preset.changes[setting.name] ?? setting.default;
    const value = chosen.settings[setting.name] ?? usual;
    const about = { prefix: "setting", ...setting, summary: `${setting.summary}.`, value, isChanged: value !== usual };
    return fields.field(about, (value) => {
      const { [setting.name]: _, ...others } = chosen.settings;
      return change(value === usual ? others : { ...others, [setting.name]: value });
    });
  };
  const isMain = (setting) => MAIN.includes(setting.name);
  const main = MAIN.map((name) => described.settings.find((setting) => setting.name === name)).filter(Boolean);
  fields.replace(element("main-settings"), main.map(make));
  fields.replace(element("all-settings"), described.settings.filter((setting) => !isMain(setting)).map(make));
  element("defaults").disabled = Object.keys(chosen.settings).every((name) => name === "preset");
}

const presetOnly = (name) => (name === described.preset ? {} : { preset: name });

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

/// Checks the WebGPU of this browser, and lists what was found.
async function check() {
  const list = element("checks");
  list.replaceChildren();
  const add = (line) => {
    const item = Object.assign(document.createElement("li"), { textContent: line });
    if (line.startsWith("failed")) item.className = "bad";
    list.prepend(item);
  };
  element("conform").disabled = true;
  element("checked").textContent = "The checks run.";
  element("conform-dialog").showModal();
  try {
    element("checked").textContent = `${await conform(true, [], add)}.`;
  } catch (error) {
    element("checked").textContent = error.message;
  }
  element("conform").disabled = false;
}

function gallery() {
  const cards = element("cards");
  if (cards.children.length === 0) {
    for (const { name, summary } of scenes) {
      const card = document.createElement("button");
      card.type = "button";
      const image = Object.assign(document.createElement("img"), { loading: "lazy", alt: "", src: `gallery/${name}.png` });
      const [strong, small] = [document.createElement("strong"), document.createElement("small")];
      [strong.textContent, small.textContent] = [name, sentence(summary)];
      card.append(image, strong, small);
      card.addEventListener("click", () => {
        element("gallery-dialog").close();
        choose(name);
      });
      const item = document.createElement("li");
      item.append(card);
      cards.append(item);
    }
  }
  element("gallery-dialog").showModal();
}

/// The parameters that a scene begins with: a pile has the size that the device bears.
const first = (scene) => (scene === "pile" && device.known() ? { n: device.known().boxes } : {});
const choose = (scene) => tried(() => open({ ...chosen, maze: null, scene, parameters: first(scene) })).then(panel);

function controls() {
  const on = (id, event, call) => element(id).addEventListener(event, call);
  for (const { name } of scenes) element("scene").append(new Option(name, name));
  for (const { name } of described.presets) element("preset").append(new Option(name, name));
  for (const name of Show.colors()) element("color").append(new Option(name, name));
  for (const name of Maze.boards()) element("board").append(new Option(name, name));
  on("play", "click", () => pause(!paused));
  on("step", "click", stepOnce);
  on("restart", "click", restart);
  on("whole", "click", () => act.whole());
  on("scene", "change", ({ target }) => target.value && choose(target.value));
  on("gallery", "click", gallery);
  on("tab-gallery", "click", () => game && tried(() => open({ ...chosen, maze: null }, file)));
  on("tab-maze", "click", () => !game && tried(() => open({ ...chosen, maze: element("board").value })));
  on("board", "change", ({ target }) => tried(() => open({ ...chosen, maze: target.value })));
  element("tilt").hidden = !maze.hasTilt();
  on("tilt", "click", () => tilts.follow().then(() => say("The board follows the tilt of this device."), refuse));
  on("preset", "change", ({ target }) => solver.change(presetOnly(target.value)));
  on("defaults", "click", () => solver.change(presetOnly(element("preset").value)));
  for (const form of document.querySelectorAll("form:not([method])")) form.addEventListener("submit", (event) => event.preventDefault());
  for (const input of document.querySelectorAll('input[name="backend"]')) {
    if (input.value !== "cpu") input.disabled = !hasWebGPU();
    input.addEventListener("change", () => tried(() => open({ ...chosen, backend: input.value }, file)).then(panel));
  }
  element("backend-note").textContent = hasWebGPU()
    ? "Both runs the CPU beside WebGPU and names the first number that differs."
    : "This browser has no WebGPU: everything runs on the CPU.";
  element("conform").hidden = !hasWebGPU();
  on("conform", "click", check);
  for (const id of ["color", "contacts", "joints", "boxes"]) on(id, "change", () => tried(look));
  on("pace", "change", ({ target }) => (pace = Number(target.value)));
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
  document.addEventListener("visibilitychange", () => (last = null));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", numbers.redraw);
  dropping();
}

/// Opens what a link names, or says why it cannot.
async function follow(hash) {
  const found = link.read(hash);
  if (!found) return false;
  try {
    await open(found);
  } catch (error) {
    if (found.backend === "cpu") throw error;
    // A device without WebGPU follows the link all the same.
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

const both = (call) => tried(() => shows.map(call)[0]);
const touched = (call) => {
  framed = "by hand";
  return both(call);
};
const turned = (call) =>
  tried(() => {
    framed = "by hand";
    (game ? [game] : shows).forEach(call);
  });
const act = {
  orbit: (by) => turned((show) => show.orbit(...by)),
  pan: (by) => turned((show) => show.pan(...by)),
  zoom: (notches) => turned((show) => show.zoom(notches)),
  whole: () => tried(() => (framed = null)),
  grab: (at) => (game ? Promise.resolve(false) : touched((show) => show.grab(...at, aspect()))),
  drag: (at) => both((show) => show.drag(...at, aspect())),
  release: () => both((show) => show.release()),
  throw: (at) => touched((show) => show.throw_cube(...at, aspect())),
  delete: (at) => touched((show) => show.delete_body(...at, aspect())),
  point: (at) => (pointer = at),
  /// Whether arrow keys tilt a board.
  tilts: () => game !== null,
  press: (at) => {
    tilts.pressed = game ? at : null;
    return game !== null;
  },
};

function shortcut(event) {
  const { key, target } = event;
  if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
  if (target.matches("input:not([type=radio]):not([type=checkbox]), select, textarea")) return;
  // The keys of buttons are their own.
  if (key === " " && target.matches("button, summary, input")) return;
  const at = target === element("picture") && element("picture").matches(":focus-visible") ? [0, 0] : pointer;
  const calls = {
    " ": () => pause(!paused),
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

/// The first picture of the page.
async function begin() {
  await start({ module_or_path: new URL("drystone_web_bg.wasm", import.meta.url) });
  [scenes, described] = [catalogue(), settings()].map((text) => JSON.parse(text));
  let note = null;
  try {
    pictures = [await Picture.open(element("picture"))];
  } catch (error) {
    pictures = [];
    note = `There is no picture: ${error.message}. The numbers are those of the run.`;
  }
  controls();
  for (const id of canvases) listen(element(id), act, () => document.querySelector('input[name="tool"]:checked').value);
  keys(element("picture"), act);
  if (!device.known() && !location.hash) device.measure();
  await enqueue(async () => {
    const usual = { ...chosen, parameters: first("pile") };
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
  requestAnimationFrame(tick);
}

const ready = begin().catch((error) => {
  element("loading").textContent = `The page cannot run here: ${error.message}`;
  throw error;
});

// For tests and for the console of the browser.
window.drystone = {
  ready,
  state,
  hash_after: (scene, given, steps) => ready.then(() => enqueue(() => hash_after(scene, assignments(given), steps))),
  open: (scene, given = {}, values = {}) =>
    ready.then(() => enqueue(() => open({ ...chosen, maze: null, scene, parameters: named(given), settings: { ...values } }))),
  maze: (board) => ready.then(() => enqueue(() => open({ ...chosen, maze: board }))),
  backend: (name) => ready.then(() => enqueue(() => open({ ...chosen, backend: name }, file))),
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
