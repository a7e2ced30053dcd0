// Cross-section of the unworn contact: indenter, stick zone and slip zone.

import { h, svg } from "../page/dom.js";
import { isLine, quantity } from "../quantities/units.js";

const [WIDTH, HEIGHT, SURFACE] = [360, 150, 96];

/** The gap f(r) of a canonical profile in metres. */
function gap(profile) {
  const { shape, radius: R, flat_radius: b = 0, slope_angle: angle = 0, radii, flat_half_width: flat, edge_radius: edge } = profile;
  const tangent = Math.tan(angle);
  return {
    paraboloid: (r) => (r * r) / (2 * R),
    sphere: (r) => R - Math.sqrt(Math.max(0, R * R - r * r)),
    cone: (r) => r * tangent,
    power: (r) => profile.height * (r / profile.at_radius) ** profile.exponent,
    truncated_paraboloid: (r) => Math.max(0, r * r - b * b) / (2 * R),
    truncated_cone: (r) => Math.max(0, r - b) * tangent,
    crossed_cylinders: (r) => (r * r) / (2 * radii?.[1]),
    cylinder: (r) => (r * r) / (2 * R),
    wedge: (r) => r * tangent,
    punch: (r) => Math.max(0, r - flat) ** 2 / (2 * edge),
    table: (r) => {
      const at = R.findIndex((own) => own >= r);
      if (at <= 0) return profile.height[at < 0 ? profile.height.length - 1 : 0] - profile.height[0];
      const fraction = (r - R[at - 1]) / (R[at] - R[at - 1]);
      return profile.height[at - 1] + fraction * (profile.height[at] - profile.height[at - 1]) - profile.height[0];
    },
  }[shape];
}

/** Draws the contact of a scenario or a result. Heights are enlarged to be visible. */
export function sketch({ scenario, scales, unworn }) {
  const f = gap(scenario.profile);
  const { contact_radius: a } = scales;
  if (!f || !a) return null;
  const isStrip = isLine(scenario.profile);
  // The depth of a line contact depends on the size of the bodies. The sketch shows the contact width.
  const d = isStrip ? f(a) : scales.indentation_depth;
  const maxRadius = 2 * a;
  const scaleX = WIDTH / 2 / (maxRadius * 1.08);
  const heights = Array.from({ length: 81 }, (_, i) => f((i / 80) * maxRadius) - d);
  const scaleY = Math.min(26 / d, 78 / Math.max(...heights));
  const x = (r) => (WIDTH / 2 + r * scaleX).toFixed(1);
  const z = (height) => (SURFACE - height * scaleY).toFixed(1);
  const half = (sign) => heights.map((height, i) => `${x((sign * i * maxRadius) / 80)},${z(height)}`);
  const outline = [...half(-1).reverse(), ...half(1).slice(1)].join(" L");
  const c = unworn.stick_radius ?? 0;
  const line = (name, r, y) => svg("path", { class: name, d: `M${x(-r)},${y} L${x(r)},${y}` });
  const description = isStrip ? `Cross-section along the motion: contact half-width ${quantity(a, "m")}, stick half-width ${quantity(c, "m")}`
    : `Cross-section: contact radius ${quantity(a, "m")}, stick radius ${quantity(c, "m")}, indentation depth ${quantity(d, "m")}`;
  return h("figure", { class: "sketch" },
    svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": description },
      svg("rect", { class: "flat", x: 0, y: SURFACE, width: WIDTH, height: HEIGHT - SURFACE }),
      svg("path", { class: "indenter", d: `M${outline} L${x(maxRadius)},0 L${x(-maxRadius)},0 Z` }),
      svg("path", { class: "surface", d: `M0,${SURFACE} L${WIDTH},${SURFACE}` }),
      line("slip", a, HEIGHT - 14), c > 0 ? line("stick", c, HEIGHT - 14) : null),
    h("figcaption", {}, h("span", { class: "key stick" }, `Stick zone, c = ${quantity(c, "m")}`), " ",
      h("span", { class: "key slip" }, `Slip zone, a₀ = ${quantity(a, "m")}`), " ",
      isStrip && h("span", { class: "muted" }, `Length ${quantity(scenario.profile.length, "m")}, into the picture`),
      h("span", { class: "muted" }, `Heights enlarged ${Math.max(1, Math.round(scaleY / scaleX))}×`)));
}
