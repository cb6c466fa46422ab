import { colors, state, until } from "../browser.mjs";

export const name = "loading";
export const mistakes = [
  { fails: "nothing is loaded from elsewhere", script: `fetch("http://127.0.0.1:9/").catch(() => {})` },
  { fails: "the console stays silent", script: `addEventListener("load", () => console.error("a mistake on purpose"))` },
  { fails: "a picture is drawn", script: `addEventListener("load", () => (document.getElementById("stage").style.opacity = 0))` },
];

export async function run({ open, check }) {
  const page = await open();
  const first = await page.evaluate(() => performance.now());
  check.holds("the page runs", await until(page, ({ steps }) => steps > 2), `first picture after ${(first / 1000).toFixed(1)} s`);
  const { picture, bodies } = await state(page);
  const found = await colors(page, "#stage");
  check.holds("a picture is drawn", found > 100, `${found} colors, ${bodies} bodies, by ${picture}`);
  await page.click("#play");
  const { steps } = await state(page);
  await page.waitForTimeout(300);
  check.equal("a pause stops the steps", (await state(page)).steps, steps);
  await page.click("#step");
  check.holds("one step is one step", await until(page, (now) => now.steps === steps + 1));
  check.equal("nothing is loaded from elsewhere", page.elsewhere, []);
}
