// Numbers for people: µm, mm³, MPa, mJ and N, or SI. The server's numbers are SI.

/** What a unit of the server is to an engineer: name and factor. */
const ENGINEERING = {
  m: ["µm", 1e6],
  "m^3": ["mm³", 1e9],
  Pa: ["MPa", 1e-6],
  J: ["mJ", 1e3],
  "1/Pa": ["mm³/(N m)", 1e9],
  "N/m": ["N/µm", 1e-6],
  rad: ["deg", 180 / Math.PI],
};

const NAMES = { "1": "", "m^3": "m³" };

/** The unit of each member of an answer that does not say it for itself. */
export const UNITS = {
  contact_radius: "m", stick_radius: "m", scar_radius: "m", indentation_depth: "m", amplitude: "m",
  wear_depth: "m", wear_volume: "m^3", normal_force: "N", tangential_force: "N", dissipated_energy: "J",
  energy_per_cycle: "J", radius: "m", flat_radius: "m", slope_angle: "rad", friction: "1",
  wear_coefficient: "1/Pa", normal_modulus: "Pa", peak_pressure: "Pa", cycles: "1", rig_stiffness: "N/m",
};

/** What members are called. */
export const WORDS = {
  worn: "Worn profile", wear: "Wear", pressure: "Pressure", slip: "Slip", image: "Image",
  initial: "initial", limiting: "limiting", radius: "Radius r", cycles: "Cycles N",
  wear_volume: "Wear volume", wear_depth: "Wear depth", scar_radius: "Scar radius",
  contact_radius: "Contact radius", stick_radius: "Stick radius", normal_force: "Normal force",
  tangential_force: "Tangential force", indentation_depth: "Depth", amplitude: "Amplitude",
  energy_per_cycle: "Energy per cycle", dissipated_energy: "Dissipated energy", displacement: "Displacement",
  paraboloid: "Paraboloid", sphere: "Sphere", cone: "Cone", power: "Power law", table: "Measured table",
  truncated_paraboloid: "Truncated paraboloid", truncated_cone: "Truncated cone",
  full_stick: "full stick", partial_slip: "partial slip", gross_slip: "gross slip",
  simplified: "simplified rule", exact: "exact method",
  true: "pinned", contact_lost: "contact lost", shakedown: "shakedown", until_reached: "end reached", rim_reached: "rim reached",
};

let isSi = localStorage.getItem("fretwork-units") === "si";

/** Whether numbers are shown in SI. */
export const si = () => isSi;

export function useSi(yes) {
  isSi = yes;
  localStorage.setItem("fretwork-units", yes ? "si" : "engineering");
}

/** The name and the factor of a unit as it is shown now. */
export function shown(unit) {
  return (!isSi && ENGINEERING[unit]) || [NAMES[unit] ?? unit ?? "", 1];
}

/** A number in digits that people read: as few as tell it. */
export function digits(value, count = 4) {
  if (value == null || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-3) {
    const [mantissa, exponent] = value.toExponential(count - 1).split("e");
    return `${Number(mantissa)}·10${raised(exponent)}`.replace("-", "−");
  }
  return String(Number(value.toPrecision(count))).replace("-", "−");
}

const raised = (exponent) =>
  String(Number(exponent)).replace("-", "⁻").replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]);

/** A quantity with its unit. */
export function quantity(value, unit, count = 4) {
  let [name, factor] = shown(unit);
  if (name === "µm" && Math.abs(value) >= 1e-3) [name, factor] = ["mm", 1e3];
  const text = digits(value == null ? null : value * factor, count);
  // What belongs together stays on one line.
  return name && text !== "–" ? `${text}\u00a0${name.replace(" ", "\u00a0")}` : text;
}

/** A column as it is shown; what is null stays null. */
export function column(values, unit) {
  const [, factor] = shown(unit);
  return values.map((value) => (value == null ? value : value * factor));
}

/** A quantity's name with its unit, for an axis. */
export function axis(name, unit) {
  const [shownUnit] = shown(unit);
  return shownUnit ? `${name}, ${shownUnit}` : name;
}

/** A part of one in percent. */
export const percent = (part, count = 3) => (part == null ? "–" : `${digits(100 * part, count)}\u00a0%`);

/** A stretch of time: 0.4 s, 12 s, 3 min 20 s, 2 h 5 min. */
export function span(seconds) {
  if (seconds < 10) return `${digits(seconds, 2)}\u00a0s`;
  const [hours, minutes, rest] = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, Math.floor(seconds % 60)];
  const words = [[hours, "h"], [minutes, "min"], [rest, "s"]].filter(([count]) => count > 0).slice(0, 2);
  return words.map(([count, name]) => `${count}\u00a0${name}`).join(" ");
}

/** Cycles, whole ones from a thousand on, with narrow spaces. */
export const cycles = (given) => {
  const value = given >= 1000 ? Math.round(given) : given;
  return Number.isInteger(value) ? String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f") : digits(value, 6);
};
