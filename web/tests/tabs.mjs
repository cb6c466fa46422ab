// Tabs of a Chromium that are really hidden when another is in front: Playwright keeps all of its pages visible.
import { spawn } from "node:child_process";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { WEBGPU } from "./browser.mjs";

export class Tabs {
  waiting = new Map();
  text = "";

  static async launch() {
    const tabs = new Tabs();
    tabs.folder = await mkdtemp(join(tmpdir(), "drystone-tabs-"));
    const parameters = ["--headless", "--no-sandbox", ...WEBGPU, "--no-first-run", "--remote-debugging-pipe"];
    tabs.child = spawn(process.env.CHROMIUM ?? "/usr/bin/chromium", [...parameters, `--user-data-dir=${tabs.folder}`], {
      stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
    });
    tabs.child.stdio[4].setEncoding("utf8").on("data", (more) => tabs.hear(more));
    return tabs;
  }

  /// Messages of the DevTools protocol end with a zero each.
  hear(more) {
    const messages = (this.text + more).split("\0");
    this.text = messages.pop();
    for (const { id, result, error } of messages.map((message) => JSON.parse(message))) {
      const [done, failed] = this.waiting.get(id) ?? [];
      this.waiting.delete(id);
      if (error) failed?.(new Error(error.message));
      else done?.(result);
    }
  }

  send(method, params = {}, sessionId = undefined) {
    const id = (this.sent = (this.sent ?? 0) + 1);
    this.child.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
    return new Promise((done, failed) => this.waiting.set(id, [done, failed]));
  }

  /// Opens an address in a new tab, in front of the others.
  async open(address, script = null) {
    const { targetId } = await this.send("Target.createTarget", { url: "about:blank" });
    const { sessionId } = await this.send("Target.attachToTarget", { targetId, flatten: true });
    await this.send("Page.enable", {}, sessionId);
    if (script) await this.send("Page.addScriptToEvaluateOnNewDocument", { source: script }, sessionId);
    await this.send("Page.navigate", { url: address }, sessionId);
    const evaluate = async (expression) => {
      const { result, exceptionDetails } = await this.send("Runtime.evaluate", { expression, returnByValue: true, awaitPromise: true }, sessionId);
      if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
      return result.value;
    };
    return { evaluate, show: () => this.send("Target.activateTarget", { targetId }) };
  }

  async close() {
    const ended = new Promise((done) => this.child.once("exit", done));
    await this.send("Browser.close");
    await ended;
    await rm(this.folder, { recursive: true, force: true });
  }
}
