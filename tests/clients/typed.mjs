// Tests how the form of the dashboard reads what is typed.
//
//     node typed.mjs http://127.0.0.1:8080

import assert from "node:assert/strict";
import { register } from "node:module";

// The server writes quantities/words.js.
const served = await (await fetch(`${process.argv[2]}/assets/quantities/words.js`)).text();
const words = `data:text/javascript,${encodeURIComponent(served)}`;
register(`data:text/javascript,${encodeURIComponent(`export const resolve = (name, context, next) => name === "./words.js"
  ? { url: ${JSON.stringify(words)}, shortCircuit: true } : next(name, context);`)}`);
const page = (name) => import(`../../src/http/dashboard/${name}.js`);
const { fieldText, kindAt } = await page("quantities/kinds");
const { useSi } = await page("quantities/system");
const { csvCell } = await page("page/csv");
const { readList, readNumber, understand, understandList } = await page("quantities/typed");

const scenario = { wear: {} };
const value = (pointer, text) => understand(text, kindAt(pointer, scenario)).value;
const question = (pointer, text) => understand(text, kindAt(pointer, scenario)).instead?.question.replaceAll("\u00a0", " ");

// A number without a unit has the unit of its field.
for (const [pointer, text, expected] of [
  ["/motion/amplitude", "2", "2 um"],
  ["/motion/blocks/3/amplitude", "2", "2 um"],
  ["/profile/radius", "10", "10 mm"],
  ["/bodies/1/youngs_modulus", "205", "205 GPa"],
  ["/wear/coefficient", "3.03e-5", "3.03e-5 mm^3/(N m)"],
  ["/wear/coefficient/run_in/from", "1e-4", "1e-4 mm^3/(N m)"],
  ["/wear/bodies/0/layers/1/coefficient", "1e-6", "1e-6 mm^3/(N m)"],
  ["/wear/energy_coefficient", "4e-5", "4e-5 mm^3/J"],
  ["/load/normal_force", "1 000", "1000 N"],
  ["/motion/rig_stiffness", "30", "30 N/um"],
  ["/profile/slope_angle", "2", "2 deg"],
  ["/until/wear_depth", "1", "1 um"],
  ["/friction", "0,7", 0.7],
  ["/motion/stick_ratio", ".5", 0.5],
  ["/motion/amplitude", "2,5 µm", "2.5 µm"],
  ["/motion/amplitude", "−2 um", "-2 um"],
  ["/motion/amplitude", "some", "some"],
  ["/profile/radius", "10mm", "10 mm"],
  ["/friction", "0.7 mm", "0.7 mm"],
]) assert.equal(value(pointer, text), expected, `${pointer} ${text}`);
assert.equal(understand("1e-4", kindAt("/wear/coefficient", { wear: { hardness: "3 GPa" } })).value, 1e-4);

// Powers of ten, as the page and papers write them.
for (const text of ["3.03×10⁻⁵ mm³/Nm", "3.03·10^-5 mm³/Nm", "3.03 × 10^(−5) mm³/Nm", "3.03x10-5 mm³/Nm", "3,03*10⁻⁵ mm³/Nm", "3.03e−5 mm³/Nm",
  "3.03·10⁻⁵\u00a0mm³/Nm"]) assert.equal(value("/wear/coefficient", text), "3.03e-5 mm³/Nm", text);

// A power of ten alone, also in a list, and a share of a number without a unit.
for (const [text, number] of [["10³", "1e3"], ["−10⁻⁵ mm³/Nm", "-1e-5"], ["10^5 N", "1e5"], ["10", "10"]]) assert.equal(readNumber(text).number, number, text);
assert.deepEqual(readList("10³, 10⁴"), [1000, 10000]);
assert.equal(value("/friction", "70 %"), 0.7);

// Groups of three digits.
for (const [text, number] of [["1 000", "1000"], ["1\u202f000", "1000"], ["1\u2009000", "1000"], ["1\u00a0000\u00a0000", "1000000"], ["1,000,000", "1000000"],
  ["1.000.000", "1000000"], ["1,234.5", "1234.5"], ["1.234,5", "1234.5"], ["1 000,5", "1000.5"], ["1,000", "1000"], ["2,256", "2.256"],
  ["0,700", "0.700"], ["1'000", "1000"], ["2.", "2"], ["30 1/Pa", "30"]]) assert.equal(readNumber(text).number, number, text);
for (const text of ["1,00,000", "1.2.3", "1,2.3,4", "plenty", ""]) assert.equal(readNumber(text), undefined, text);

// What is doubtful is asked.
assert.equal(question("/motion/amplitude", "2 m"), "2 m. Did you mean 2 µm?");
assert.equal(question("/motion/amplitude", "2e-6"), "2e−6 µm. Did you mean 2 µm (2e−6 m)?");
assert.equal(question("/wear/coefficient", "3.03e-5 1/Pa"), "3.03e−5 1/Pa. Did you mean 3.03e−5 mm³/(N m)?");
assert.equal(question("/bodies/0/youngs_modulus", "205000"), "205000 GPa. Did you mean 205 GPa (205000 MPa)?");
assert.equal(question("/profile/radius", "0.01"), "0.01 mm. Did you mean 10 mm (0.01 m)?");
assert.equal(question("/profile/radius", "0.01 mm"), undefined);
for (const [pointer, text, expected] of [
  // A mark before three digits.
  ["/load/normal_force", "1,000", "Read as 1000 N. Did you mean 1 N?"],
  ["/load/normal_force", "1.000", "Read as 1 N. Did you mean 1000 N?"],
  ["/load/normal_force", "1.250 N", "Read as 1.25 N. Did you mean 1250 N?"],
  ["/profile/radius", "1,000", "Read as 1000 mm. Did you mean 1 mm?"],
  ["/motion/amplitude", "1,234", "Read as 1.234 µm. Did you mean 1234 µm?"],
  ["/motion/amplitude", "1.234", "Read as 1.234 µm. Did you mean 1234 µm?"],
  ["/motion/amplitude", "2,256", "Read as 2.256 µm. Did you mean 2256 µm?"],
  ["/motion/blocks/0/cycles", "10.000", "Read as 10. Did you mean 10000?"],
  // Sizes that few contacts have, if another unit is usual.
  ["/profile/radius", "10000", "10000 mm. Did you mean 10 mm (10000 µm)?"],
  ["/bodies/0/youngs_modulus", "205 MPa", "205 MPa. Did you mean 205 GPa?"],
  ["/moduli/normal", "112.6 MPa", "112.6 MPa. Did you mean 112.6 GPa?"],
  ["/bodies/0/yield_strength", "1.5", "1.5 MPa. Did you mean 1500 MPa (1.5 GPa)?"],
  ["/wear/hardness", "200", "200 GPa. Did you mean 0.2 GPa (200 MPa)?"],
  ["/motion/rig_stiffness", "30000", "30000 N/µm. Did you mean 30 N/µm (30000 N/mm)?"],
  ["/profile/slope_angle", "0.01", "0.01 deg. Did you mean 0.01 rad?"],
  // Percent.
  ["/friction", "70", "70. Did you mean 0.7 (70 %)?"],
  ["/friction/run_in/to", "7", "7. Did you mean 0.07 (7 %)?"],
  ["/bodies/1/poisson_ratio", "30", "30. Did you mean 0.3 (30 %)?"],
  ["/motion/stick_ratio", "54,5", "54.5. Did you mean 0.545 (54.5 %)?"],
  // Sizes that no contact has in any unit.
  ["/profile/exponent", "200", "200. Is this right? It is unusual."],
  ["/load/normal_force", "1e15", "1e15 N. Is this right? It is unusual."],
]) assert.equal(question(pointer, text), expected, `${pointer} ${text}`);
assert.equal(question("/wear/coefficient", "2e-14"), "2e−14 mm³/(N m). Did you mean 2e−5 mm³/(N m) (2e−14 m³/(N m))?");
for (const [pointer, text] of [["/motion/amplitude", "2"], ["/motion/amplitude", "0"], ["/profile/radius", "0.5 in"],
  ["/motion/amplitude", "2 GPa"], ["/motion/amplitude", "2.256"], ["/motion/amplitude", "3.2 µm"], ["/motion/amplitude", "500 nm"], ["/motion/amplitude", "0,125"],
  ["/profile/radius", "0.125"], ["/profile/radius", "500 um"], ["/profile/radius", "1.5"], ["/profile/radius", "1000"], ["/bodies/0/youngs_modulus", "205"],
  ["/bodies/0/youngs_modulus", "0.5 GPa"], ["/bodies/0/youngs_modulus", "112.600"], ["/bodies/0/yield_strength", "800"], ["/wear/hardness", "700 MPa"],
  ["/load/normal_force", "10000"], ["/load/normal_force", "18.5 N/mm"], ["/wear/coefficient", "3.030e-5"], ["/wear/coefficient", "3,030×10⁻⁵"],
  ["/friction", "0.700"], ["/friction", "1.2"], ["/friction", "1.125"], ["/friction", "0.02"], ["/motion/rig_stiffness", "30"], ["/motion/rig_stiffness", "3000 N/mm"]]) assert.equal(question(pointer, text), undefined, `${pointer} ${text}`);

// Lists of cycles.
for (const [text, list] of [["1 000, 2 000", [1000, 2000]], ["1,000, 2,000", [1000, 2000]], ["1000 2000", [1000, 2000]], ["1000,2000", [1000, 2000]],
  ["0,5; 1,5", [0.5, 1.5]], ["1 000", [1000]], ["1,000", [1000]], ["1e3, 2·10⁴", [1000, 20000]], ["5 mJ, 10 J", ["5 mJ", "10 J"]],
  ["1000, many", [1000, "many"]]]) assert.deepEqual(readList(text), list, text);

const listed = (text) => understandList(text).instead?.question.replaceAll("\u00a0", " ");
for (const [text, expected] of [["1,5", "Read as 1, 5. Did you mean 1.5?"], ["1.000", "Read as 1. Did you mean 1000?"], ["1,000", "Read as 1000. Did you mean 1?"],
  ["10,100", "Read as 10, 100. Did you mean 10100?"], ["0,5 J", "Read as 0, 5 J. Did you mean 0.5 J?"], ["1000,2000", undefined], ["1, 5", undefined],
  ["0,5; 1,5", undefined], ["1000, 3000, 10000", undefined], ["1 000", undefined], ["1,000, 2,000", undefined]]) assert.equal(listed(text), expected, text);
// The program writes decimal points.
assert.equal(understand("1.234 N", kindAt("/load/normal_force", scenario), false).instead, undefined);

// Numbers of a scenario are in SI. A field shows them in its own unit.
assert.equal(fieldText(0.01, "/profile/radius", scenario), "10 mm");
assert.equal(fieldText(3.03e-14, "/wear/coefficient", scenario), "3.03e-5 mm^3/(N m)");
for (const text of ["1.9e-14 1/Pa", "1.9e-8 1/MPa", 1.9e-14]) assert.equal(fieldText(text, "/wear/bodies/0/coefficient", scenario), "1.9e-5 mm^3/(N m)");
assert.equal(understand("1.9e-14 1/Pa", kindAt("/wear/coefficient", scenario)).note.replaceAll("\u00a0", " "), "Read as 1.9e−5 mm³/(N m).");
assert.equal(fieldText("10 mm", "/profile/radius", scenario), "10 mm");
assert.equal(fieldText(0.7, "/friction", scenario), "0.7");
assert.equal(fieldText([1000, 2000], "/cycles", scenario), "1000, 2000");

// If the page shows SI units, a number without a unit has the SI unit.
useSi(true);
assert.equal(value("/motion/amplitude", "2e-6"), "2e-6 m");
assert.equal(question("/motion/amplitude", "2"), "2 m. Did you mean 2 µm?");
assert.equal(fieldText("1.9e-14 1/Pa", "/wear/coefficient", scenario), "1.9e-14 1/Pa");
assert.equal(fieldText(205e9, "/bodies/0/youngs_modulus", scenario), "205000000000 Pa");
// A spreadsheet must not execute a text, whatever separates its cells.
for (const [text, cell] of [["steel, -5 °C", "steel, -5 °C"], ["=1", "'=1"], ["a;=1", "a;'=1"], ["\u00a0=1", "\u00a0'=1"], ["a\t+1", "a\t'+1"]]) {
  assert.equal(csvCell(text), `"${cell}"`);
}
console.log("what is typed is understood");
