// Numbers of the run: a list, the time of a step by stage as a bar, overlap and rest speed as running curves.

const STAGES = ["detect", "color", "prepare", "run", "store"];
/// Points of a curve: half a minute at ten points per second.
const LONGEST = 300;
const element = (id) => document.getElementById(id);

/// A number with three digits.
export function short(x) {
  if (!Number.isFinite(x)) return String(x);
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size < 1e-3 || size >= 1e5) return x.toExponential(1);
  return String(Number(x.toPrecision(3)));
}

/// All digits of a number.
export const plain = (x) => x.toLocaleString("en", { maximumSignificantDigits: 16 });

/// Fills a list of terms. The elements stay, so that a screen reader keeps its place.
export function list(parent, rows) {
  while (parent.children.length > 2 * rows.length) parent.lastElementChild.remove();
  while (parent.children.length < 2 * rows.length) {
    parent.append(document.createElement("dt"), document.createElement("dd"));
  }
  rows.flat().forEach((text, k) => {
    if (parent.children[k].textContent !== text) parent.children[k].textContent = text;
  });
}

/// A curve over time on a scale of powers of ten.
class Curve {
  values = [];

  constructor(id, unit, least) {
    Object.assign(this, { canvas: element(id), output: element(`${id}-now`), unit, least });
  }

  add(value) {
    this.values.push(value);
    if (this.values.length > LONGEST) this.values.shift();
    this.draw();
  }

  clear() {
    this.values = [];
    this.draw();
  }

  draw() {
    const { canvas, values, least, unit } = this;
    const last = values.at(-1);
    const text = last === undefined ? "" : `${short(last)} ${unit}`;
    this.output.value = text;
    canvas.setAttribute("aria-label", text === "" ? "No values yet" : `Now ${text}, at most ${short(Math.max(...values))} ${unit} in the last half minute`);
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (width === 0) return;
    if (canvas.width !== Math.round(width * scale)) [canvas.width, canvas.height] = [width * scale, height * scale].map(Math.round);
    const context = canvas.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    const style = getComputedStyle(canvas);
    const logs = values.map((value) => Math.log10(Math.max(value, least)));
    const high = Math.max(Math.ceil(Math.max(...logs, Math.log10(least) + 2)), Math.log10(least) + 2);
    const low = Math.max(high - 5, Math.log10(least));
    const [left, top, bottom] = [50, 6, height - 6];
    const y = (log) => bottom - ((bottom - top) * (Math.max(log, low) - low)) / (high - low);
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (let power = low; power <= high; power += 1) {
      context.strokeStyle = style.getPropertyValue("--line");
      context.beginPath();
      context.moveTo(left, y(power));
      context.lineTo(width, y(power));
      context.stroke();
      context.fillStyle = style.getPropertyValue("--quiet");
      if ((high - power) % 2 === 0 || high - low < 4) context.fillText(plain(Number(`1e${power}`)), left - 5, y(power));
    }
    context.strokeStyle = style.getPropertyValue("--accent");
    context.lineWidth = 1.8;
    context.lineJoin = "round";
    context.beginPath();
    logs.forEach((log, k) => context.lineTo(left + ((width - left) * k) / (LONGEST - 1), y(log)));
    context.stroke();
  }
}

const curves = { overlap: new Curve("overlap", "mm", 1e-4), speed: new Curve("speed", "mm/s", 1e-3) };

export const redraw = () => Object.values(curves).forEach((curve) => curve.draw());

export function restart() {
  Object.values(curves).forEach((curve) => curve.clear());
}

/// Shows the numbers of a run. `grows` is true if the run made a step since the last call.
export function show(state, grows) {
  const rows = [
    ["bodies", state.asleep > 0 ? `${state.bodies}, ${state.asleep} asleep` : `${state.bodies}`],
    ["contacts", `${state.manifolds}, ${state.points} points`],
    ["time", `${state.time.toFixed(2)} s, ${state.steps} steps`],
    ["steps a second", state.steps_a_second.toFixed(0)],
    ["pictures a second", state.fps.toFixed(0)],
    ["deepest overlap", `${short(state.overlap_max_mm)} mm`],
    ["kinetic energy", `${short(state.kinetic_energy)} J`],
  ];
  if (state.beside) rows.push(["a step on WebGPU", `${STAGES.reduce((sum, stage) => sum + state.beside.stage_ms[stage], 0).toFixed(2)} ms`]);
  list(element("numbers"), rows);
  bar(state.stage_ms);
  if (grows) {
    curves.overlap.add(state.overlap_mean_mm);
    curves.speed.add(state.speed_mm_s);
  }
}

/// The time of a step by stage.
function bar(times) {
  const total = STAGES.reduce((sum, stage) => sum + times[stage], 0);
  element("step-ms").value = `${total.toFixed(2)} ms`;
  const [parent, legend] = [element("stages"), element("legend")];
  if (parent.children.length === 0) {
    for (const stage of STAGES) {
      const part = document.createElement("span");
      part.style.background = `var(--${stage})`;
      parent.append(part);
      const item = document.createElement("li");
      item.innerHTML = `<i style="background: var(--${stage})"></i>${stage} <span></span>`;
      legend.append(item);
    }
  }
  STAGES.forEach((stage, k) => {
    parent.children[k].style.width = total > 0 ? `${(100 * times[stage]) / total}%` : "0";
    legend.children[k].lastElementChild.textContent = times[stage].toFixed(2);
  });
  parent.setAttribute("aria-label", STAGES.map((stage) => `${stage} ${times[stage].toFixed(2)} ms`).join(", "));
}
