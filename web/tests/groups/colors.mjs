export const name = "colors";
export const mistakes = [
  {
    fails: "dark: text stands out from its ground",
    script: `addEventListener("load", () => document.head.insertAdjacentHTML("beforeend", "<style>#summary { color: #303030 }</style>"))`,
  },
  {
    fails: "dark: the ground is dark",
    script: `addEventListener("load", () => document.head.insertAdjacentHTML("beforeend", "<style>body, #panel { background: #fff }</style>"))`,
  },
];

/// Luminance of the ground, and text whose contrast is below 4.5 (WCAG 2.2, 1.4.3).
const look = (page) =>
  page.evaluate(() => {
    const parse = (color) => {
      const [r, g, b, a = 1] = color.match(/[\d.]+/g).map(Number);
      return [r, g, b, a];
    };
    const over = ([r, g, b, a], under) => [...[r, g, b].map((x, k) => x * a + under[k] * (1 - a)), 1];
    const ground = (element) => {
      if (element === null) return [255, 255, 255, 1];
      const own = parse(getComputedStyle(element).backgroundColor);
      return own[3] === 1 ? own : over(own, ground(element.parentElement));
    };
    const luminance = ([r, g, b]) => {
      const linear = [r, g, b].map((x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4));
      return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
    };
    const poor = [];
    for (const element of document.querySelectorAll("body *")) {
      const hasText = [...element.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.textContent.trim() !== "");
      if (!hasText || !element.checkVisibility() || element.disabled || element.closest(":disabled, label:has(:disabled), option, .skip")) continue;
      const under = ground(element);
      const [a, b] = [luminance(over(parse(getComputedStyle(element).color), under)), luminance(under)];
      const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
      if (contrast < 4.5) poor.push(`${element.id || element.tagName} ${contrast.toFixed(1)}`);
    }
    return { ground: luminance(ground(document.getElementById("panel"))), poor };
  });

export async function run({ open, check }) {
  for (const colorScheme of ["light", "dark"]) {
    const page = await open({ hash: "#scene=stack", colorScheme });
    const { ground, poor } = await look(page);
    check.holds(`${colorScheme}: the ground is ${colorScheme}`, colorScheme === "dark" ? ground < 0.1 : ground > 0.7, `luminance ${ground.toFixed(2)}`);
    check.equal(`${colorScheme}: text stands out from its ground`, poor, []);
  }
}
