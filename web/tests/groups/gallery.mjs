import { colors, meddle, state, until } from "../browser.mjs";
import { drystone } from "../native.mjs";

export const name = "gallery";
export const mistakes = [
  { fails: "wall steps", script: meddle("const right = drystone.state; drystone.state = () => ({ ...right(), steps: 0 })"), only: ["wall"] },
  {
    fails: "the gallery has the scenes of the catalogue",
    script: `addEventListener("click", () => document.querySelector("#cards li")?.remove())`,
    only: ["wall"],
  },
];

export async function run({ open, check, only = null }) {
  const page = await open({ hash: "#scene=stack" });
  const { scenes } = await drystone("scenes");
  const names = scenes.map((scene) => scene.name);
  await page.click("#gallery");
  check.equal("the gallery has the scenes of the catalogue", await page.locator("#cards strong").allTextContents(), names);
  await page.keyboard.press("Escape");
  for (const scene of only ?? names) {
    await page.click("#gallery");
    await page.locator("#cards button", { has: page.locator(`strong:text-is("${scene}")`) }).click();
    const runs = await until(page, (now) => now.scene === scene && now.steps >= 5, only ? 3000 : 60_000);
    const { bodies, message, steps } = await state(page);
    check.holds(`${scene} steps`, runs && message === "", runs ? `${bodies} bodies` : `${steps} steps; ${message}`);
    const found = await colors(page, "#picture");
    if (found < 20) check.holds(`${scene} is drawn`, false, `${found} colors`);
  }
  const pictures = await page.locator("#cards img").evaluateAll(async (images) => {
    images.forEach((image) => (image.loading = "eager"));
    await Promise.all(images.map((image) => image.decode().catch(() => {})));
    return images.filter((image) => image.naturalWidth === 0).map((image) => image.src);
  });
  check.equal("every card has its picture", pictures, []);
}
