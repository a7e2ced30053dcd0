// What a printed result says in addition: the materials, and where and when it was printed.

import { h } from "./dom.js";
import { digits, quantity } from "./units.js";

const said = (value, unit) => (typeof value === "number" ? quantity(value, unit) : value);
const BODY = ["₁", "₂"];

/** The elastic constants as submitted; otherwise the moduli of the contact. */
function elastic({ moduli }, submitted) {
  const given = (submitted?.bodies ?? []).filter((body) => body.youngs_modulus !== undefined);
  if (!given.length) return [["E*", quantity(moduli.normal, "Pa")], moduli.tangential != null && ["G*", quantity(moduli.tangential, "Pa")]].filter(Boolean);
  return given.flatMap(({ youngs_modulus: modulus, poisson_ratio: ratio }, i) => [[`E${BODY[i]}`, said(modulus, "Pa")], [`ν${BODY[i]}`, said(ratio, "1")]]);
}

/** The wear coefficients: of both bodies together, or of each body with its layers from the surface on. */
function wear({ coefficient, share, bodies }) {
  const one = (value) => (typeof value === "number" ? quantity(value, "1/Pa") : "a table of values");
  if (!bodies) return [["k_w", one(coefficient)], share !== undefined && ["share of body 1", digits(share)]].filter(Boolean);
  return bodies.map(({ layers = [], coefficient: base }, i) => [`k_w${BODY[i]}`,
    [...layers.map(({ thickness, coefficient: own }) => `${one(own)} to a depth of ${quantity(thickness, "m")}`), one(base)].join(", then ")]);
}

/** A paragraph that only printed pages show. */
export function printedFacts({ scenario }, submitted, signal) {
  const facts = [...elastic(scenario, submitted), ...wear(scenario.wear)].map(([name, value]) => `${name}\u00a0=\u00a0${value}`).join("; ");
  const when = h("span", {});
  const stamp = () => {
    when.textContent = `Printed ${new Date().toLocaleString(undefined, { dateStyle: "medium", timeStyle: "short" })} from ${location.href.split("?")[0]}`;
  };
  stamp();
  addEventListener("beforeprint", stamp, { signal });
  return h("p", { class: "printed" }, `${facts}. `, when);
}
