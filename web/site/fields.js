// Forms of parameters and settings, built from the descriptions in the library.

/// A field with its label and description. `changed` gets the chosen value.
export function field({ prefix, name, summary, value, words = [], slider = null, isChanged = false }, changed) {
  const id = `${prefix}-${name.replace(".", "-")}`;
  const parent = document.createElement("div");
  parent.className = isChanged ? "field changed" : "field";
  const line = document.createElement("div");
  line.className = "line";
  const label = document.createElement("label");
  [label.htmlFor, label.textContent] = [id, name.replaceAll("_", " ")];
  let input;
  if (words.length > 0) {
    input = document.createElement("select");
    for (const word of words) input.append(new Option(word, word, false, word === value));
    input.addEventListener("change", () => changed(input.value));
  } else if (typeof value === "boolean") {
    input = document.createElement("input");
    [input.type, input.checked] = ["checkbox", value];
    input.addEventListener("change", () => changed(input.checked));
  } else {
    input = document.createElement("input");
    [input.type, input.inputMode, input.value, input.autocomplete] = ["text", "decimal", value, "off"];
    input.addEventListener("change", () => changed(number(input.value)));
  }
  input.id = id;
  line.append(label, input);
  parent.append(line);
  if (slider !== null && words.length === 0) parent.append(range(slider, id, name, value, input, changed));
  const small = document.createElement("small");
  [small.id, small.textContent] = [`${id}-about`, summary];
  input.setAttribute("aria-describedby", small.id);
  parent.append(small);
  return parent;
}

/// A number, or the text itself if it is not a number: the library then refuses it by name.
function number(text) {
  const value = Number(text.replace(",", "."));
  return text.trim() === "" || !Number.isFinite(value) ? text : value;
}

function range({ least, most, whole, logarithmic }, id, name, value, input, changed) {
  const slider = document.createElement("input");
  const to = logarithmic ? Math.log10 : (x) => x;
  const from = (x) => {
    const y = logarithmic ? 10 ** x : x;
    return whole ? Math.round(y) : Number(y.toPrecision(3));
  };
  [slider.type, slider.id, slider.min, slider.max] = ["range", `${id}-slider`, to(least), to(most)];
  slider.step = whole && !logarithmic ? 1 : "any";
  slider.value = to(Math.min(Math.max(value, least), most));
  slider.setAttribute("aria-label", `${name}, slider`);
  slider.addEventListener("input", () => (input.value = from(Number(slider.value))));
  slider.addEventListener("change", () => changed(from(Number(slider.value))));
  return slider;
}

/// The range of a slider for a parameter of the catalogue: four times the default, or the whole of a wide range in
/// powers of ten.
export function slider({ least, most, whole, default: usual }) {
  const logarithmic = least > 0 && most / least >= 1e4 && !whole;
  const end = logarithmic || usual <= 0 ? most : Math.min(most, 4 * usual);
  return end - least <= 0 ? null : { least, most: end, whole, logarithmic };
}

/// Replaces the fields of a form and keeps the focus.
export function replace(parent, fields) {
  const focused = parent.contains(document.activeElement) ? document.activeElement.id : null;
  parent.replaceChildren(...fields);
  if (focused) document.getElementById(focused)?.focus();
}
