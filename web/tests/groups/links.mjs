import { state, until } from "../browser.mjs";

export const name = "links";
export const mistakes = [
  { fails: "a link restores scene, parameters and settings", script: `history.replaceState(null, "", location.pathname)` },
];

export async function run({ open, check }) {
  const first = await open();
  await first.evaluate(() => window.drystone.open("tower", { n: 7 }, { preset: "fast", relax: 2 }));
  const [link, was] = [new URL(first.url()), await state(first)];
  check.equal("the page runs what it was asked for", [was.scene, was.parameters, was.settings], ["tower", { n: 7 }, { preset: "fast", relax: 2 }]);

  const page = await open({ hash: link.hash });
  const is = await state(page);
  const told = ({ scene, parameters, settings, bodies }) => {
    const numbers = Object.fromEntries(Object.entries(parameters).map(([name, value]) => [name, Number(value)]));
    return { scene, parameters: numbers, settings, bodies };
  };
  check.equal("a link restores scene, parameters and settings", told(is), told(was));
  check.equal("the controls show them", [await page.inputValue("#preset"), await page.inputValue("#setting-relax")], ["fast", "2"]);

  for (const [hash, named] of [
    ["#scene=nothing", "nothing"],
    ["#scene=tower&p.n=-3", "n"],
    ["#scene=tower&p.height=3", "height"],
    ["#scene=tower&s.substeps=0", "substeps"],
    ["#maze=none", "none"],
    ["#word=1", "word"],
    ["#scene=tower&exact=maybe", "exact"],
  ]) {
    const bad = await open({ hash });
    const { message } = await state(bad);
    const runs = await until(bad, ({ steps }) => steps > 0, 10_000);
    check.holds(`${hash} is refused in one line, and the page runs`, runs && message.includes(named) && !message.includes("\n"), message);
  }
}
