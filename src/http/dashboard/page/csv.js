// Tables as CSV.

/** A spreadsheet would execute what begins like a formula, also behind other separators of lists. The server guards its texts alike. */
const FORMULA = /(^|[;|\t\r\n])([\s\p{C}"']*)(?=[=+\-@\t\r\n＝＋－＠])/gu;
const textCell = (text) => `"${text.replace(FORMULA, "$1$2'").replaceAll('"', '""')}"`;

/** A value of a CSV file: a number with 12 digits, or a text in quotes. */
export const csvCell = (value) => (typeof value === "number" ? String(Number(value.toPrecision(12))) : value == null ? "" : textCell(String(value)));

/** Columns with their names as CSV. */
export function csvOf(columns) {
  const count = Math.max(...columns.map(([, values]) => values.length));
  const rows = Array.from({ length: count }, (_, i) => columns.map(([, values]) => csvCell(values[i])));
  return [columns.map(([name]) => csvCell(name.replaceAll("\u00a0", " "))), ...rows].map((row) => row.join(",")).join("\n") + "\n";
}
