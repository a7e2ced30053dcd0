// Names, symbols and units of the numbers that fits estimate.

import { italics } from "../quantities/explain.js";
import { inputWords } from "../quantities/units.js";

/** Numbers that tests often leave unknown. */
export const KNOWN = ["/wear/coefficient", "/wear/energy_coefficient", "/friction", "/motion/amplitude", "/load/normal_force", "/profile/radius"];

/** The name of a number of a scenario. */
export const wordsOf = (pointer) => inputWords(pointer).title;
export const symbolAt = (pointer) => inputWords(pointer).symbol;
export const named = (pointer) => [wordsOf(pointer), " ", ...italics(symbolAt(pointer))];

/** The unit in which a number is shown: that of an energy wear coefficient is a volume per energy. */
export const unitAt = (pointer, unit) => (pointer === "/wear/energy_coefficient" ? "m^3/J" : unit);
