// Saves a figure as SVG, PNG and PDF of a chosen size, and its values as CSV.

import { csvOf } from "../page/csv.js";
import { button, fill, h, svg } from "../page/dom.js";
import { drawFigure, planFigure } from "./draw.js";
import { sampleOf } from "./reader.js";

/** Pixels of a drawing in a millimetre, and millimetres in an inch. */
const [INCH, PX] = [25.4, 96 / 25.4];
/** The largest picture in pixels of one side: browsers refuse larger ones. */
const LARGEST = 16000;
let menus = 0;

/** The colours of the light scheme, also if the page is dark. */
function lightColours() {
  const rules = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules]);
  const { style } = rules.find(({ selectorText }) => selectorText === ":root");
  return (name) => style.getPropertyValue(name).trim();
}

/** The text of a drawing that stands alone: on white, in light colours, `size` in mm. `whole` is its size in px. */
export function standalone(drawing, size, whole = size.map((length) => length * PX)) {
  const colour = lightColours();
  drawing.prepend(svg("rect", { width: whole[0], height: whole[1], fill: "#ffffff" }));
  for (const [name, value] of Object.entries({ width: `${size[0]}mm`, height: `${size[1]}mm`, "font-family": "Helvetica, Arial, Liberation Sans, sans-serif" })) {
    drawing.setAttribute(name, value);
  }
  return new XMLSerializer().serializeToString(drawing).replace(/var\((--[\w-]+)\)/g, (_, name) => colour(name));
}

/** The figure as an SVG document of a size in mm. Beside it there is no table, so it has the whole names of its curves. */
function figureText({ curves: drawn, axes, zoom, title }, size) {
  const drawing = svg("svg");
  const curves = drawn.map(({ whole, ...curve }) => ({ ...curve, name: whole ?? curve.name }));
  drawFigure(drawing, curves, axes, planFigure(curves, axes, { width: size[0] * PX, height: size[1] * PX, zoom, isAlone: true }));
  drawing.prepend(svg("title", {}, title), svg("desc", {}, axes.description ?? ""));
  return standalone(drawing, size);
}

/** The values of the curves as CSV, in the units of the axes. Curves with the same x share their first column. */
function tableText(figure) {
  const { curves, plan: { horizontal, vertical } } = figure;
  const head = (axis, name) => `${name} (${axis.unit || "1"})`;
  const columns = [];
  let last = null;
  for (const { name, column = name, x, y } of curves) {
    const isSame = last?.length === x.length && last.every((value, i) => value === x[i]);
    if (!isSame) columns.push([head(horizontal, horizontal.title), x.map((value) => value * horizontal.factor)]);
    columns.push([head(vertical, column || vertical.title), y.map((value) => (Number.isFinite(value) ? value * vertical.factor : null))]);
    last = x;
  }
  return csvOf(columns);
}

/** The checksum of a chunk of a PNG. */
function checksum(bytes) {
  let sum = -1;
  for (const byte of bytes) {
    sum ^= byte;
    for (let bit = 0; bit < 8; bit++) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
  }
  return ~sum;
}

/** Writes the resolution into a PNG, after its header of 33 bytes, so that programs know its size in mm. */
async function withResolution(blob, dpi) {
  const chunk = new DataView(new ArrayBuffer(21));
  const perMetre = Math.round((dpi / INCH) * 1000);
  chunk.setUint32(0, 9);
  [..."pHYs"].forEach((letter, i) => chunk.setUint8(4 + i, letter.charCodeAt(0)));
  chunk.setUint32(8, perMetre);
  chunk.setUint32(12, perMetre);
  chunk.setUint8(16, 1);
  chunk.setInt32(17, checksum(new Uint8Array(chunk.buffer, 4, 13)));
  return new Blob([blob.slice(0, 33), chunk.buffer, blob.slice(33)], { type: "image/png" });
}

/** A picture of an SVG document. */
async function pictureOf(text, [width, height], dpi) {
  const [wide, high] = [width, height].map((length) => Math.round((length / INCH) * dpi));
  if (Math.max(wide, high) > LARGEST) throw new Error(`The picture would have ${wide} × ${high} pixels. Choose fewer dpi or a smaller size.`);
  const image = new Image();
  image.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
  await image.decode();
  const canvas = h("canvas", { width: wide, height: high });
  canvas.getContext("2d").drawImage(image, 0, 0, wide, high);
  return withResolution(await new Promise((done) => canvas.toBlob(done, "image/png")), dpi);
}

/** Prints an SVG document on a page of its size: the dialog of the browser saves it as PDF, with lines and letters as such. */
function printAlone(name, text, [width, height]) {
  const drawing = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
  const [page, { title }, sheet] = [h("div", { class: "figure-page" }, drawing), document, document.styleSheets[0]];
  const rule = sheet.insertRule(`@page { size: ${width}mm ${height}mm; margin: 0; }`, sheet.cssRules.length);
  // The dialog suggests the title as the name of the file.
  document.title = name;
  document.body.append(page);
  addEventListener("afterprint", () => {
    page.remove();
    sheet.deleteRule(rule);
    document.title = title;
  }, { once: true });
  print();
}

/** Offers content as a file. */
export function saveAs(name, content, type) {
  const url = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/** The names of the curves of a figure, to change them and their order, if there are some. `list` draws them again. */
function namesOf(figure, list) {
  const all = figure.named;
  return all.length > 1 && [h("span", { class: "muted" }, "Names and order of the curves"), all.map(([curve, name], i) => h("div", { class: "row" }, sampleOf(curve),
    h("input", { value: name, "aria-label": `Name of ${curve.name}`, onchange: ({ target }) => figure.arrange(curve, { name: target.value.trim() }) }),
    h("button", { type: "button", "aria-label": `Move ${curve.name} up`, disabled: i === 0, onclick: () => {
      figure.arrange(curve, { up: true });
      list(i - 1);
    } }, "↑")))];
}

/** The menu that saves a figure. `drawn(size)` gives its SVG of a size in mm; `table()` its values, and `figure` has curves, if it has some. */
export function saving(name, drawn, table, figure) {
  const id = `save-${++menus}`;
  const number = (key, value, label, least, most) => h("input", { type: "number", id: `${id}-${key}`, value, min: least, max: most, "aria-label": label });
  const [width, height, dpi] = [number("width", 85, "Width in mm", 20, 1000), number("height", 60, "Height in mm", 20, 1000), number("dpi", 300, "Dots per inch", 36, 1200)];
  const size = () => [width, height].map((field) => Math.min(Math.max(Number(field.value) || 85, 20), 1000));
  const saved = (text, make) => button(text, async () => {
    await make();
    menu.open = false;
  }, { "aria-label": `Save ${name()} as ${text}` });
  const names = h("div", { class: "names" });
  const list = (focused) => {
    fill(names, namesOf(figure, list));
    if (focused >= 0) names.querySelectorAll("input")[focused].focus();
  };
  const menu = h("details", { class: "menu save" },
    // Not at `toggle`, which comes later: it would replace a field while somebody types.
    h("summary", { "aria-label": `Save ${name()}`, onclick: () => figure && list() }, "Save"), h("div", { class: "sheet" }, names,
    h("div", { class: "row" }, width, " × ", height, " mm, ", dpi, " dpi"),
    h("div", { class: "row" },
      saved("SVG", async () => saveAs(`${name()}.svg`, await drawn(size()), "image/svg+xml")),
      saved("PNG", async () => saveAs(`${name()}.png`, await pictureOf(await drawn(size()), size(), Math.min(Math.max(Number(dpi.value) || 300, 36), 1200)))),
      saved("PDF (print)", async () => printAlone(name(), await drawn(size()), size())),
      table && saved("CSV", () => saveAs(`${name()}.csv`, table(), "text/csv")))));
  return menu;
}

/** The menu that saves a figure with curves. */
export const saveMenu = (figure) => saving(() => figure.name, (size) => figureText(figure, size), () => tableText(figure), figure);
