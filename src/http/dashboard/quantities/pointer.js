// Values of a scenario by their JSON pointers.

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
