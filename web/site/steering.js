// Drives a scene: by keys, by a stick on the picture, and by a button for jumps.

const element = (id) => document.getElementById(id);
/// Forward and right of each key, by its place on the keyboard.
const KEYS = {
  ArrowUp: [1, 0], KeyW: [1, 0],
  ArrowDown: [-1, 0], KeyS: [-1, 0],
  ArrowRight: [0, 1], KeyD: [0, 1],
  ArrowLeft: [0, -1], KeyA: [0, -1],
};

export class Steering {
  held = new Set();
  stick = [0, 0];
  jump = false;

  /// `drives` returns what a person drives now: "character", "vehicle" or null.
  constructor(drives) {
    addEventListener("keydown", (event) => {
      const { code, target } = event;
      if (!drives() || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
      // Keys on a control belong to the control.
      if (target.matches("input, select, textarea") || (code === "Space" && target.matches("button, summary"))) return;
      const isJump = code === "Space" && drives() === "character";
      if (!isJump && !KEYS[code]) return;
      event.preventDefault();
      if (event.repeat) return;
      if (isJump) this.jump = true;
      else this.held.add(code);
    });
    addEventListener("keyup", ({ code }) => this.held.delete(code));
    // The page does not hear of a release in another window.
    addEventListener("blur", () => this.held.clear());
    this.#hear();
  }

  /// Forward and right from -1 to 1, and whether to jump, for the next step. A jump counts once.
  next() {
    const keys = [...this.held].map((code) => KEYS[code]);
    const sum = (k) => keys.reduce((all, key) => all + key[k], this.stick[k]);
    const jump = this.jump;
    this.jump = false;
    return [0, 1].map((k) => Math.max(-1, Math.min(1, sum(k)))).concat(jump);
  }

  #hear() {
    const stick = element("stick");
    let finger = null;
    const pull = (right, down) => {
      this.stick = [-down, right];
      stick.style.setProperty("--right", right);
      stick.style.setProperty("--down", down);
    };
    const follow = ({ pointerId, clientX, clientY }) => {
      if (pointerId !== finger) return;
      const { left, top, width, height } = stick.getBoundingClientRect();
      const [x, y] = [(2 * (clientX - left)) / width - 1, (2 * (clientY - top)) / height - 1];
      const length = Math.max(Math.hypot(x, y), 1);
      pull(x / length, y / length);
    };
    const release = ({ pointerId }) => {
      if (pointerId !== finger) return;
      finger = null;
      pull(0, 0);
    };
    stick.addEventListener("pointerdown", (event) => {
      if (finger !== null) return;
      event.preventDefault();
      finger = event.pointerId;
      stick.setPointerCapture(finger);
      follow(event);
    });
    stick.addEventListener("pointermove", follow);
    // Also after a cancelled touch, and when the stick is hidden.
    stick.addEventListener("lostpointercapture", release);
    element("jump").addEventListener("pointerdown", () => (this.jump = true));
    // A key on the button. After a press of a pointer, the click has a number above 0.
    element("jump").addEventListener("click", ({ detail }) => (this.jump ||= detail === 0));
  }
}
