// Figures that the server draws, shown in the colours of the page.

/** The colours of the server's figures, and the variables of style.css that replace them. */
const COLOURS = {
  "#fff": "--card", "#000": "--ink", "#555": "--soft", "#e4e9ee": "--grid", "#6b7785": "--ink-4", "#0072b2": "--ink-1", "#bf4f00": "--ink-2",
  "#007a5a": "--ink-3", "#a64d83": "--ink-5", "#8a6d00": "--ink-7", "#5b4bb5": "--ink-8",
};
/** Letters and contours on a heat map keep their colour, because the map keeps its own. */
const ON_PAPER = { "#000000": "--ink" };

/** The drawing of an SVG document, as an element of the page. Light and dark need no redrawing. */
export function drawingOf(text) {
  const drawing = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
  const colours = drawing.querySelector("[shape-rendering]") ? COLOURS : { ...COLOURS, ...ON_PAPER };
  for (const element of drawing.querySelectorAll("[fill], [stroke]")) {
    for (const name of ["fill", "stroke"]) {
      const colour = colours[element.getAttribute(name)];
      if (colour) element.setAttribute(name, `var(${colour})`);
    }
  }
  drawing.setAttribute("class", "drawn");
  return drawing;
}
