// The contents of the controls: the scene with its parameters, the settings, the gallery, and the checks of WebGPU.
import { catalogue, conform, settings } from "./drystone_web.js";
import * as device from "./device.js";
import * as fields from "./fields.js";
import * as numbers from "./numbers.js";
import { changes, chosen, difference, drives, file, game, open, say, setSettings, shows, tried } from "./run.js";

const element = (id) => document.getElementById(id);
/// Settings above the fold.
const MAIN = ["substeps", "iterations", "relax", "friction"];

export let scenes = [];
export let described = { presets: [], settings: [] };

/// Reads the descriptions in the library, and from then on shows the run.
export function begin() {
  [scenes, described] = [catalogue(), settings()].map((text) => JSON.parse(text));
  changes.addEventListener("replaced", () => (look(), panel()));
  changes.addEventListener("differs", told);
}

export function look() {
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

export function panel() {
  const isMaze = game !== null;
  const shown = isMaze ? ["maze"] : ["scenes", ...(drives ? ["driven", drives] : ["undriven"])];
  for (const part of document.querySelectorAll("[data-of]")) part.hidden = !shown.includes(part.dataset.of);
  element("tab-gallery").setAttribute("aria-pressed", String(!isMaze));
  element("tab-maze").setAttribute("aria-pressed", String(isMaze));
  element("step").hidden = isMaze;
  told();
  if (isMaze) {
    element("board").value = chosen.maze;
    element("runs-on").lastElementChild.textContent = "CPU";
    element("picture").setAttribute("aria-label", `Picture of the maze ${chosen.maze}`);
    return;
  }
  const webgpu = chosen.exact ? "exact WebGPU" : "WebGPU";
  element("runs-on").lastElementChild.textContent = { cpu: "CPU", webgpu, both: `CPU and ${webgpu}` }[chosen.backend];
  element("picture").setAttribute("aria-label", `Picture of ${file ? file.name : chosen.scene}`);
  document.querySelector(`input[name="backend"][value="${chosen.backend}"]`).checked = true;
  element("exact").checked = chosen.exact;
  element("exact").disabled = chosen.backend === "cpu";
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
      const given = chosen.parameters[p.name] ?? p.default;
      const about = { prefix: "parameter", name: p.name, summary: sentence(p.summary) };
      if (p.words.length > 0) {
        // A link may have the number of a word.
        const value = p.words[given] ?? given;
        return fields.field({ ...about, value, words: p.words, isChanged: value !== p.words[p.default] }, changed(p.name));
      }
      const value = Number(given);
      about.summary += ` From ${numbers.plain(p.least)} to ${numbers.plain(p.most)}.`;
      return fields.field({ ...about, value, slider: fields.slider(p), isChanged: value !== p.default }, changed(p.name));
    }),
  );
  const known = device.known();
  element("device").replaceChildren();
  if (entry?.name === "pile" && known) {
    const again = Object.assign(document.createElement("button"), { type: "button", id: "measure", textContent: "Measure again" });
    again.addEventListener("click", () => tried(measured));
    element("device").append(`This device steps about ${known.boxes} boxes in real time, as the page has measured. `, again);
  }
}

/// A line of the library as a sentence. A name of one letter stays lower case.
const sentence = (text) => `${/^\w\b/.test(text) && text[0] !== "a" ? text[0] : text[0].toUpperCase()}${text.slice(1)}.`;

/// Measures the device and opens the largest pile that it steps in real time.
async function measured() {
  const { boxes } = await device.measure();
  await open({ ...chosen, maze: null, scene: "pile", parameters: { ...chosen.parameters, n: boxes } });
  say(`This device steps about ${boxes} boxes in real time.`);
}

function solver() {
  const preset = described.presets.find((p) => p.name === (chosen.settings.preset ?? described.preset));
  element("preset").value = preset.name;
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

/// Changes the settings of the run.
const change = (next) =>
  tried(() => {
    setSettings(next);
    say("");
  }).then(solver);

/// Changes the settings to those of a preset.
export const choosePreset = (name) => change(name === described.preset ? {} : { preset: name });

/// Checks the WebGPU of this browser, and lists the results.
export async function check() {
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

export function gallery() {
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
        // Keys then drive the scene, and do not press the button that opened the gallery.
        choose(name).then(() => drives && element("picture").focus({ preventScroll: true }));
      });
      const item = document.createElement("li");
      item.append(card);
      cards.append(item);
    }
  }
  element("gallery-dialog").showModal();
}

/// The first parameters of a scene. A pile has the size that the device can step in real time.
export const first = (scene) => (scene === "pile" && device.known() ? { n: device.known().boxes } : {});
export const choose = (scene) => tried(() => open({ ...chosen, maze: null, scene, parameters: first(scene) })).then(panel);

