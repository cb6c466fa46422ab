import { state, until } from "../browser.mjs";

export const name = "phone";
export const mistakes = [
  {
    fails: "320 pixels, scenes: nothing is wider than the phone",
    script: `addEventListener("load", () => document.getElementById("panel").insertAdjacentHTML("beforeend", "<div style='width: 900px'>wide</div>"))`,
  },
  {
    fails: "320 pixels: two fingers that part bring the scene nearer",
    script: `addEventListener("pointermove", (event) => event.stopImmediatePropagation(), true)`,
  },
  {
    fails: "320 pixels: the phone tilts the board to the right",
    // The test waits for the tilt that it felt; the board does not feel it.
    script: `addEventListener("deviceorientation", (event) => ((window.felt = event), event.stopImmediatePropagation()))`,
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

/// Moves fingers on the picture, each on a way from one place to another, 0 to 1 from left to right and from top to bottom.
async function fingers(page, touch, ways) {
  const box = await page.locator("#picture").boundingBox();
  const send = (type, touchPoints) => touch.send("Input.dispatchTouchEvent", { type, touchPoints });
  const at = (share) =>
    ways.map(([from, to], id) => {
      const [x, y] = from.map((a, k) => a + share * (to[k] - a));
      return { id, x: box.x + x * box.width, y: box.y + y * box.height };
    });
  for (let down = 1; down <= ways.length; down += 1) {
    await send("touchStart", at(0).slice(0, down));
    // The page asks the solver for a body below the finger.
    await page.evaluate(() => window.drystone.pause(true));
  }
  for (let move = 1; move <= 10; move += 1) await send("touchMove", at(move / 10));
  await send("touchEnd", []);
}

/// One finger turns the view, two move it and bring it nearer.
async function gestures(page, touch, check, width) {
  const camera = async () => (await state(page)).camera;
  const length = (a, b) => Math.hypot(...a.map((x, k) => x - b[k]));
  const was = await camera();
  await fingers(page, touch, [[[0.05, 0.05], [0.35, 0.05]]]);
  const turns = await until(page, ({ camera }) => Math.abs(camera.yaw - was.yaw) > 0.1, 5000);
  const turned = await camera();
  check.holds(`${width} pixels: a finger turns the view`, turns, `${was.yaw.toFixed(2)} to ${turned.yaw.toFixed(2)}`);

  await fingers(page, touch, [[[0.4, 0.5], [0.3, 0.5]], [[0.6, 0.5], [0.7, 0.5]]]);
  // Twice as far from each other: half the distance.
  const nears = await until(page, ({ camera }) => Math.abs(camera.distance / turned.distance - 0.5) < 0.01, 5000);
  const near = await camera();
  check.holds(`${width} pixels: two fingers that part bring the scene nearer`, nears, `${(near.distance / turned.distance).toFixed(3)} of the distance`);

  await fingers(page, touch, [[[0.4, 0.4], [0.4, 0.6]], [[0.6, 0.4], [0.6, 0.6]]]);
  const moves = await until(page, ({ camera }) => length(camera.target, near.target) > 0.1 * near.distance, 5000);
  const moved = await camera();
  check.holds(`${width} pixels: two fingers move the view`, moves, `by ${length(moved.target, near.target).toFixed(2)} m`);
  check.holds(`${width} pixels: two fingers beside each other leave distance and direction`, Math.abs(moved.distance / near.distance - 1) < 0.02 && moved.yaw === near.yaw, `${(moved.distance / near.distance).toFixed(3)} of the distance`);
}

/// The tilt of the phone, upright and on its side.
async function leaning(page, touch, check, width) {
  const lean = async (beta, gamma) => {
    await touch.send("DeviceOrientation.setDeviceOrientationOverride", { alpha: 0, beta, gamma });
    await page.waitForFunction(([beta, gamma]) => window.felt?.beta === beta && window.felt?.gamma === gamma, [beta, gamma]);
  };
  const tilts = async (what, axis) => {
    const found = await until(page, ({ maze }) => maze?.tilt[axis] > 1 && Math.abs(maze.tilt[1 - axis]) < 0.5, 10_000);
    check.holds(`${width} pixels: ${what}`, found, `${(await state(page)).maze?.tilt} degrees`);
  };
  await page.evaluate(() => addEventListener("deviceorientation", (event) => (window.felt = event), true));
  await page.tap("#tilt");
  // As the phone is held.
  await lean(40, 0);
  await page.tap("#restart");
  await lean(40, 20);
  await tilts("the phone tilts the board to the right", 0);
  await page.tap("#restart");
  await lean(60, 0);
  await tilts("the phone tilts the board to the front", 1);
  await page.setViewportSize({ width: 780, height: width });
  await page.tap("#restart");
  await lean(20, -40);
  await tilts("a phone on its side tilts the board to the right", 0);
}

export async function run({ open, check }) {
  for (const width of [320, 390]) {
    const page = await open({ hash: "#scene=stack", viewport: { width, height: 780 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 });
    check.equal(`${width} pixels, scenes: nothing is wider than the phone`, await wide(page), []);
    // Paused before the first step, for which software would compile shaders.
    const on = (backend) => page.evaluate((backend) => Promise.all([window.drystone.backend(backend), window.drystone.pause(true)]), backend);
    await on("both");
    check.equal(`${width} pixels, CPU and WebGPU: nothing is wider than the phone`, await wide(page), []);
    await on("cpu");
    await page.evaluate(() => window.drystone.pause(false));
    await page.tap("#gallery");
    check.equal(`${width} pixels, gallery: nothing is wider than the phone`, await wide(page), []);
    await page.keyboard.press("Escape");
    const small = await page.locator("#tools button:visible, #tools label:visible").evaluateAll((all) =>
      all.filter((e) => e.getBoundingClientRect().height < 24).map((e) => e.id || e.textContent),
    );
    check.equal(`${width} pixels: a finger hits the tools`, small, []);
    await page.tap("#play");
    check.holds(`${width} pixels: a tap pauses`, await until(page, ({ paused }) => paused, 5000));
    const touch = await page.context().newCDPSession(page);
    await gestures(page, touch, check, width);
    await page.tap("#tab-maze");
    await until(page, ({ maze }) => maze !== null, 10_000);
    check.equal(`${width} pixels, maze: nothing is wider than the phone`, await wide(page), []);
    const box = await page.locator("#picture").boundingBox();
    check.holds(`${width} pixels: the picture has a third of the screen`, box.height > 780 / 3, `${box.width} x ${box.height}`);
    const at = { x: box.x + 0.9 * box.width, y: box.y + 0.5 * box.height };
    await touch.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [at] });
    const tilts = await until(page, ({ maze }) => maze?.tilt[0] > 1, 10_000);
    await touch.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
    check.holds(`${width} pixels: a finger tilts the board`, tilts, `${(await state(page)).maze?.tilt} degrees`);
    await leaning(page, touch, check, width);
  }
}
