// The maze: wanted tilts of the board by arrow keys, by a press on the picture, or by the tilt of a phone.
import { list } from "./numbers.js";

const element = (id) => document.getElementById(id);
const ARROWS = { ArrowLeft: 0, ArrowRight: 1, ArrowUp: 2, ArrowDown: 3 };
/// Tilt of the phone at which the board reaches its largest tilt (degrees).
const FULL = 25;

export class Tilts {
  held = [false, false, false, false];
  pressed = null;
  /// The tilt of the phone at the start, and its tilt now (degrees).
  level = null;
  now = null;

  constructor() {
    const change = (down) => (event) => {
      const arrow = ARROWS[event.key];
      if (arrow === undefined || !this.listens?.() || event.target.matches("input, select, textarea")) return;
      this.held[arrow] = down;
      event.preventDefault();
    };
    addEventListener("keydown", change(true));
    addEventListener("keyup", change(false));
    addEventListener("blur", () => this.held.fill(false));
  }

  /// Wanted tilts to the right and to the front, -1 to 1.
  wanted() {
    if (this.pressed) return [this.pressed[0], -this.pressed[1]].map((x) => Math.max(-1, Math.min(1, 1.5 * x)));
    const arrows = [this.held[1] - this.held[0], this.held[3] - this.held[2]];
    if (arrows[0] !== 0 || arrows[1] !== 0 || !this.now) return arrows;
    return [0, 1].map((k) => Math.max(-1, Math.min(1, (this.now[k] - this.level[k]) / FULL)));
  }

  /// Listens to the tilt of the device. An Apple phone first asks its user.
  async follow() {
    const { DeviceOrientationEvent } = window;
    if (typeof DeviceOrientationEvent?.requestPermission === "function") {
      const answer = await DeviceOrientationEvent.requestPermission();
      if (answer !== "granted") throw new Error("this device does not report its tilt: the permission was not given");
    }
    this.level = this.now = null;
    addEventListener("deviceorientation", ({ beta, gamma }) => {
      if (beta === null || gamma === null) return;
      // Converts from the axes of the phone to those of the screen.
      const turned = { 0: [gamma, beta], 90: [beta, -gamma], 180: [-gamma, -beta], 270: [-beta, gamma] };
      this.now = turned[screen.orientation?.angle ?? 0] ?? [gamma, beta];
      this.level ??= this.now;
    });
  }
}

/// Whether this device can report its tilt.
export const hasTilt = () => "DeviceOrientationEvent" in window && matchMedia("(pointer: coarse)").matches;

const BEST = "drystone.maze.1.";

/// The best time on a board (s); null without one.
function best(board) {
  try {
    return Number(localStorage.getItem(BEST + board)) || null;
  } catch {
    return null;
  }
}

export function show(state) {
  let record = best(state.board);
  if (state.outcome === "goal" && (record === null || state.time < record)) {
    record = state.time;
    try {
      localStorage.setItem(BEST + state.board, String(record));
    } catch {
      // A browser that stores nothing keeps no record.
    }
  }
  const said = {
    goal: "Won. Restart plays again.",
    hole: "Lost: the ball fell into a hole. Restart plays again.",
    time: "Time is up.",
  };
  const line = said[state.outcome] ?? (state.time > 0 ? "The clock is running." : "The clock starts with the first tilt.");
  if (element("maze-state").textContent !== line) element("maze-state").textContent = line;
  const degrees = (x) => `${x.toFixed(1)}°`;
  list(element("maze-numbers"), [
    ["time", `${state.time.toFixed(2)} s`],
    ["best", record === null ? "none yet" : `${record.toFixed(2)} s`],
    ["tilt to the right", degrees(state.tilt[0])],
    ["tilt to the front", degrees(state.tilt[1])],
  ]);
}
