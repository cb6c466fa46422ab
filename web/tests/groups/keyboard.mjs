import { state, until } from "../browser.mjs";

export const name = "keyboard";
export const mistakes = [
  { fails: "Tab reaches every control", script: `addEventListener("load", () => (document.getElementById("save-scene").tabIndex = -1))` },
  {
    fails: "the focus is seen on every control",
    script: `addEventListener("load", () => document.head.insertAdjacentHTML("beforeend", "<style>#restart:focus-visible { outline: none }</style>"))`,
  },
];

/// Every control that can be seen and used, and one of each group of radio buttons: the arrows reach the others.
const controls = (page) =>
  page.evaluate(() => {
    const all = [...document.querySelectorAll("a[href], button, select, input, summary, [contenteditable], canvas[role=application]")];
    const usable = all.filter((e) => e.checkVisibility() && !e.disabled && e.type !== "file");
    const groups = new Set();
    usable.forEach((e) => (e.dataset.control = e.type === "radio" ? `radio ${e.name}` : e.id || e.textContent.trim()));
    usable.forEach((e) => groups.add(e.dataset.control));
    return [...groups].sort();
  });

/// The controls in the order in which Tab reaches them, and those whose focus is not seen.
async function walk(page, most) {
  const [reached, unseen] = [new Set(), new Set()];
  await page.evaluate(() => document.activeElement?.blur());
  for (let presses = 0; presses < most; presses += 1) {
    await page.keyboard.press("Tab");
    const [control, isSeen] = await page.evaluate(() => {
      const at = document.activeElement;
      // The look of a radio button is that of the text beside it.
      const looks = [at, at?.nextElementSibling].filter(Boolean).map((e) => getComputedStyle(e));
      const outlined = looks.some((look) => look.outlineStyle !== "none" && parseFloat(look.outlineWidth) >= 2);
      return [at?.dataset?.control ?? null, outlined || at?.id === "panel"];
    });
    if (control === null) continue;
    reached.add(control);
    if (!isSeen) unseen.add(control);
  }
  return { reached: [...reached].sort(), unseen: [...unseen] };
}

export async function run({ open, check }) {
  const page = await open({ hash: "#scene=tower" });
  const all = await controls(page);
  const { reached, unseen } = await walk(page, 2 * all.length);
  check.equal("Tab reaches every control", all.filter((control) => !reached.includes(control)), []);
  check.equal("the focus is seen on every control", unseen, []);
  check.holds("there are controls to reach", all.length > 20, `${all.length} controls`);
  const unnamed = await page.evaluate(() =>
    [...document.querySelectorAll("button, select, input, canvas")]
      .filter((e) => e.checkVisibility() && !(e.getAttribute("aria-label") || e.labels?.[0]?.textContent.trim() || e.textContent.trim()))
      .map((e) => e.outerHTML),
  );
  check.equal("every control has a name", unnamed, []);

  await page.focus("#picture");
  await page.keyboard.press(" ");
  check.holds("the space bar pauses", await until(page, ({ paused }) => paused, 5000));
  const { steps, bodies } = await state(page);
  await page.keyboard.press("n");
  check.holds("N makes one step", await until(page, (now) => now.steps === steps + 1, 10_000));
  await page.keyboard.press("b");
  check.holds("B throws a body", await until(page, (now) => now.bodies === bodies + 1, 10_000), `${(await state(page)).bodies}`);
  await page.keyboard.press("r");
  check.holds("R restarts", await until(page, (now) => now.bodies === bodies && now.steps < steps + 1, 10_000));
  await page.selectOption("#preset", "fast");
  check.holds("a preset is chosen", await until(page, ({ settings }) => settings.preset === "fast", 5000));
  await page.fill("#setting-substeps", "0");
  await page.keyboard.press("Enter");
  const refused = await until(page, ({ message }) => message.includes("substeps"), 5000);
  check.holds("a setting beyond its range is refused in one line", refused, (await state(page)).message);
}
