import { colors, state, until } from "../browser.mjs";

export const name = "lost";
export const mistakes = [
  {
    fails: "WebGL draws where devices of WebGPU are lost again and again",
    script: `
      const right = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
        return kind === "webgl2" ? null : right.call(this, kind, ...more);
      }`,
  },
  {
    fails: "a drag turns the view",
    script: `addEventListener("pointermove", (event) => event.stopImmediatePropagation(), true)`,
  },
];

/// Changes each device that an adapter gives.
const given = (change) => `
  const right = GPUAdapter.prototype.requestDevice;
  GPUAdapter.prototype.requestDevice = async function (...wanted) {
    ${change}
  };`;
const dying = given("const device = await right.apply(this, wanted); setTimeout(() => device.destroy(), 100); return device;");
const refused = given("throw new DOMException('no device on purpose', 'OperationError');");

async function draws(page, check, what) {
  const isWebGL = await until(page, ({ picture }) => picture === "WebGL");
  const { steps } = await state(page);
  const runs = await until(page, (now) => now.steps > steps + 5);
  const found = await colors(page, "#picture");
  const { picture, message } = await state(page);
  check.holds(what, isWebGL && runs && found > 100, `${found} colors, by ${picture}; ${message || "no message"}`);
}

export async function run({ open, check }) {
  const page = await open({ hash: "#scene=pile&p.n=30", script: dying });
  await draws(page, check, "WebGL draws where devices of WebGPU are lost again and again");
  const before = (await state(page)).camera.yaw;
  const box = await page.locator("#picture").boundingBox();
  await page.mouse.move(box.x + 20, box.y + 20);
  await page.mouse.down();
  await page.mouse.move(box.x + 120, box.y + 20, { steps: 4 });
  await page.mouse.up();
  check.holds("a drag turns the view", await until(page, ({ camera }) => Math.abs(camera.yaw - before) > 0.1, 5000));
  await page.evaluate(() => window.drystone.maze("easy"));
  const found = await colors(page, "#picture");
  check.holds("WebGL draws the maze", found > 100, `${found} colors`);

  await draws(await open({ hash: "#scene=pile&p.n=30", script: refused }), check, "WebGL draws where WebGPU gives no device");
}
