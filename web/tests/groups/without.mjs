import { colors, state, until } from "../browser.mjs";
import { hashAfter } from "../native.mjs";

export const name = "without";
export const mistakes = [{ fails: "the page says that there is no WebGPU", profile: { webgpu: true } }];

export async function run({ open, check }) {
  const page = await open({ webgpu: false, hash: "#scene=pile&p.n=30" });
  const says = await page.locator("body").innerText();
  check.holds("the page says that there is no WebGPU", /no WebGPU/i.test(says), says.match(/[^\n]*WebGPU[^\n]*/g)?.join(" | "));
  check.equal("WebGPU cannot be chosen", await page.locator('input[value="webgpu"]').isDisabled(), true);
  check.holds("the scene runs on the CPU", await until(page, ({ steps }) => steps > 5));
  const found = await colors(page, "#picture");
  check.holds("a picture is drawn", found > 100, `${found} colors, by ${(await state(page)).picture}`);
  const hash = await page.evaluate(() => window.drystone.hash_after("pile", { n: 30 }, 60));
  check.equal("the hash is that of the native program", hash, await hashAfter("pile", { n: 30 }, 60));
  const linked = await open({ webgpu: false, hash: "#scene=pile&p.n=30&backend=webgpu" });
  const runs = await until(linked, ({ steps }) => steps > 0);
  const { message } = await state(linked);
  check.holds("a link that asks for WebGPU is refused in one line", runs && /WebGPU/.test(message) && !message.includes("\n"), message);
}
