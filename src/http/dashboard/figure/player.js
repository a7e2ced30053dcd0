// A button that moves a slider from its start to its end.

import { h } from "../page/dom.js";

/** Time for all steps, and limits of the time of one step, in ms. */
const [WHOLE, SHORTEST, LONGEST] = [6000, 33, 700];

/** `show(step)` shows a step of `count`, and `now()` says which one is shown. */
export function playButton(count, now, show, signal) {
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
    draw();
  };
  const button = h("button", { type: "button", id: "play", onclick: () => {
    if (timer !== null) return stop();
    if (now() >= count - 1) show(0);
    timer = setInterval(() => {
      show(now() + 1);
      if (now() >= count - 1) stop();
    }, Math.min(LONGEST, Math.max(SHORTEST, WHOLE / count)));
    draw();
  } });
  const draw = () => {
    button.textContent = timer === null ? "▶\u00a0Play" : "❚❚\u00a0Pause";
  };
  draw();
  button.disabled = count < 2;
  signal.addEventListener("abort", stop);
  return button;
}
