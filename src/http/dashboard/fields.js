// What the form asks for: every field is a place in the scenario, named by its JSON pointer.

/** What a shape is described by: `[member, label, usual value]`. */
export const SHAPES = {
  paraboloid: [["radius", "Radius R", "10 mm"]],
  sphere: [["radius", "Radius R", "10 mm"]],
  cone: [["slope_angle", "Slope from the plane θ", "2 deg"]],
  power: [["exponent", "Exponent", 4], ["height", "Height", "5 um"], ["at_radius", "at radius", "0.2 mm"]],
  truncated_paraboloid: [["radius", "Radius R", "10 mm"], ["flat_radius", "Radius of the flat b", "60 um"]],
  truncated_cone: [["slope_angle", "Slope from the plane θ", "2 deg"], ["flat_radius", "Radius of the flat b", "60 um"]],
};

const STEEL = () => ({ youngs_modulus: "205 GPa", poisson_ratio: 0.3 });

/** A choice decides which members a part has; it says which one a scenario has taken. */
export const CHOICES = [
  {
    id: "shape", part: "Contact", label: "Shape",
    options: { paraboloid: "Paraboloid", sphere: "Sphere", cone: "Cone", power: "Power law",
      truncated_paraboloid: "Truncated paraboloid", truncated_cone: "Truncated cone" },
    of: (scenario) => scenario.profile?.shape,
    take: (scenario, shape) => {
      const before = scenario.profile ?? {};
      const members = SHAPES[shape].map(([member, , usual]) => [member, before[member] ?? usual]);
      scenario.profile = { shape, ...Object.fromEntries(members) };
    },
    fields: (shape) => (SHAPES[shape] ?? []).map(([member, label]) => [`/profile/${member}`, label]),
  },
  {
    id: "elasticity", part: "Material", label: "Elasticity",
    options: { bodies: "Two bodies", moduli: "Effective moduli" },
    of: (scenario) => (scenario.moduli ? "moduli" : "bodies"),
    take: (scenario, kind) => {
      delete scenario.bodies;
      delete scenario.moduli;
      scenario[kind] = kind === "bodies" ? [STEEL(), STEEL()] : { normal: "112.6 GPa", tangential: "92.8 GPa" };
    },
    fields: (kind) => kind === "moduli"
      ? [["/moduli/normal", "Normal E*"], ["/moduli/tangential", "Tangential G*"]]
      : [["/bodies/0/youngs_modulus", "Body 1: modulus E"], ["/bodies/0/poisson_ratio", "Body 1: Poisson's ratio ν"],
         ["/bodies/1/youngs_modulus", "Body 2: modulus E"], ["/bodies/1/poisson_ratio", "Body 2: Poisson's ratio ν"]],
  },
  {
    id: "wear", part: "Material", label: "Wear by",
    options: { coefficient: "Coefficient k_w", hardness: "Archard: k and hardness", energy: "Energy coefficient α" },
    of: ({ wear }) => ("energy_coefficient" in Object(wear) ? "energy" : "hardness" in Object(wear) ? "hardness" : "coefficient"),
    take: (scenario, kind) => {
      const { share } = scenario.wear ?? {};
      scenario.wear = {
        coefficient: { coefficient: "3.03e-5 mm^3/(N m)" },
        hardness: { coefficient: 1e-4, hardness: "3 GPa" },
        energy: { energy_coefficient: "4.3e-5 mm^3/J" },
      }[kind];
      if (share !== undefined) scenario.wear.share = share;
    },
    fields: (kind) => [...(kind === "energy" ? [["/wear/energy_coefficient", "Energy coefficient α"]]
      : [["/wear/coefficient", kind === "hardness" ? "Archard's k" : "Wear coefficient k_w"]]),
    ...(kind === "hardness" ? [["/wear/hardness", "Hardness"]] : []),
    ["/wear/share", "Part borne by body 1 (optional)"], ["/friction", "Friction μ"]],
  },
  {
    id: "load", part: "Load and motion", label: "Pressed by",
    options: { normal_force: "Normal force F", indentation_depth: "Indentation depth d" },
    of: ({ load }) => ("indentation_depth" in Object(load) ? "indentation_depth" : "normal_force"),
    take: (scenario, kind) => {
      const { held } = scenario.load ?? {};
      scenario.load = { [kind]: kind === "normal_force" ? "100 N" : "3.5 um", ...(held && { held }) };
    },
    fields: (kind) => [[`/load/${kind}`, kind === "normal_force" ? "Normal force F" : "Indentation depth d"],
      ["/load/held", "Load held while it wears", { "": "what is given", force: "force (a dead weight)", depth: "depth" }]],
  },
  {
    id: "motion", part: "Load and motion", label: "Moved by",
    options: { amplitude: "Amplitude U", stick_ratio: "Stick ratio c/a₀", tangential_force: "Tangential force Q" },
    of: ({ motion }) => ["blocks", "reversals", "tangential_force", "stick_ratio"].find((name) => name in Object(motion)) ?? "amplitude",
    take: (scenario, kind) => {
      scenario.motion = { [kind]: { amplitude: "2.256 um", stick_ratio: 0.5, tangential_force: "45 N" }[kind] };
    },
    fields: (kind) => ({
      amplitude: [["/motion/amplitude", "Amplitude U (half of the stroke)"]],
      stick_ratio: [["/motion/stick_ratio", "Stick ratio c/a₀"]],
      tangential_force: [["/motion/tangential_force", "Tangential force Q"]],
    }[kind] ?? []).concat(kind === "blocks" || kind === "reversals" ? [] : [
      ["/motion/held", "Motion held while it wears", { "": "as usual", amplitude: "amplitude", tangential_force: "tangential force" }],
      ["/motion/rig_stiffness", "Rig stiffness (optional)"]]),
  },
  {
    id: "cycles", part: "How long", label: "Instants",
    options: { list: "List", range: "Range" },
    of: ({ cycles }) => {
      const own = cycles?.normalized ?? cycles;
      return own && typeof own === "object" && !Array.isArray(own) ? "range" : "list";
    },
    take: (scenario, kind) => {
      scenario.cycles = kind === "list" ? [1000, 3000, 10000, 30000, 100000]
        : { from: 1000, to: 100000, count: 13, spacing: "log" };
    },
    fields: (kind, scenario) => {
      const at = scenario.cycles?.normalized === undefined ? "/cycles" : "/cycles/normalized";
      const unit = at === "/cycles" ? "" : " (in N₀)";
      return (kind === "list" ? [[at, `Cycles${unit}, separated by commas`]]
        : [[`${at}/from`, `From${unit}`], [`${at}/to`, `To${unit}`], [`${at}/count`, "How many"],
           [`${at}/spacing`, "Spacing", { log: "logarithmic", linear: "linear" }]])
        .concat([["/until/wear_depth", "End at wear depth (optional)"]]);
    },
  },
  {
    id: "method", part: "Model", label: "Method",
    options: { simplified: "Simplified rule", exact: "Exact" },
    of: ({ model = {} }) => model.method ?? "simplified",
    take: (scenario, method) => {
      const { points } = scenario.model ?? {};
      scenario.model = { method, ...(points && { points }) };
    },
    fields: (method) => [["/model/points", "Points of a profile (optional)"],
      ...(method === "exact" ? [["/model/tolerance", "Tolerance (optional)"],
        ["/model/compare", "Compare with the rule", { "": "no", true: "yes" }]] : [["/model/xi", "ξ (optional)"]])],
  },
];

/** The value at a pointer; undefined if there is none. */
export function read(scenario, pointer) {
  return pointer.split("/").slice(1).reduce((value, name) => value?.[name], scenario);
}

/** Puts a value at a pointer, or takes it away where it is undefined. */
export function write(scenario, pointer, value) {
  const names = pointer.split("/").slice(1);
  const last = names.pop();
  let place = scenario;
  for (const name of names) place = place[name] ??= {};
  if (value === undefined) delete place[last];
  else place[last] = value;
  if (value === undefined && names[0] === "until" && !Object.keys(place).length) delete scenario.until;
}

/** What was typed, as the scenario has it: a number, true, a list of numbers, or text with a unit. */
export function typed(pointer, text) {
  const own = text.trim();
  if (own === "") return undefined;
  if (/^\/cycles(\/normalized)?$/.test(pointer)) {
    return own.split(/[,;\s]+/).filter(Boolean).map((word) => (Number.isNaN(Number(word)) ? word : Number(word)));
  }
  if (own === "true") return true;
  return Number.isNaN(Number(own)) ? own : Number(own);
}

/** A value as it is typed. */
export const untyped = (value) => (value === undefined ? "" : Array.isArray(value) ? value.join(", ") : String(value));
