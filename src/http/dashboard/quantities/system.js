// Whether the page shows SI units.

let isSi = globalThis.localStorage?.getItem("fretwork-units") === "si";

/** Whether the dashboard shows SI units. */
export const si = () => isSi;

export function useSi(yes) {
  isSi = yes;
  globalThis.localStorage?.setItem("fretwork-units", yes ? "si" : "engineering");
}
