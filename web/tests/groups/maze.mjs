import { colors, state, until } from "../browser.mjs";

export const name = "maze";
export const mistakes = [
  {
    fails: "an arrow key tilts the board",
    script: `addEventListener("keydown", (event) => event.key.startsWith("Arrow") && event.stopImmediatePropagation(), true)`,
  },
];

export async function run({ open, check }) {
  const page = await open({ hash: "#scene=stack" });
  await page.focus("#tab-maze");
  await page.keyboard.press("Enter");
  check.holds("Enter on its button opens the maze", await until(page, ({ maze }) => maze !== null, 10_000));
  await page.focus("#picture");
  const before = (await state(page)).maze;
  await page.keyboard.down("ArrowRight");
  const tilts = await until(page, ({ maze }) => maze?.tilt[0] > 1, 10_000);
  check.holds("an arrow key tilts the board", tilts, `${(await state(page)).maze?.tilt} degrees`);
  const moves = await until(page, ({ maze }) => maze?.time > (before?.time ?? 0) + 0.2, 10_000);
  await page.keyboard.up("ArrowRight");
  check.holds("the clock runs while the ball rolls", moves, `${(await state(page)).maze?.time} s`);
  const level = await until(page, ({ maze }) => Math.abs(maze?.tilt[0]) < 0.2 || maze?.outcome, 10_000);
  check.holds("the board comes back when the key is let go", level, `${(await state(page)).maze?.tilt} degrees`);
  const found = await colors(page, "#picture");
  check.holds("the maze is drawn", found > 100, `${found} colors`);
  await page.keyboard.press("r");
  check.holds("R restarts", await until(page, ({ maze }) => maze?.time < 0.1, 10_000), `${(await state(page)).maze?.time} s`);
  const boards = await page.locator("#board option").allTextContents();
  for (const board of boards) {
    await page.selectOption("#board", board);
    const opened = await until(page, ({ maze }) => maze?.board === board, 10_000);
    const { message } = await state(page);
    check.holds(`the board ${board} opens`, opened && message === "", message);
  }
  await page.focus("#tab-gallery");
  await page.keyboard.press("Enter");
  check.holds("Enter goes back to the scenes", await until(page, ({ maze, steps }) => maze === null && steps > 0, 10_000));
}
