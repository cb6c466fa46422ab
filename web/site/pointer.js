// Mouse, touch and keys on a picture. `act` gets the actions: turn, move, zoom, take, drag, let go, throw, delete,
// whole, or the press of a maze.

const TURN = 0.05;
/// A notch of the wheel moves the camera to 0.9 of its distance. Two fingers move it closer in the ratio of their
/// distances.
const NOTCH = Math.log(1 / 0.9);

/// The place of an event in the picture, -1 to 1 from left to right and from bottom to top.
function place(canvas, { clientX, clientY }) {
  const box = canvas.getBoundingClientRect();
  return [(2 * (clientX - box.left)) / box.width - 1, 1 - (2 * (clientY - box.top)) / box.height];
}

export function listen(canvas, act, tool) {
  const down = new Map();
  let drag = null;
  const height = () => canvas.clientHeight || 1;

  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", async (event) => {
    event.preventDefault();
    canvas.focus({ focusVisible: false, preventScroll: true });
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, event);
    const at = place(canvas, event);
    if (down.size > 1) {
      if (drag === "body") act.release();
      if (drag === "press") act.press(null);
      drag = "pinch";
      return;
    }
    if (event.button === 0 && act.press?.(at)) drag = "press";
    else if (event.button === 1 || (event.button === 0 && event.shiftKey)) drag = "pan";
    else if (event.button === 2) drag = "orbit";
    else if (tool() === "throw") [drag] = [null, act.throw(at)];
    else if (tool() === "delete") [drag] = [null, act.delete(at)];
    else {
      // Until the first body test is done, moves do not turn the view.
      drag = "asked";
      const taken = await act.grab(at);
      if (drag === "asked") drag = taken ? "body" : "orbit";
      else if (taken) act.release();
      canvas.classList.toggle("pulling", drag === "body");
    }
  });
  canvas.addEventListener("pointermove", (event) => {
    const at = place(canvas, event);
    act.point(at);
    const before = down.get(event.pointerId);
    if (!before) return;
    const by = [(event.clientX - before.clientX) / height(), (event.clientY - before.clientY) / height()];
    if (drag === "pinch" && down.size === 2) {
      const [a, b] = down.values();
      const spread = (x, y) => Math.hypot(x.clientX - y.clientX, x.clientY - y.clientY);
      const other = a.pointerId === event.pointerId ? b : a;
      act.zoom(Math.log(Math.max(spread(event, other), 1) / Math.max(spread(before, other), 1)) / NOTCH);
      act.pan([0.5 * by[0], 0.5 * by[1]]);
    } else if (drag === "press") act.press(at);
    else if (drag === "body") act.drag(at);
    else if (drag === "orbit") act.orbit(by);
    else if (drag === "pan") act.pan(by);
    down.set(event.pointerId, event);
  });
  const up = (event) => {
    if (!down.delete(event.pointerId)) return;
    if (drag === "body") act.release();
    if (drag === "press") act.press(null);
    if (down.size === 0) drag = null;
    canvas.classList.remove("pulling");
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? event.deltaY : event.deltaY / 40;
      act.zoom(-Math.max(-5, Math.min(5, lines)));
    },
    { passive: false },
  );
}

/// Keys on the picture: arrows turn or move the view, or pull the body that Enter grabbed in the middle.
export function keys(canvas, act) {
  let held = null;
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  canvas.addEventListener("keydown", async (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = arrows[event.key];
    if (arrow && act.steers()) return;
    if (arrow && held) {
      held = [held[0] + TURN * arrow[0], held[1] + TURN * arrow[1]].map((x) => Math.max(-1, Math.min(1, x)));
      act.drag(held);
    } else if (arrow && event.shiftKey) act.pan([-TURN * arrow[0], TURN * arrow[1]]);
    else if (arrow) act.orbit([-TURN * arrow[0], TURN * arrow[1]]);
    else if (event.key === "+" || event.key === "=") act.zoom(1);
    else if (event.key === "-") act.zoom(-1);
    else if (event.key === "Enter" && held) [held] = [null, act.release()];
    else if (event.key === "Enter") held = (await act.grab([0, 0])) ? [0, 0] : null;
    else return;
    event.preventDefault();
  });
  canvas.addEventListener("blur", () => held && ([held] = [null, act.release()]));
}
