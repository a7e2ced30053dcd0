// The fields of the form. Each field edits one value of the scenario, named by its JSON pointer.

import { setValueAt, valueAt } from "../quantities/pointer.js";
import { inputAt, inputWords, isLine, plainWords, WORDS } from "../quantities/units.js";
import { FORMS } from "../quantities/words.js";

const LENGTH = ["length", "10 mm"];
/** The flat of a punch sticks or slips as a whole, so smaller ratios do not exist. */
const PUNCH_STICK_RATIO = 0.999;
/** Radii in metres of the example that a measured profile begins with: a ball of 10 mm. */
const RADII = Array.from({ length: 21 }, (_, i) => Number((i * 75e-6).toPrecision(3)));
const formsOf = (pointer) => FORMS.filter((form) => form.pointer === pointer);
/** The members of an example with their values. A name can be the path of an entry. */
const presetsOf = ({ shape, ...example }) => Object.entries(example).flatMap(([name, own]) => (Array.isArray(own) ? own.map((entry, i) => [`${name}/${i}`, entry]) : [[name, own]]));
/** Members of each shape: name and default. A power law can be round or a line. */
const SHAPES = Object.fromEntries(formsOf("/profile").map(({ example }) => [example.shape, presetsOf(example)]));
Object.assign(SHAPES, {
  power_line: [...SHAPES.power, LENGTH],
  table: [["radius", RADII], ["height", RADII.map((r) => (r * r) / 0.02)]],
});
const EXPLAINED = {
  slope_angle: "Measured from the plane. It is not half of the apex angle.",
  length: "The length of the line, across the motion.",
  "radii/0": "The radius of the cylinder whose axis lies along the motion.",
  "radii/1": "The radius of the other cylinder. The ratio of both radii is at most 1.5.",
  flat_half_width: "Half of the width of the flat, along the motion.",
  edge_radius: "The radius of the rounded edges.",
};
/** Whether a measured profile is still the example. */
export const isExample = ({ radius, height }) => SHAPES.table.every(([member, preset]) => JSON.stringify({ radius, height }[member]) === JSON.stringify(preset));

/** The members of a shape that are lists have an editor, not a field. */
const fieldsOf = (shape, profile) => (shape === "table" ? (isLine(profile) ? [LENGTH] : []) : SHAPES[shape]);
/** What the shapes of line contacts have in the scenario. */
const OF_SHAPE = { power_line: { shape: "power", geometry: "line" } };
const shapeWord = (shape) => {
  const own = OF_SHAPE[shape] ?? { shape };
  return `${WORDS[own.shape]}${isLine(own) ? " (line)" : ""}`;
};

/** The members of `cycles` that give the outputs by another quantity than numbers of cycles, and their units. */
const CYCLES_IN = { normalized: "N₀", dissipated_energy: "J" };
const cyclesIn = (cycles) => Object.keys(CYCLES_IN).find((name) => name in Object(cycles));

/** How a coefficient is given: as a number, as a run-in, or as a table, which has no fields. */
const courseOf = (value) => (Object(value) !== value ? "number" : "run_in" in value ? "run_in" : "changing");

/** The fields of a coefficient that changes in the first cycles. */
const runIn = (pointer, name) => [
  [`${pointer}/run_in/cycles`, "", null, `${name} changes evenly during these cycles. Then it stays constant.`],
  [`${pointer}/run_in/from`], [`${pointer}/run_in/to`]];

/** The optional members of the wear of both bodies together. */
const WEAR_OPTIONS = formsOf("/wear")[0].optional;
/** The hint of an optional number, with the ends of a plain one. */
const hintOf = (pointer) => `(${[inputAt(pointer)[3].slide?.join(" to "), "optional"].filter(Boolean).join(", ")})`;

const layersOf = ({ wear }, body) => wear?.bodies?.[body]?.layers ?? [];
const hasLayers = (scenario) => [0, 1].some((body) => layersOf(scenario, body).length > 0);

/** What the simplified rule lacks in a scenario; undefined if it applies. */
const ruleLacks = (scenario) => (isLine(scenario.profile) ? "a round contact"
  : [scenario.friction, scenario.wear?.coefficient].some((value) => courseOf(value) !== "number") ? "constant coefficients"
    : hasLayers(scenario) ? "bodies without layers"
      : "loop_aperture" in { ...scenario.motion, ...scenario.motion?.blocks?.[0] } ? "a motion without a held aperture" : undefined);

const PER_LENGTH = "The force on the whole length, such as 100\u00a0N, or per length, such as 18.5\u00a0N/mm.";
const LAYER = { thickness: "3 um", coefficient: "1e-6 mm^3/(N m)" };

/** What a motion is given by: the member that tells it from the others. */
const MOTIONS = formsOf("/motion").map((form) => ({ ...form, lead: Object.keys(form.example)[0] }));
const motionWords = (lead) => plainWords(inputWords(`/motion/${lead}`));
/** The field of a motion, with the first sentence about it. */
const leadField = (lead, explanation = inputAt(`/motion/${lead}`)[4].split(/(?<=\.) /)[0]) => [`/motion/${lead}`, "", null, explanation];

/** The fields of a motion of a line contact. */
function lineMotion({ lead, optional }) {
  const stroke = (explanation) => ["/motion/amplitude", "(half the stroke)", null, explanation];
  const loops = optional.includes("reference_distance")
    ? [["/motion/reference_distance", "(optional)", null, "With it, the result has the displacements of the loops."]] : [];
  return {
    amplitude: [stroke("At the contact, or at the actuator if the rig has a stiffness."),
      ["/motion/reference_distance", "", null,
        "The distance from the middle of the contact to the points whose relative motion is the stroke."],
      ["/motion/rig_stiffness", "(optional)", null,
        "The stiffness between actuator and contact, such as 10\u00a0N/um, or per length, such as 2000\u00a0N/mm/mm."]],
    loop: [stroke("As measured in the loop."), ["/motion/loop_stiffness", "", null,
      "The slope dQ/dU of a measured loop just after a reversal, such as 10\u00a0N/um, or per length, such as 2000\u00a0N/mm/mm."]],
    stick_ratio: [leadField(lead, "The unworn contact gives the tangential force, which stays constant."), ...loops],
    tangential_force: [leadField(lead, `${PER_LENGTH} It stays constant.`), ...loops],
  }[lead] ?? [leadField(lead), ...loops];
}

/** The fields of a motion of a round contact. */
const roundMotion = ({ lead, optional }) => [
  lead === "amplitude" ? ["/motion/amplitude", "(half the stroke)"]
    : ["stick_ratio", "tangential_force"].includes(lead) ? [`/motion/${lead}`] : leadField(lead),
  ...(optional.includes("held") ? [["/motion/held", "During the test, keep constant", {
    "": lead === "tangential_force" ? "Tangential force (usual)" : "Amplitude (usual)",
    amplitude: "Amplitude", tangential_force: "Tangential force" }], ["/motion/rig_stiffness", "(optional)"]] : [])];

const isPerLength = (value) => /\/(m|mm|in)$/.test(value);

/** Gives a scenario what its new geometry requires. */
function fitGeometry({ profile, moduli, load, motion }) {
  if (isLine(profile)) {
    const { amplitude, loop_stiffness } = { ...motion, ...motion?.blocks?.[0] };
    if (amplitude !== undefined && loop_stiffness === undefined) motion.reference_distance ??= "10 mm";
    return;
  }
  delete motion?.reference_distance;
  if (moduli) moduli.tangential ??= "92.8 GPa";
  if (isPerLength(load?.normal_force)) load.normal_force = "100 N";
  if (isPerLength(motion?.tangential_force)) motion.tangential_force = "15 N";
}

const STEEL = () => ({ youngs_modulus: "205 GPa", poisson_ratio: 0.3 });

/**
 * Drop-down lists that decide which fields follow. `selected` reads the option from a scenario, `apply` changes the
 * scenario to an option, and `fields` lists the fields of an option as `[pointer, hint, options, explanation]`. `lacks` lists
 * the options that do not apply to a scenario, and `reason` explains this. A choice without `applies` is always shown.
 */
export const CHOICES = [
  {
    id: "shape", group: "Contact", label: "Shape",
    options: Object.fromEntries(Object.keys(SHAPES).map((shape) => [shape, shapeWord(shape)])),
    selected: ({ profile }) => (profile?.shape === "power" && isLine(profile) ? "power_line" : profile?.shape),
    apply: (scenario, shape) => {
      const before = scenario.profile;
      scenario.profile = { shape, ...OF_SHAPE[shape], ...(shape === "crossed_cylinders" && { radii: [] }) };
      for (const [member, preset] of SHAPES[shape]) {
        const kept = valueAt(before ?? {}, `/${member}`);
        // The radii of a measured profile are no radius, and the reverse.
        setValueAt(scenario.profile, `/${member}`, kept === undefined || Array.isArray(kept) !== Array.isArray(preset) ? structuredClone(preset) : kept);
      }
      if (isLine(scenario.profile) !== isLine(before)) fitGeometry(scenario);
      if (shape === "punch" && scenario.motion?.stick_ratio !== undefined) scenario.motion.stick_ratio = PUNCH_STICK_RATIO;
    },
    edits: (shape) => (shape === "table" ? ["/profile/radius", "/profile/height"] : []),
    fields: (shape, { profile }) => fieldsOf(shape, profile).map(([member]) => [`/profile/${member}`, "", null, EXPLAINED[member]]),
  },
  {
    id: "elasticity", group: "Material", label: "Elastic constants",
    options: { bodies: "Of each body", moduli: "Effective moduli" },
    selected: (scenario) => (scenario.moduli ? "moduli" : "bodies"),
    apply: (scenario, kind) => {
      delete scenario.bodies;
      delete scenario.moduli;
      scenario[kind] = kind === "bodies" ? [STEEL(), STEEL()] : { normal: "112.6 GPa" };
      fitGeometry(scenario);
    },
    fields: (kind, { profile }) => kind === "moduli"
      ? [["/moduli/normal"], ...(isLine(profile) ? [] : [["/moduli/tangential"]])]
      : [0, 1].flatMap((i) => ["youngs_modulus", "poisson_ratio", "yield_strength"].map((name) => [`/bodies/${i}/${name}`])),
  },
  {
    id: "wear", group: "Material", label: "Wear law",
    options: { coefficient: "Coefficient k_w", run_in: "k_w with run-in", hardness: "Archard: k and hardness",
      changing: "k_w from a table", energy: "Energy coefficient α", bodies: "Bodies with layers" },
    selected: ({ wear }) => {
      const course = courseOf(wear?.coefficient);
      if ("bodies" in Object(wear)) return "bodies";
      if ("energy_coefficient" in Object(wear)) return "energy";
      if ("hardness" in Object(wear)) return course === "number" ? "hardness" : "changing_hardness";
      return course === "number" ? "coefficient" : course;
    },
    apply: (scenario, kind) => {
      const kept = Object.entries(scenario.wear ?? {}).filter(([name]) => WEAR_OPTIONS.includes(name));
      scenario.wear = {
        coefficient: { coefficient: "3.03e-5 mm^3/(N m)" },
        run_in: { coefficient: { run_in: { cycles: 1000, from: "1e-4 mm^3/(N m)", to: "3.03e-5 mm^3/(N m)" } } },
        changing: { coefficient: { over: "cycles", at: [0, 10000], values: ["1e-4 mm^3/(N m)", "3.03e-5 mm^3/(N m)"] } },
        hardness: { coefficient: 1e-4, hardness: "3 GPa" },
        energy: { energy_coefficient: "4.3e-5 mm^3/J" },
        bodies: { bodies: [{ coefficient: "3.03e-5 mm^3/(N m)" },
          { layers: [{ ...LAYER }], coefficient: "3.03e-5 mm^3/(N m)" }] },
      }[kind];
      Object.assign(scenario.wear, Object.fromEntries(kept));
    },
    edits: (kind) => (kind === "changing" ? ["/wear/coefficient"] : []),
    fields: (kind) => [
      ...{
        coefficient: [["/wear/coefficient"]],
        run_in: runIn("/wear/coefficient", "k_w"),
        bodies: [],
        changing: [],
        hardness: [["/wear/coefficient"], ["/wear/hardness"]],
        energy: [["/wear/energy_coefficient"]],
      }[kind],
      ...(kind === "bodies" ? [] : WEAR_OPTIONS.map((name) => [`/wear/${name}`, hintOf(`/wear/${name}`)]))],
  },
  ...[0, 1].map((body) => ({
    id: `layers-${body + 1}`, group: "Material", label: `Body ${body + 1}: layers`,
    applies: ({ wear }) => Array.isArray(wear?.bodies),
    options: { 0: "None", 1: "1 layer", 2: "2 layers", 3: "3 layers" },
    selected: (scenario) => String(layersOf(scenario, body).length),
    apply: ({ wear }, count) => {
      const own = (wear.bodies[body] ??= {});
      own.layers = Array.from({ length: Number(count) }, (_, i) => own.layers?.[i] ?? { ...LAYER });
      if (!own.layers.length) delete own.layers;
    },
    fields: (count) => {
      const pointer = `/wear/bodies/${body}`;
      const layers = Array.from({ length: Number(count) }, (_, i) => [
        [`${pointer}/layers/${i}/thickness`, "", null,
          i === 0 && "Layer 1 is at the surface. The next layer wears where it is worn through."],
        [`${pointer}/layers/${i}/coefficient`]]);
      return [...layers.flat(), [`${pointer}/coefficient`, "", null, "Enter 0 for a material that does not wear."]];
    },
  })),
  {
    id: "friction-kind", group: "Material", label: "Friction",
    options: { number: "Constant", run_in: "Run-in", changing: "Table" },
    selected: ({ friction }) => courseOf(friction),
    apply: (scenario, kind) => {
      scenario.friction = { number: 0.7, run_in: { run_in: { cycles: 1000, from: 0.2, to: 0.7 } },
        changing: { over: "cycles", at: [0, 10000], values: [0.3, 0.7] } }[kind];
    },
    edits: (kind) => (kind === "changing" ? ["/friction"] : []),
    fields: (kind) => ({ number: [["/friction"]], run_in: runIn("/friction", "μ"), changing: [] })[kind],
  },
  {
    id: "load", group: "Load and motion", label: "Load",
    options: { normal_force: "Normal force F", indentation_depth: "Indentation depth d" },
    lacks: ({ profile }) => (isLine(profile) ? ["indentation_depth"] : []),
    reason: "A line contact holds the force, because its depth depends on the size of the bodies.",
    selected: ({ load }) => ("indentation_depth" in Object(load) ? "indentation_depth" : "normal_force"),
    apply: (scenario, kind) => {
      const { held } = scenario.load ?? {};
      scenario.load = { [kind]: kind === "normal_force" ? "100 N" : "3.5 um", ...(held && { held }) };
    },
    fields: (kind, { profile }) => (isLine(profile) ? [["/load/normal_force", "", null, PER_LENGTH]]
      : [[`/load/${kind}`],
      ["/load/held", "During the test, keep constant",
        { "": kind === "normal_force" ? "Force (usual)" : "Depth (usual)", force: "Force (dead weight)", depth: "Depth (press fit)" }]]),
  },
  {
    id: "motion", group: "Load and motion", label: "Motion",
    options: Object.fromEntries(MOTIONS.flatMap(({ lead }) => [[lead, motionWords(lead)],
      ...(lead === "amplitude" ? [["loop", `${motionWords(lead)}, loop stiffness`]] : [])])),
    lacks: (scenario) => [...MOTIONS.filter(({ geometry }) => geometry && (geometry === "line") !== isLine(scenario.profile)).map(({ lead }) => lead),
      ...(isLine(scenario.profile) ? [] : ["loop"]), ...(hasLayers(scenario) ? ["blocks"] : [])],
    reason: (scenario) => hasLayers(scenario) && "Layers need one amplitude. Remove them for amplitude blocks.",
    selected: ({ motion }) => {
      const lead = MOTIONS.findLast((own) => own.lead in Object(motion))?.lead ?? "amplitude";
      return lead === "amplitude" && motion?.loop_stiffness !== undefined ? "loop" : lead;
    },
    apply: (scenario, kind) => {
      const { amplitude = "2.256 um" } = scenario.motion ?? {};
      const example = structuredClone(MOTIONS.find(({ lead }) => lead === kind)?.example);
      const line = isLine(scenario.profile);
      scenario.motion = { ...example, ...{
        amplitude: { amplitude, ...(line && { reference_distance: "10 mm" }) },
        loop: { amplitude, loop_stiffness: "10 N/um" },
        stick_ratio: scenario.profile?.shape === "punch" && { stick_ratio: PUNCH_STICK_RATIO },
        tangential_force: line && { tangential_force: "1.5 N/mm" },
        blocks: line && { blocks: ["1.5 N/mm", "1 N/mm"].map((own) => ({ tangential_force: own, cycles: 50000 })) },
      }[kind] };
    },
    edits: (kind) => (["blocks", "reversals"].includes(kind) ? [`/motion/${kind}`] : []),
    fields: (kind, { profile }) => {
      const form = MOTIONS.find(({ lead }) => lead === kind) ?? { lead: kind, optional: [] };
      return Array.isArray(form.example?.[kind]) ? [] : (isLine(profile) ? lineMotion : roundMotion)(form);
    },
  },
  {
    id: "cycles-kind", group: "Duration", label: "Output cycles",
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
      ["/until/wear_depth", "(optional)", null, "The largest depth, of both bodies together."]];
    },
  },
  {
    id: "method", group: "Model", label: "Method",
    options: { exact: "Exact method", simplified: "Simplified rule" },
    lacks: (scenario) => (ruleLacks(scenario) ? ["simplified"] : []),
    reason: (scenario) => `The simplified rule is not available. It needs ${ruleLacks(scenario)}.`,
    selected: ({ model = {} }) => model.method ?? "exact",
    apply: (scenario, method) => {
      const { points } = scenario.model ?? {};
      scenario.model = { method, ...(points && { points }) };
    },
    fields: (method, scenario) => [["/model/points", "(optional)"],
      ...(method === "exact" ? [["/model/tolerance", "(optional)", null, "The error that the method aims at: 0.003 if empty. A smaller one takes longer."],
        ...(ruleLacks(scenario) ? [] : [["/model/compare", "", { "": "No", true: "Yes" }]])]
        : [["/model/xi", "(optional)"]])],
  },
];

/** The choices of a scenario. */
export const choicesOf = (scenario) => CHOICES.filter(({ applies }) => applies?.(scenario) ?? true);

/** A field with its label: the name of the input with a hint in brackets, or a text of its own. */
export const labelled = ([pointer, hint = "", ...rest], scenario) => [pointer,
  hint && !hint.startsWith("(") ? hint : `${plainWords(inputWords(pointer, scenario))} ${hint}`.trim(), ...rest];

/** The options of a choice that apply to a scenario, and the reason why others do not. */
export function optionsOf({ options, lacks, reason }, scenario) {
  const missing = lacks?.(scenario) ?? [];
  return [Object.fromEntries(Object.entries(options).filter(([name]) => !missing.includes(name))),
    missing.length > 0 && (typeof reason === "function" ? reason(scenario) : reason)];
}

/**
 * Chooses an option. The values and ranges of fields that disappear leave the scenario and the study. Other choices leave options that no
 * longer apply. `hidden` keeps what each option that was left has lost since, and gives it back when the option is chosen again.
 */
export function chooseOption(choice, { scenario, study, hidden }, option) {
  const before = shownOf(scenario, study);
  choice.apply(scenario, option);
  for (const other of choicesOf(scenario)) {
    const selected = other.selected(scenario);
    const [options] = optionsOf(other, scenario);
    if (selected in other.options && !(selected in options)) other.apply(scenario, Object.keys(options)[0]);
  }
  giveBack(hidden[choice.id]?.[option] ?? { values: {}, options: {} }, scenario, study);
  const after = shownOf(scenario, study);
  const gone = Object.keys(before.values).filter((pointer) => !(pointer in after.values));
  for (const pointer of gone) {
    const isOutside = !Object.keys(after.values).some((own) => own.startsWith(`${pointer}/`));
    if (isOutside && valueAt(scenario, pointer) !== undefined) setValueAt(scenario, pointer, undefined);
    delete study.ranges[pointer];
  }
  const lost = { values: Object.entries(before.values).filter(([pointer, own]) => own.value !== undefined && JSON.stringify(own) !== JSON.stringify(after.values[pointer])),
    options: Object.entries(before.options).map(([id, was]) => [id, { was, became: after.options[id] }]).filter(([, { was, became }]) => was !== became) };
  // What an option passed on to the next one can be lost by a later one.
  const all = (hidden[choice.id] = { ...hidden[choice.id], [before.options[choice.id]]: {} });
  delete all[option];
  for (const own of Object.values(all)) for (const part of ["values", "options"]) own[part] = { ...Object.fromEntries(lost[part]), ...own[part] };
}

/** The options of a scenario, and the values and ranges that have fields or editors. */
const shownOf = (scenario, study) => structuredClone({ options: Object.fromEntries(choicesOf(scenario).map((choice) => [choice.id, choice.selected(scenario)])),
  values: Object.fromEntries(withField(scenario).map((pointer) => [pointer, { value: valueAt(scenario, pointer), range: study.ranges[pointer] }])) });

/** Gives back what was lost when an option was left. An option of another choice that was chosen meanwhile stays. */
function giveBack(lost, scenario, study) {
  for (const other of choicesOf(scenario)) {
    const { was, became } = lost.options[other.id] ?? {};
    if (was in optionsOf(other, scenario)[0] && [undefined, other.selected(scenario)].includes(became)) other.apply(scenario, was);
  }
  for (const [pointer, { value, range }] of Object.entries(structuredClone(lost.values)).filter(([own]) => withField(scenario).includes(own))) {
    setValueAt(scenario, pointer, value);
    if (range) study.ranges[pointer] = range;
  }
}

/** Pointers of the values that the form shows as fields or in editors. */
const withField = (scenario) => choicesOf(scenario).flatMap((choice) => {
  const kind = choice.selected(scenario);
  return kind in optionsOf(choice, scenario)[0] ? [...choice.fields(kind, scenario).map(([pointer]) => pointer), ...(choice.edits?.(kind) ?? [])] : [];
});

/** Pointers of the values that the form cannot show as fields. They are edited as JSON. */
export function withoutField(scenario) {
  const known = ["/profile/shape", "/profile/geometry", "/model/method", ...withField(scenario)];
  // A list without fields is one value.
  const isWhole = (value, pointer) => Object(value) !== value
    || (Array.isArray(value) && !known.some((own) => own.startsWith(`${pointer}/`)));
  const values = (value, pointer) => known.includes(pointer) ? [] : isWhole(value, pointer) ? [pointer]
    : Object.entries(value).flatMap(([name, own]) => values(own, `${pointer}/${name}`));
  return values(scenario, "");
}
