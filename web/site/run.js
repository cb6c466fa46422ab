// The run, and the loop that steps and draws it. Other files read the exports; only functions of this file change them.
import { Maze, Picture, Show, first_difference } from "./drystone_web.js";
import * as link from "./link.js";
import * as maze from "./maze.js";
import * as numbers from "./numbers.js";
import { Steering } from "./steering.js";

const element = (id) => document.getElementById(id);
/// Largest number of steps between two pictures, and the time after which no further step begins (ms).
const [MAX_STEPS, PATIENCE] = [4, 25];

/// Events: `replaced` when something else runs, `differs` at the first number that differs, and `canvases` when
/// canvases were replaced.
export const changes = new EventTarget();
/// The state of the controls.
export let chosen = { maze: null, scene: "pile", parameters: {}, settings: {}, backend: "cpu", exact: true };
/// The bytes and name of the file that runs instead of a scene of the catalogue.
export let file = null;
/// The run: one show, two side by side, or a game.
export let shows = [];
export let game = null;
let pictures = [];
export let paused = false;
let owed = 0;
let last = null;
/// The last place of the pointer, -1 to 1 from left to right and from bottom to top.
export let pointer = [0, 0];
/// The first number that differs between two shows.
export let difference = null;
let pace = 1;
/// The aspect ratio for which the whole scene was last shown, or "by hand".
let framed = null;
const rates = { steps: 0, pictures: 0 };
/// Wanted tilts of the board.
export const tilts = new maze.Tilts();
tilts.listens = () => game !== null;
/// The body that a person can drive in the run: "character", "vehicle" or null.
export let drives = null;
const steering = new Steering(() => drives);

// Calls of the solver can wait for a device and must not overlap: each begins when the one before has ended.
let line = Promise.resolve();
let isBusy = false;
export function enqueue(call) {
  const result = line.then(() => {
    isBusy = true;
    return call();
  });
  line = result.catch(() => {}).finally(() => (isBusy = false));
  return result;
}

export function say(text, isBad = false) {
  const message = element("message");
  message.textContent = text;
  message.className = isBad ? "bad" : "";
  clearTimeout(say.timer);
  if (!isBad) say.timer = setTimeout(() => (message.textContent = ""), 6000);
}

/// Shows the line of an error. The run continues, unless the solver itself failed.
export function refuse(error) {
  if (error instanceof WebAssembly.RuntimeError) {
    pause(true);
    [shows, game, drives] = [[], null, null];
    say("The solver stopped because of a defect. Load the page again to continue.", true);
    throw error;
  }
  say(error.message ?? String(error), true);
}

/// Does what a control requests, or reports why it cannot be done.
export const tried = (call) => enqueue(call).then((value) => value, refuse);

export const hasWebGPU = () => pictures[0]?.api() === "WebGPU";
const aspect = () => {
  const { clientWidth, clientHeight } = element("picture");
  return clientHeight > 0 ? clientWidth / clientHeight : 1;
};
export const assignments = (parameters) =>
  Array.isArray(parameters) ? parameters : Object.entries(parameters ?? {}).map(([name, value]) => `${name}=${value}`);

/// Opens the chosen scene or file. It replaces the present run only if all of it can be opened.
export async function open(next, nextFile = null) {
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
      await show.use_backend(backend === "webgpu" && next.exact ? "webgpu-exact" : backend);
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
  drives = shows[0]?.drives() ?? null;
  const isTwo = shows.length === 2;
  element("beside").hidden = !isTwo;
  document.querySelectorAll("figcaption").forEach((caption) => (caption.hidden = !isTwo));
  pause(false);
  numbers.restart();
  changes.dispatchEvent(new Event("replaced"));
  address();
  say("");
}

/// Writes the run into the address. A file has no link.
const address = () => history.replaceState(null, "", file ? location.pathname + location.search : link.write(chosen));

/// Changes the settings of the run.
export function setSettings(next) {
  for (const show of shows) show.set_settings(JSON.stringify(next));
  chosen = { ...chosen, settings: next };
  address();
}

export const setPace = (times) => (pace = times);

export const canvases = ["picture", "picture-beside"];
/// Number of lost devices after which WebGL draws instead of WebGPU.
const MAX_LOSSES = 3;
let losses = 0;
let drawsByWebGPU = true;

/// Opens a picture, or opens it again.
async function renew(k) {
  try {
    const fresh = await Picture.open(element(canvases[k]), drawsByWebGPU);
    pictures[k]?.free();
    pictures[k] = fresh;
  } catch (error) {
    if (!drawsByWebGPU) {
      pictures.splice(0).forEach((picture) => picture.free());
      throw error;
    }
    await leaveWebGPU(Math.max(pictures.length, k + 1));
  }
}

/// Switches this many pictures to WebGL. A canvas that was used for WebGPU no longer supports WebGL, so other canvases
/// replace it.
async function leaveWebGPU(count) {
  [drawsByWebGPU, losses] = [false, 0];
  for (const id of canvases) {
    const [old, fresh] = [element(id), element(id).cloneNode()];
    const hasFocus = document.activeElement === old;
    old.replaceWith(fresh);
    if (hasFocus) fresh.focus({ focusVisible: false, preventScroll: true });
  }
  changes.dispatchEvent(new Event("canvases"));
  for (let k = 0; k < count; k += 1) await renew(k);
}

/// The first picture.
export const openPicture = () => renew(0);

/// The second picture, for the second of two shows, and new pictures after the loss of a device.
async function besides() {
  if (shows.length === 2 && pictures.length === 1) await renew(1);
  const lost = pictures.map((picture) => picture.is_lost());
  if (!lost.includes(true)) return;
  losses += 1;
  if (losses <= MAX_LOSSES) {
    for (const k of pictures.keys()) if (lost[k]) await renew(k);
  } else if (drawsByWebGPU) {
    await leaveWebGPU(pictures.length);
    say("WebGL now draws the picture: the WebGPU device was lost repeatedly.");
  } else {
    pictures.splice(0).forEach((picture) => picture.free());
    throw new Error("there is no picture: the device that draws was lost repeatedly. The numbers of the run are still shown");
  }
}

/// Shows the whole scene and follows its bodies, until the user turns or moves the view or touches a body.
function whole() {
  if (framed === "by hand") return;
  if (framed !== aspect()) {
    framed = aspect();
    (game ? [game] : shows).forEach((show) => show.whole(framed));
  } else if (!paused) shows.forEach((show) => show.follow(framed));
}

/// Steps for the time since the last picture, and draws.
export async function frame(now) {
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
  owed = Math.min(owed + seconds * pace, MAX_STEPS * dt);
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

/// One step of the whole run. It records the first number that differs.
export async function step() {
  const input = steering.next();
  for (const show of shows) {
    show.steer(...input);
    await show.step();
  }
  if (shows.length === 2 && difference === null) {
    const found = first_difference(shows[0], shows[1]);
    if (found !== undefined) {
      difference = JSON.parse(found);
      changes.dispatchEvent(new Event("differs"));
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

/// Numbers of the run. While a step waits for a device, they are those of the step before.
export function state() {
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
    // The device was lost, and another backend continues.
    if (told.fault && told.fault !== shown.fault) say(told.fault, true);
    shown.fault = told.fault;
  }
  shown.at = now;
}

/// Steps and draws from now on with each animation frame of the browser.
export function loop() {
  const tick = (now) =>
    enqueue(() => frame(now))
      .catch(refuse)
      .finally(() => requestAnimationFrame(tick));
  // Time in which the page is hidden is skipped.
  document.addEventListener("visibilitychange", () => (last = null));
  requestAnimationFrame(tick);
}

export function pause(value) {
  paused = value;
  element("play").textContent = paused ? "Run" : "Pause";
}

export const restart = () => tried(() => open(chosen, file));
export const stepOnce = () =>
  tried(async () => {
    pause(true);
    if (shows.length > 0) await step();
  });

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
/// The effects of pointers and keys on the run (pointer.js).
export const act = {
  orbit: (by) => turned((show) => show.orbit(...by)),
  pan: (by) => turned((show) => show.pan(...by)),
  zoom: (notches) => turned((show) => show.zoom(notches)),
  whole: () => tried(() => (framed = null)),
  grab: async (at) => {
    const isTaken = game === null && (await both((show) => show.grab(...at, aspect())));
    if (isTaken) framed = "by hand";
    return isTaken;
  },
  drag: (at) => both((show) => show.drag(...at, aspect())),
  release: () => both((show) => show.release()),
  throw: (at) => touched((show) => show.throw_cube(...at, aspect())),
  delete: (at) => touched((show) => show.delete_body(...at, aspect())),
  point: (at) => (pointer = at),
  /// Whether arrow keys tilt a board or drive.
  steers: () => game !== null || drives !== null,
  press: (at) => {
    tilts.pressed = game ? at : null;
    return game !== null;
  },
};
