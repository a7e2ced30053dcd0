// A contact in section: the unworn indenter, how far it touches, what sticks.

import { h, svg } from "./dom.js";
import { quantity } from "./units.js";

const [WIDE, HIGH, SURFACE] = [360, 150, 96];

/** The gap f(r) of a canonical profile, in metres. */
function gap(profile) {
  const { shape, radius: R, flat_radius: b = 0, slope_angle: angle = 0 } = profile;
  const tangent = Math.tan(angle);
  return {
    paraboloid: (r) => (r * r) / (2 * R),
    sphere: (r) => R - Math.sqrt(Math.max(0, R * R - r * r)),
    cone: (r) => r * tangent,
    power: (r) => profile.height * (r / profile.at_radius) ** profile.exponent,
    truncated_paraboloid: (r) => Math.max(0, r * r - b * b) / (2 * R),
    truncated_cone: (r) => Math.max(0, r - b) * tangent,
    table: (r) => {
      const at = R.findIndex((own) => own >= r);
      if (at <= 0) return profile.height[at < 0 ? profile.height.length - 1 : 0] - profile.height[0];
      const part = (r - R[at - 1]) / (R[at] - R[at - 1]);
      return profile.height[at - 1] + part * (profile.height[at] - profile.height[at - 1]) - profile.height[0];
    },
  }[shape];
}

/** The contact before it wears, from what `POST /v1/scenarios` answers; heights are stretched. */
export function sketch({ scenario, scales, unworn }) {
  const f = gap(scenario.profile);
  const { contact_radius: a, indentation_depth: d } = scales;
  if (!f || !a) return null;
  const widest = 2 * a;
  const across = WIDE / 2 / (widest * 1.08);
  const heights = Array.from({ length: 81 }, (_, i) => f((i / 80) * widest) - d);
  const down = Math.min(26 / d, 78 / Math.max(...heights));
  const x = (r) => (WIDE / 2 + r * across).toFixed(1);
  const z = (height) => (SURFACE - height * down).toFixed(1);
  const half = (sign) => heights.map((height, i) => `${x((sign * i * widest) / 80)},${z(height)}`);
  const outline = [...half(-1).reverse(), ...half(1).slice(1)].join(" L");
  const c = unworn.stick_radius ?? 0;
  const line = (name, r, y) => svg("path", { class: name, d: `M${x(-r)},${y} L${x(r)},${y}` });
  const words = `Section: contact radius ${quantity(a, "m")}, stick radius ${quantity(c, "m")}, depth ${quantity(d, "m")}`;
  return h("figure", { class: "sketch" },
    svg("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": words },
      svg("rect", { class: "flat", x: 0, y: SURFACE, width: WIDE, height: HIGH - SURFACE }),
      svg("path", { class: "indenter", d: `M${outline} L${x(widest)},0 L${x(-widest)},0 Z` }),
      svg("path", { class: "surface", d: `M0,${SURFACE} L${WIDE},${SURFACE}` }),
      line("slips", a, HIGH - 14), c > 0 ? line("sticks", c, HIGH - 14) : null),
    h("figcaption", {}, h("span", { class: "key sticks" }, `sticks, c = ${quantity(c, "m")}`), " ",
      h("span", { class: "key slips" }, `slips, to a₀ = ${quantity(a, "m")}`), " ",
      h("span", { class: "quiet" }, `heights × ${Math.max(1, Math.round(down / across))}`)));
}
