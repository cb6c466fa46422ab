import { state, until } from "../browser.mjs";

export const name = "phone";
export const mistakes = [
  {
    fails: "320 pixels, scenes: nothing is wider than the phone",
    script: `addEventListener("load", () => document.getElementById("panel").insertAdjacentHTML("beforeend", "<div style='width: 900px'>wide</div>"))`,
  },
];

/// What reaches beyond the sides, and whether the page scrolls sideways.
const wide = (page) =>
  page.evaluate(() => {
    const isSeen = (element) => element.checkVisibility() && !element.closest(".hidden, .skip, #loading");
    const found = [...document.querySelectorAll("body *")].filter((element) => {
      const { left, right, width } = element.getBoundingClientRect();
      return isSeen(element) && width > 0 && (right > innerWidth + 1 || left < -1);
    });
    const scrolls = [...document.querySelectorAll("html, body, #panel, #stage, dialog[open]")].filter((e) => e.scrollWidth > e.clientWidth + 1);
    return [...found, ...scrolls].map((e) => e.id || e.className || e.tagName);
  });

export async function run({ open, check }) {
  for (const width of [320, 390]) {
    const page = await open({ hash: "#scene=stack", viewport: { width, height: 780 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 });
    check.equal(`${width} pixels, scenes: nothing is wider than the phone`, await wide(page), []);
    await page.tap("#gallery");
    check.equal(`${width} pixels, gallery: nothing is wider than the phone`, await wide(page), []);
    await page.keyboard.press("Escape");
    const small = await page.locator("#tools button:visible, #tools label:visible").evaluateAll((all) =>
      all.filter((e) => e.getBoundingClientRect().height < 24).map((e) => e.id || e.textContent),
    );
    check.equal(`${width} pixels: a finger hits the tools`, small, []);
    await page.tap("#play");
    check.holds(`${width} pixels: a tap pauses`, await until(page, ({ paused }) => paused, 5000));
    await page.tap("#tab-maze");
    await until(page, ({ maze }) => maze !== null, 10_000);
    check.equal(`${width} pixels, maze: nothing is wider than the phone`, await wide(page), []);
    const box = await page.locator("#picture").boundingBox();
    check.holds(`${width} pixels: the picture has a third of the screen`, box.height > 780 / 3, `${box.width} x ${box.height}`);
    const touch = await page.context().newCDPSession(page);
    const at = { x: box.x + 0.9 * box.width, y: box.y + 0.5 * box.height };
    await touch.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [at] });
    const tilts = await until(page, ({ maze }) => maze?.tilt[0] > 1, 10_000);
    await touch.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
    check.holds(`${width} pixels: a finger tilts the board`, tilts, `${(await state(page)).maze?.tilt} degrees`);
  }
}
