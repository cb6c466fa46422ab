// What runs, as the part of the address behind #: scene=pile&p.n=500&s.substeps=4&backend=webgpu&exact=false, or
// maze=easy.

export function write({ maze, scene, parameters, settings, backend, exact }) {
  const parts = new URLSearchParams();
  if (maze) {
    parts.set("maze", maze);
  } else {
    parts.set("scene", scene);
    for (const [name, value] of Object.entries(parameters)) parts.set(`p.${name}`, value);
    for (const [name, value] of Object.entries(settings)) parts.set(`s.${name}`, value);
    if (backend !== "cpu") parts.set("backend", backend);
    if (!exact) parts.set("exact", "false");
  }
  return `#${parts}`;
}

/// Reads the part of an address; null without one. Throws a line that names what is wrong.
export function read(hash) {
  if (hash.length < 2) return null;
  const found = { scene: null, maze: null, parameters: {}, settings: {}, backend: "cpu", exact: true };
  for (const [key, value] of new URLSearchParams(hash.slice(1))) {
    if (key === "scene" || key === "maze") found[key] = value;
    else if (key === "backend" && ["cpu", "webgpu", "both"].includes(value)) found.backend = value;
    else if (key === "exact" && ["true", "false"].includes(value)) found.exact = value === "true";
    else if (key.startsWith("p.")) found.parameters[key.slice(2)] = value;
    else if (key.startsWith("s.")) found.settings[key.slice(2)] = typed(value);
    else throw new Error(`the link has an unknown part: ${key} = ${value}`);
  }
  if (found.scene === null && found.maze === null) throw new Error("the link names no scene");
  return found;
}

/// The value of a setting: a number, a truth value or a word.
function typed(text) {
  if (text === "true" || text === "false") return text === "true";
  return text.trim() !== "" && Number.isFinite(Number(text)) ? Number(text) : text;
}
