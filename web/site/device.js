// Measures how fast this device steps a pile, and keeps the size of the pile that it bears.
import { Bare } from "./drystone_web.js";

const KEY = "drystone.device.1";
/// Boxes of the pile that is measured, steps until it is dense, and steps that are timed.
const [BOXES, BEFORE, TIMED] = [100, 25, 15];
/// Time that a step may take, of the 16.7 ms between two pictures (ms).
const WANTED = 7;

/// What was measured before; null before the first visit, or where the browser keeps nothing.
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
  // Two digits, so that the number reads well.
  const boxes = (BOXES * WANTED) / ms;
  const digit = 10 ** Math.max(Math.floor(Math.log10(boxes)) - 1, 0);
  const device = { boxes: Math.min(Math.max(Math.round(boxes / digit) * digit, 20), 4000), ms: (ms * 1000) / BOXES };
  try {
    localStorage.setItem(KEY, JSON.stringify(device));
  } catch {
    // A browser that keeps nothing measures on every visit.
  }
  return device;
}
