// The checks so far: a line each.
export class Checks {
  passed = 0;
  failed = [];

  constructor(group, print = console.log) {
    Object.assign(this, { group, print });
  }

  /// Notes whether something holds, with the figure that shows it.
  holds(what, holds, figure = "") {
    if (holds) this.passed += 1;
    else this.failed.push(what);
    this.print(`${holds ? "ok  " : "FAIL"} ${this.group}: ${what}${figure === "" ? "" : ` (${figure})`}`);
  }

  equal(what, found, wanted) {
    const [a, b] = [found, wanted].map((value) => JSON.stringify(value));
    this.holds(what, a === b, a === b ? "" : `${a}, not ${b}`);
  }
}
