// Measures how fast this device steps a pile, and stores the size of the largest pile in real time.
import { Bare } from "./drystone_web.js";

const KEY = "drystone.device.1";
/// Boxes of the measured pile, steps until it is dense, and timed steps.
const [BOXES, BEFORE, TIMED] = [100, 25, 15];
/// Time for a step, out of the 16.7 ms between two pictures (ms).
const WANTED = 7;

/// The last measurement; null before the first visit, or if the browser stores nothing.
export function known() {
  try {
    const device = JSON.parse(localStorage.getItem(KEY));
    return Number.isInteger(device?.boxes) && device.ms > 0 ? device : null;
  } catch {
    return null;
  }
}

/// Measures for a fraction of a second.
export async function measure() {
  const pile = new Bare(Bare.pile(BOXES), "{}");
  await pile.steps(BEFORE);
  const began = performance.now();
  await pile.steps(TIMED);
  const ms = Math.max((performance.now() - began) / TIMED, 0.01);
  pile.free();
  // Two digits, so that the number is easy to read.
  const boxes = (BOXES * WANTED) / ms;
  const digit = 10 ** Math.max(Math.floor(Math.log10(boxes)) - 1, 0);
  const device = { boxes: Math.min(Math.max(Math.round(boxes / digit) * digit, 20), 4000), ms: (ms * 1000) / BOXES };
  try {
    localStorage.setItem(KEY, JSON.stringify(device));
  } catch {
    // If the browser stores nothing, every visit measures again.
  }
  return device;
}
