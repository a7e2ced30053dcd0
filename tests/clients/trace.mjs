// Tests how the dashboard makes a profile from a trace of an indenter: axis and tilt are those that made the trace.
//
//     node trace.mjs

import assert from "node:assert/strict";
import { profileOf } from "../../src/http/dashboard/form/trace.js";

const [R, REACH, COUNT] = [10e-3, 400e-6, 401];
const ball = (r) => r ** 2 / (2 * R);
const scar = (r) => ball(r) + (r > 100e-6 && r < 200e-6 ? 1e-6 * Math.sin((Math.PI * (r - 100e-6)) / 100e-6) ** 2 : 0);
const SHAPES = { ball, scar, flat: (r) => Math.max(ball(r), ball(200e-6)), cone: (r) => 0.02 * r };
const near = (own, other, most, words) => assert.ok(Math.abs(own - other) <= most, `${words}: ${own} instead of ${other}`);

for (const [name, height] of Object.entries(SHAPES)) {
  for (const [shift, tilt, turned] of [[0, 0, 1], [13e-6, 0, 1], [13e-6, 1e-3, 1], [-60e-6, 1e-3, -1], [-60e-6, -5e-4, 1]]) {
    const words = `${name}, shift ${shift}, tilt ${tilt}`;
    const xs = Array.from({ length: COUNT }, (_, i) => REACH * ((2 * i) / (COUNT - 1) - 1));
    const found = profileOf(xs, xs.map((x) => turned * height(Math.abs(x - shift)) + tilt * x), { level: true, axis: "symmetry", sides: "both" });
    assert.equal(found.isTurned, turned < 0, words);
    // Across a ball, a tilt is a shift.
    const isBall = name === "ball";
    near(found.centre, shift - (isBall ? turned * tilt * R : 0), 0.5e-6, `axis of ${words}`);
    near(found.slope, isBall ? 0 : tilt, 5e-6, `tilt of ${words}`);
    found.profile.radius.forEach((r, i) => near(found.profile.height[i], height(r) - height(0), 25e-9, `height at ${r} of ${words}`));
  }
}
console.log("the axis and the tilt of traces are found");
