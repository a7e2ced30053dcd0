// The limits of the numbers of a scenario, from its JSON Schema.

/**
 * The size of the SI unit in each unit for which the form checks limits. The form does not check lengths and forces:
 * their limits are far from every useful value.
 */
const PER_SI = { "": 1, rad: 1, mrad: 1e3, deg: 180 / Math.PI, "°": 180 / Math.PI };

let schema = null;

/** Takes the limits from the schema of scenarios. */
export const useLimits = (own) => (schema = own);

/** All schemas of a value: the schema itself, what it refers to, and its alternatives. */
const allOf = (own) => [own, ...(own.$ref ? allOf(schema.$defs[own.$ref.split("/").at(-1)]) : []), ...(own.oneOf ?? []).flatMap(allOf)];

/** All schemas of a member of a value. */
const memberOf = (owns, name) => owns.flatMap((own) => [own.properties?.[name], /^\d+$/.test(name) && own.items]).filter(Boolean).flatMap(allOf);

/** The smallest and the largest number at a pointer, in a unit. */
export function limitsOf(pointer, unit) {
  // Only users may read the schema.
  const factor = schema && PER_SI[unit];
  const numbers = factor ? pointer.split("/").slice(1).reduce(memberOf, allOf(schema)).filter(({ type }) => [type].flat().includes("number")) : [];
  if (numbers.length === 0) return [-Infinity, Infinity];
  return [Math.min(...numbers.map(({ minimum, exclusiveMinimum }) => factor * (minimum ?? exclusiveMinimum ?? -Infinity))),
    Math.max(...numbers.map(({ maximum }) => factor * (maximum ?? Infinity)))];
}
