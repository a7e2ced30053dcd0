// The fields of the form. Each field edits one value of the scenario, named by its JSON pointer.

import { WORDS } from "./units.js";

const RADIUS = ["radius", "Radius R", "10 mm"];
const SLOPE = ["slope_angle", "Slope angle θ", "2 deg"];
const FLAT = ["flat_radius", "Flat radius b", "60 um"];
/** Members of each shape: name, label and default. */
const SHAPES = {
  paraboloid: [RADIUS],
  sphere: [RADIUS],
  cone: [SLOPE],
  power: [["exponent", "Exponent n", 4], ["at_radius", "Reference radius", "0.2 mm"],
    ["height", "Height at reference radius", "5 um"]],
  truncated_paraboloid: [RADIUS, FLAT],
  truncated_cone: [SLOPE, FLAT],
};

/** The members of `cycles` that give the outputs by another quantity than numbers of cycles, and their units. */
const CYCLES_IN = { normalized: "N₀", dissipated_energy: "J" };
const cyclesIn = (cycles) => Object.keys(CYCLES_IN).find((name) => name in Object(cycles));

const STEEL = () => ({ youngs_modulus: "205 GPa", poisson_ratio: 0.3 });

/**
 * Drop-down lists that decide which fields follow. `selected` reads the option from a scenario, `apply` changes the
 * scenario to an option, and `fields` lists the fields of an option as `[pointer, label, options]`.
 */
export const CHOICES = [
  {
    id: "shape", group: "Contact", label: "Shape",
    options: Object.fromEntries(Object.keys(SHAPES).map((shape) => [shape, WORDS[shape]])),
    selected: (scenario) => scenario.profile?.shape,
    apply: (scenario, shape) => {
      const before = scenario.profile ?? {};
      const members = SHAPES[shape].map(([member, , preset]) => [member, before[member] ?? preset]);
      scenario.profile = { shape, ...Object.fromEntries(members) };
    },
    fields: (shape) => SHAPES[shape].map(([member, label]) => [`/profile/${member}`, label]),
  },
  {
    id: "elasticity", group: "Material", label: "Elastic constants",
    options: { bodies: "Of each body", moduli: "Effective moduli" },
    selected: (scenario) => (scenario.moduli ? "moduli" : "bodies"),
    apply: (scenario, kind) => {
      delete scenario.bodies;
      delete scenario.moduli;
      scenario[kind] = kind === "bodies" ? [STEEL(), STEEL()] : { normal: "112.6 GPa", tangential: "92.8 GPa" };
    },
    fields: (kind) => kind === "moduli"
      ? [["/moduli/normal", "Normal modulus E*"], ["/moduli/tangential", "Tangential modulus G*"]]
      : [0, 1].flatMap((i) => [[`/bodies/${i}/youngs_modulus`, `Body ${i + 1}: Young's modulus E`],
        [`/bodies/${i}/poisson_ratio`, `Body ${i + 1}: Poisson's ratio ν`]]),
  },
  {
    id: "wear", group: "Material", label: "Wear law",
    options: { coefficient: "Wear coefficient k_w", hardness: "Archard: k and hardness", energy: "Energy coefficient α" },
    selected: ({ wear }) => ("energy_coefficient" in Object(wear) ? "energy" : "hardness" in Object(wear) ? "hardness" : "coefficient"),
    apply: (scenario, kind) => {
      const { share } = scenario.wear ?? {};
      scenario.wear = {
        coefficient: { coefficient: "3.03e-5 mm^3/(N m)" },
        hardness: { coefficient: 1e-4, hardness: "3 GPa" },
        energy: { energy_coefficient: "4.3e-5 mm^3/J" },
      }[kind];
      if (share !== undefined) scenario.wear.share = share;
    },
    fields: (kind) => [
      ...{
        coefficient: [["/wear/coefficient", "Wear coefficient k_w"]],
        hardness: [["/wear/coefficient", "Archard coefficient k"], ["/wear/hardness", "Hardness"]],
        energy: [["/wear/energy_coefficient", "Energy coefficient α"]],
      }[kind],
      ["/wear/share", "Wear share of body 1 (0 to 1, optional)"], ["/friction", "Friction coefficient μ"]],
  },
  {
    id: "load", group: "Load and motion", label: "Load",
    options: { normal_force: "Normal force F", indentation_depth: "Indentation depth d" },
    selected: ({ load }) => ("indentation_depth" in Object(load) ? "indentation_depth" : "normal_force"),
    apply: (scenario, kind) => {
      const { held } = scenario.load ?? {};
      scenario.load = { [kind]: kind === "normal_force" ? "100 N" : "3.5 um", ...(held && { held }) };
    },
    fields: (kind) => [kind === "normal_force" ? ["/load/normal_force", "Normal force F"] : ["/load/indentation_depth", "Indentation depth d"],
      ["/load/held", "Load: held constant",
        { "": kind === "normal_force" ? "Default (force)" : "Default (depth)", force: "Normal force", depth: "Indentation depth" }]],
  },
  {
    id: "motion", group: "Load and motion", label: "Motion",
    options: { amplitude: "Amplitude U", stick_ratio: "Stick ratio c/a₀", tangential_force: "Tangential force Q" },
    selected: ({ motion }) => ["blocks", "reversals", "tangential_force", "stick_ratio"].find((name) => name in Object(motion)) ?? "amplitude",
    apply: (scenario, kind) => {
      scenario.motion = { [kind]: { amplitude: "2.256 um", stick_ratio: 0.5, tangential_force: "45 N" }[kind] };
    },
    fields: (kind) => [
      {
        amplitude: ["/motion/amplitude", "Amplitude U (half the stroke)"],
        stick_ratio: ["/motion/stick_ratio", "Stick ratio c/a₀"],
        tangential_force: ["/motion/tangential_force", "Tangential force Q"],
      }[kind],
      ["/motion/held", "Motion: held constant", {
        "": kind === "tangential_force" ? "Default (tangential force)" : "Default (amplitude)",
        amplitude: "Amplitude", tangential_force: "Tangential force" }],
      ["/motion/rig_stiffness", "Rig stiffness (optional)"]],
  },
  {
    id: "cycles", group: "Duration", label: "Output cycles",
    options: { list: "List", range: "Range" },
    selected: ({ cycles }) => {
      const own = cycles?.[cyclesIn(cycles)] ?? cycles;
      return own && typeof own === "object" && !Array.isArray(own) ? "range" : "list";
    },
    apply: (scenario, kind) => {
      scenario.cycles = kind === "list" ? [1000, 3000, 10000, 30000, 100000]
        : { from: 1000, to: 100000, count: 13, spacing: "log" };
    },
    fields: (kind, scenario) => {
      const name = cyclesIn(scenario.cycles);
      const [at, unit] = name ? [`/cycles/${name}`, ` [${CYCLES_IN[name]}]`] : ["/cycles", ""];
      const word = name === "dissipated_energy" ? "Dissipated energies" : "Cycles";
      return [...(kind === "list" ? [[at, `${word}${unit}, separated by commas`]]
        : [[`${at}/from`, `First${unit}`], [`${at}/to`, `Last${unit}`], [`${at}/count`, "Number of outputs"],
           [`${at}/spacing`, "Spacing", { log: "Logarithmic", linear: "Linear" }]]),
      ["/until/wear_depth", "Stop at wear depth (optional)"]];
    },
  },
  {
    id: "method", group: "Model", label: "Method",
    options: { exact: "Exact method (default)", simplified: "Simplified rule (paper)" },
    selected: ({ model = {} }) => model.method ?? "exact",
    apply: (scenario, method) => {
      const { points } = scenario.model ?? {};
      scenario.model = { method, ...(points && { points }) };
    },
    fields: (method) => [["/model/points", "Profile points (optional)"],
      ...(method === "exact" ? [["/model/tolerance", "Tolerance (optional)"],
        ["/model/compare", "Compare with simplified rule", { "": "No", true: "Yes" }]] : [["/model/xi", "Fitting parameter ξ (optional)"]])],
  },
];

/** Pointers of the values that the form shows as fields. */
export const withField = (scenario) => CHOICES.flatMap(({ selected, options, fields }) => {
  const kind = selected(scenario);
  return kind in options ? fields(kind, scenario).map(([pointer]) => pointer) : [];
});

/** Pointers of the values that the form cannot show as fields. They are edited as JSON. */
export function withoutField(scenario) {
  const known = ["/profile/shape", "/model/method", ...withField(scenario)];
  const values = (value, pointer) => known.includes(pointer) ? []
    : Object(value) === value && !Array.isArray(value)
      ? Object.entries(value).flatMap(([name, own]) => values(own, `${pointer}/${name}`))
      : [pointer];
  return values({ ...scenario, bodies: { ...scenario.bodies } }, "");
}

/** The value at a pointer; undefined if it is missing. */
export function valueAt(scenario, pointer) {
  return pointer.split("/").slice(1).reduce((value, name) => value?.[name], scenario);
}

/** Sets the value at a pointer. Undefined removes it. */
export function setValueAt(scenario, pointer, value) {
  const names = pointer.split("/").slice(1);
  const last = names.pop();
  let parent = scenario;
  for (const name of names) parent = parent[name] ??= {};
  if (value === undefined) delete parent[last];
  else parent[last] = value;
  if (value === undefined && names[0] === "until" && !Object.keys(parent).length) delete scenario.until;
}

/** The value that the user typed: a number, true, a list of cycles, or text with a unit. */
export function parseInput(pointer, text) {
  const trimmed = text.trim();
  if (trimmed === "") return undefined;
  // A space before a unit does not separate two numbers.
  if (/^\/cycles(\/(normalized|dissipated_energy))?$/.test(pointer))
    return trimmed.split(/\s*[,;]\s*|\s+(?=[-+.\d])/).filter(Boolean).map(numberOrText);
  return trimmed === "true" ? true : numberOrText(trimmed);
}

/** The number of a text; the text if it is not only a number. */
export const numberOrText = (text) => (text.trim() === "" || Number.isNaN(Number(text)) ? text : Number(text));

/** The text of a value in its field. */
export const inputText = (value) => (value === undefined ? "" : Array.isArray(value) ? value.join(", ") : String(value));
