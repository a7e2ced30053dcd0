// Reads numbers as people type and paste them: 0,7 · 1 000 · 3.03×10⁻⁵ mm³/Nm. Says how it read what is ambiguous.

import { factorIn, inUnitOf, pretty, written } from "./kinds.js";

const SPACE = "[ '’\\u00a0\\u2007\\u2009\\u202f]";
const SIGN = "[-+−–]";
/** Digits in groups of three, with decimal points or commas. */
const MANTISSA = `${SIGN}?(?:\\d+(?:${SPACE}\\d{3}(?!\\d))*(?:[.,]\\d*)*|[.,]\\d+)`;
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
/** A power of ten: e-5, ×10⁻⁵, ·10^-5 or x10-5. */
const POWER = `(?:[eE](?<e>${SIGN}?\\d+)|\\s*[×·⋅*xX]\\s*10(?:\\^?\\s*\\(?(?<plain>${SIGN}?\\d+)\\)?|(?<raised>[⁺⁻]?[${SUPERSCRIPTS}]+)))`;
const NUMBER = new RegExp(`^(?<mantissa>${MANTISSA})${POWER}?`, "u");

/** A power of ten alone: 10³, 10^-5. */
const ALONE = new RegExp(`^(${SIGN}?)10(?:\\^(${SIGN}?\\d+)|([⁺⁻]?[${SUPERSCRIPTS}]+))`, "u");

const plainSign = (text) => text.replace(/[−–⁻]/, "-").replace(/[+⁺]/, "");
const plainPower = (text) => plainSign(text).replace(/[⁰¹²³⁴⁵⁶⁷⁸⁹]/g, (digit) => SUPERSCRIPTS.indexOf(digit));

/** Digits with a decimal point, and their other reading if there is one; undefined if the separators contradict. Thousands have no power. */
function plainDigits(text, hasPower) {
  const isGrouped = new RegExp(`\\d${SPACE}\\d`).test(text);
  const digits = text.replace(new RegExp(SPACE, "g"), "").replace(/[.,]$/, "");
  const marks = digits.match(/[.,]/g) ?? [];
  const decimal = (mark) => digits.replaceAll(mark === "," ? "." : ",", "").replace(mark, ".");
  const whole = () => (/^[-+−–]?\d{1,3}([.,]\d{3})+$/.test(digits) ? [digits.replace(/[.,]/g, "")] : undefined);
  if (marks.length === 0) return [digits];
  if (new Set(marks).size === 2) return marks.indexOf(marks.at(-1)) === marks.length - 1 ? [decimal(marks.at(-1))] : undefined;
  if (marks.length > 1) return whole();
  // A mark before three digits is a decimal mark or separates thousands. People who write 1,000 mean 1000, and the API reads 1.000 as 1.
  const thousands = !hasPower && !isGrouped && !/^[-+−–]?0/.test(digits) && whole();
  if (!thousands) return [decimal(marks[0])];
  return digits.endsWith(",000") ? [thousands[0], String(Number(decimal(",")))] : [decimal(marks[0]), thousands[0]];
}

/** The number at the start of a text, as the API writes it, its other reading, and the rest; undefined if there is none. */
export function readNumber(text) {
  const trimmed = text.trim().replace(ALONE, (_, sign, plain, raised) => `${sign}1e${plainPower(plain ?? raised)}`);
  const found = trimmed.match(NUMBER);
  const { mantissa, e, plain, raised } = found?.groups ?? {};
  const power = e ?? plain ?? raised;
  const [digits, other] = (found && plainDigits(mantissa, power !== undefined)) ?? [];
  if (!digits) return undefined;
  return { number: plainSign(digits) + (power === undefined ? "" : `e${plainPower(power)}`), other: other && plainSign(other), rest: trimmed.slice(found[0].length).trim() };
}

/** The question of a separator that has two meanings. */
const spelling = (read, other) => ({ isSpelling: true, instead: { question: `Read as ${read}. Did you mean ${pretty(other)}?`, read, value: other } });

/** A number with its unit as a scenario has it. */
const valueOf = (number, unit) => (unit ? `${number} ${unit}` : Number(number));

/**
 * What a text means in a field of a kind: the value of the scenario, a note if the reading is not obvious, and a question if the
 * user may have meant something else, with that value if it is known. The program itself writes separators that are not doubtful.
 */
export function understand(text, kind, isTyped = true) {
  const read = readNumber(text);
  if (!read) return { value: text.trim() };
  if (read.rest === "%" && !kind.unit) {
    const value = Number((read.number / 100).toPrecision(12));
    return { value, note: `Read as ${pretty(value)}.` };
  }
  const unit = read.rest || kind.unit;
  const value = valueOf(read.number, unit);
  const shown = pretty(value);
  // The thousands of a number with a decimal point count if a contact has such a size.
  const most = (kind.usual ?? kind.slide ?? [Infinity]).at(-1);
  const isOther = isTyped && read.other && (text.includes(",") || Math.abs(read.other) * (factorIn(kind, unit) ?? 1) <= most);
  if (isOther) return { value, note: `Read as ${shown}.`, ...spelling(pretty(valueOf(Number(read.number), unit)), valueOf(read.other, unit)) };
  const meant = suspect(read, unit, kind);
  const question = meant?.value === undefined ? "Is this right? It is unusual." : `Did you mean ${pretty(meant.value)}${meant.told}?`;
  if (meant) return { value, note: "", instead: { question: `${shown}. ${question}`, value: meant.value } };
  const inField = pretty(written(value, kind));
  return { value, note: (!read.rest && kind.unit) || inField !== shown ? `Read as ${inField}.` : "" };
}

/**
 * The value that is probably meant instead of one that no contact has, or few, in the unit of the field or as typed; without a value if
 * there is none; undefined if nothing is doubtful. A number without a unit is doubted sooner.
 */
function suspect({ number, rest }, unit, kind) {
  const [from, to] = kind.slide ?? [];
  const share = Number((number / 100).toPrecision(12));
  if (!rest && number > to) return to < 2 && share >= from && share <= to ? { value: share, told: ` (${number} %)` } : {};
  const size = Math.abs(number) * (factorIn(kind, unit) ?? NaN);
  const [low, small, large, most] = kind.usual ?? [];
  const least = rest ? low : kind.bare;
  const isUsual = (si) => si >= least && si <= most;
  const isCommon = (si) => isUsual(si) && si >= small && si <= large;
  if (!kind.usual || !(size > 0) || isCommon(size)) return undefined;
  const meant = [kind.likely ?? kind.unit, ...Object.keys(kind.units)].find((name) => isCommon(Math.abs(number) * kind.units[name]));
  if (!meant) return isUsual(size) ? undefined : {};
  const [value, inField] = [valueOf(number, meant), inUnitOf(kind, number * kind.units[meant])];
  // The unit of the field, unless only this needs a power of ten.
  const isShort = /e/.test(inField) && !/e/.test(value);
  return meant === kind.unit || isShort ? { value, told: "" } : { value: inField, told: ` (${pretty(value)})` };
}

/** What a text means in a field of a list. It can be one number, such as 1,5 J or 1.000. */
export function understandList(text, isTyped = true) {
  const value = readList(text);
  const read = value.map(pretty).join(", ");
  const { other, rest } = readNumber(text) ?? {};
  const isOne = isTyped && (value.length === 1 ? other : value.length === 2 && /^\s*\d{1,3},\d{1,3}(?![\d,;])/.test(text));
  const one = (other ? `${other} ${rest}` : text.replace(",", ".")).trim();
  return { value, note: read.replace(/\s/g, "") === text.replace(/\s/g, "") ? "" : `Read as ${read}.`, ...(isOne && spelling(read, one)) };
}

/** The numbers of a list: 1000, 2000 · 1 000; 2 000 · 0,5; 1,5 · 1000 2000. Texts that are no number stay as they are. */
export function readList(text) {
  const items = listItems(text.trim());
  return items.map((item) => {
    const read = readNumber(item);
    if (!read) return item;
    return valueOf(read.number, read.rest);
  });
}

function listItems(text) {
  if (/[;\n\t]/.test(text)) return text.split(/\s*[;\n\t]\s*/).filter(Boolean);
  // In "1,000, 2,000" the commas without a space separate thousands.
  if (/,\s/.test(text) && /\d,\d{3}(?!\d)/.test(text)) return text.split(/\s*,\s+/).filter(Boolean);
  if (text.includes(",")) return /^\d{1,3}(,000)+$/.test(text) ? [text] : text.split(/\s*,\s*/).filter(Boolean);
  // Spaces separate numbers, unless all of them group digits.
  if (new RegExp(`^${MANTISSA}$`, "u").test(text)) return [text];
  return text.split(/\s+(?=[-+.\d])/).filter(Boolean);
}
