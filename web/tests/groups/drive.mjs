import { state, until } from "../browser.mjs";

export const name = "drive";
export const mistakes = [
  {
    fails: "W walks up the stairs",
    script: `addEventListener("keydown", (event) => event.code === "KeyW" && event.stopImmediatePropagation(), true)`,
  },
  {
    fails: "the character stands when the key is let go",
    script: `addEventListener("keyup", (event) => event.stopImmediatePropagation(), true)`,
  },
  {
    fails: "the character stands when the page loses the focus",
    script: `addEventListener("blur", (event) => event.stopImmediatePropagation(), true)`,
  },
  { fails: "the stick drives forward", touch: "touchEnd" },
];

/// Whether the driven body stands still, after time for what it still does.
async function stands(page) {
  await until(page, ((first) => ({ steps }) => steps > first + 5)((await state(page)).steps));
  const before = await state(page);
  await until(page, ({ steps }) => steps > before.steps + 5);
  return Math.hypot(...(await state(page)).driven.at.map((x, k) => x - before.driven.at[k])) < 0.01;
}

const place = async (page) => `at ${(await state(page)).driven.at.map((x) => x.toFixed(2))} m`;

async function walks(page, check) {
  await page.focus("#picture");
  const start = await state(page);
  check.holds("without a key the character stands", Math.abs(start.driven.at[0]) < 1e-6, await place(page));
  await page.keyboard.down("w");
  const climbs = await until(page, ({ driven }) => driven.at[0] > 2.5 && driven.at[1] > 1.2);
  check.holds("W walks up the stairs", climbs, await place(page));
  await page.keyboard.up("w");
  check.holds("the character stands when the key is let go", await stands(page), await place(page));
  const { camera, driven } = await state(page);
  const apart = Math.hypot(...camera.target.map((x, k) => x - driven.at[k]));
  check.holds("the camera follows", apart < 0.5 && camera.distance < start.camera.distance, `${apart.toFixed(2)} m from the character`);
  await page.keyboard.press(" ");
  const jumps = await until(page, (now) => now.driven.at[1] > driven.at[1] + 0.3, 10_000);
  check.holds("Space jumps", jumps && !(await state(page)).paused, await place(page));
  await page.keyboard.down("ArrowRight");
  const turns = await until(page, ({ driven }) => driven.ahead[2] > 0.3, 10_000);
  await page.keyboard.up("ArrowRight");
  check.holds("the right arrow turns right", turns, `ahead ${(await state(page)).driven.ahead.map((x) => x.toFixed(2))}`);
  await page.keyboard.down("s");
  await page.evaluate(() => dispatchEvent(new Event("blur")));
  check.holds("the character stands when the page loses the focus", await stands(page), await place(page));
  await page.keyboard.up("s");
  await page.keyboard.press("p");
  check.holds("P pauses", await until(page, ({ paused }) => paused, 5000));
  check.equal("the page names the keys", await page.isVisible('#panel p[data-of="character"]'), true);
}

async function drives(page, check) {
  await page.keyboard.down("ArrowUp");
  const goes = await until(page, ({ driven }) => driven.at[0] > 3);
  check.holds("the arrow up drives forward", goes, await place(page));
  await page.keyboard.down("ArrowLeft");
  const turns = await until(page, ({ driven }) => driven.ahead[2] < -0.3);
  check.holds("the left arrow turns left", turns, `ahead ${(await state(page)).driven.ahead.map((x) => x.toFixed(2))}`);
  await page.keyboard.up("ArrowLeft");
  await page.keyboard.up("ArrowUp");
}

export async function run({ open, check, touch = "touchStart" }) {
  await walks(await open({ hash: "#scene=course" }), check);
  const page = await open({ hash: "#scene=stack" });
  check.equal("other scenes have no driver", (await state(page)).driven, null);
  await page.click("#gallery");
  await page.locator("#cards button", { has: page.locator('strong:text-is("vehicle")') }).click();
  await until(page, ({ scene }) => scene === "vehicle");
  // The picture gets the focus when the scene is open.
  await page.waitForFunction(() => document.activeElement.id === "picture");
  await drives(page, check);

  const phone = await open({ hash: "#scene=course", viewport: { width: 390, height: 780 }, isMobile: true, hasTouch: true });
  const box = await phone.locator("#stick").boundingBox();
  const finger = await phone.context().newCDPSession(phone);
  const send = (type, touchPoints) => finger.send("Input.dispatchTouchEvent", { type, touchPoints });
  await send(touch, touch === "touchEnd" ? [] : [{ x: box.x + 0.5 * box.width, y: box.y + 0.1 * box.height }]);
  const goes = await until(phone, ({ driven }) => driven.at[0] > 1, 10_000);
  check.holds("the stick drives forward", goes, await place(phone));
  await send("touchEnd", []);
  check.holds("the character stands when the finger lifts", await stands(phone), await place(phone));
  const { driven } = await state(phone);
  await phone.tap("#jump");
  check.holds("the button jumps", await until(phone, (now) => now.driven.at[1] > driven.at[1] + 0.3, 10_000), await place(phone));
}
