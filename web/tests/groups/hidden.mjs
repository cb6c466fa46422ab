import { setTimeout as sleep } from "node:timers/promises";

import { Tabs } from "../tabs.mjs";

export const name = "hidden";
export const mistakes = [
  // A page that steps by a timer and not with its pictures.
  { fails: "a hidden tab does not step", script: "setInterval(() => window.drystone?.step(), 100)" },
];

export async function run({ address, script, check }) {
  const tabs = await Tabs.launch();
  try {
    const tab = await tabs.open(`${address}#scene=pile&p.n=20`, script);
    const loaded = "new Promise((done) => { const ask = () => (window.drystone ? done(window.drystone.ready) : setTimeout(ask, 50)); ask(); })";
    await tab.evaluate(loaded);
    const state = () => tab.evaluate("({ ...window.drystone.state(), is: document.visibilityState })");
    /// The state once the page has made more steps, or after ten seconds.
    const beyond = async (steps) => {
      let now;
      for (let waits = 0; waits < 100 && !((now = await state()).steps > steps); waits += 1) await sleep(100);
      return now;
    };
    const before = await beyond(0);
    check.holds("a tab in front steps", before.is === "visible" && before.steps > 0, `${before.steps} steps`);
    await tabs.open("about:blank");
    await sleep(500);
    const hidden = await state();
    await sleep(2500);
    const later = await state();
    check.equal("the tab is hidden", [hidden.is, later.is], ["hidden", "hidden"]);
    check.equal("a hidden tab does not step", later.steps, hidden.steps);
    await tab.show();
    await beyond(later.steps);
    await sleep(700);
    const again = await state();
    // Three seconds of hiding would be 180 steps.
    const [steps, more] = [again.steps - later.steps, `${again.steps - later.steps} steps`];
    check.holds("it goes on where it was, without haste", again.is === "visible" && steps > 0 && steps < 100, more);
  } finally {
    await tabs.close();
  }
}
