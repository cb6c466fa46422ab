// A headless Chromium, and pages in it whose console is heard.
/// WebGPU by SwiftShader. A canvas of WebGPU loses its device where the compositor is not on Vulkan too.
export const WEBGPU = ["--enable-unsafe-webgpu", "--enable-features=Vulkan", "--use-vulkan=swiftshader", "--use-angle=swiftshader"];

/// What Chromium itself says where it has no adapter for WebGPU and a page asks for one, and where software draws a canvas of WebGL.
const OF_CHROMIUM = /^No available adapters\.$|^Failed to create WebGPU Context Provider$|GL Driver Message .*Performance.*ReadPixels/;
/// The browser's message where a test sets the tilt of the device.
const OF_TILTS = /^A reload is required so that the existing .*Sensor/;

export class Browser {
  running = new Map();

  constructor(address) {
    this.address = address;
  }

  /// A browser with WebGPU, or one without. Software draws and computes: SwiftShader, which Chromium brings along.
  async launched(webgpu) {
    // A new one also where the last one has crashed.
    if (!this.running.get(webgpu)?.isConnected()) {
      const { chromium } = await import("playwright-core");
      const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
      const args = ["--no-sandbox", ...(webgpu ? WEBGPU : ["--enable-unsafe-swiftshader"])];
      this.running.set(webgpu, await chromium.launch({ executablePath, args }));
    }
    return this.running.get(webgpu);
  }

  /// Opens the page in a profile of its own. `script` runs in it before any other. The result has `said`, the lines of the console and
  /// the requests that failed, and `elsewhere`, the requests to other servers.
  async open({ webgpu = true, path = "", hash = "", script = null, wait = true, ...context } = {}) {
    const profile = await (await this.launched(webgpu)).newContext({ viewport: { width: 1100, height: 720 }, ...context });
    const page = await profile.newPage();
    const [said, elsewhere] = [[], []];
    page.on("console", (message) => {
      if (OF_TILTS.test(message.text()) || (!webgpu && OF_CHROMIUM.test(message.text()))) return;
      said.push(`${message.type()}: ${message.text()}`);
    });
    page.on("pageerror", (error) => said.push(`error: ${error.message}`));
    page.on("requestfailed", (request) => said.push(`failed: ${request.url()}`));
    page.on("response", (response) => response.status() >= 400 && said.push(`${response.status()}: ${response.url()}`));
    page.on("request", (request) => {
      const url = request.url();
      if (!url.startsWith(this.address) && !/^(data|blob):/.test(url)) elsewhere.push(url);
    });
    page.setDefaultTimeout(60_000);
    if (script) await page.addInitScript(script);
    await page.goto(this.address + path + hash);
    if (wait) await page.evaluate(() => window.drystone.ready);
    return Object.assign(page, { said, elsewhere });
  }

  async close() {
    for (const browser of this.running.values()) await browser.close();
  }
}

export const state = (page) => page.evaluate(() => window.drystone.state());

/// Waits until a condition on the state holds; false if it does not within a time (ms).
export async function until(page, condition, milliseconds = 30_000) {
  const end = Date.now() + milliseconds;
  do {
    if (condition(await state(page))) return true;
    await page.waitForTimeout(50);
  } while (Date.now() < end);
  return false;
}

/// How many colors a part of the page has in a screenshot; one if nothing is drawn there.
export async function colors(page, selector) {
  const png = (await page.locator(selector).screenshot()).toString("base64");
  return page.evaluate(async (png) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
    context.drawImage(image, 0, 0);
    return new Set(new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer)).size;
  }, png);
}

/// A script that changes what the page offers to tests, for mistakes on purpose: the body of a function of `drystone`.
export const meddle = (body) => `
  let real;
  Object.defineProperty(window, "drystone", {
    configurable: true,
    get: () => real,
    set: (drystone) => { ${body}; real = drystone; },
  });`;
