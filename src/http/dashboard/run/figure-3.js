// What the examples of Figure 3 of the paper are, on the form and on their saved results.

/** For each example: the beginning of its label, what it is, and the other example with the button that opens it. */
export const FIGURE_3 = {
  "paper-figure-3": ["Figure 3 (a, b) of the paper:", "The paper prints c\u00a0=\u00a00.455\u00a0a₀ for these panels. By its equation (10), that contradicts the stick radii of panels (c) and (d), 0.652 and 0.41\u00a0a₀, and c\u00a0=\u00a00.545\u00a0a₀ agrees with both approximately: two digits were probably swapped. The printed cycles are four times these: it looks as if the paper counts a slip path of U in each cycle, where its equation (18) has 4U.", "paper-figure-3-printed", "Open the printed values"],
  "paper-figure-3-printed": ["Figure 3 (a, b) of the paper as printed:", "These are the printed values. By equation (10), c\u00a0=\u00a00.455\u00a0a₀ would give 0.605 and 0.220\u00a0a₀ in panels (c) and (d), where the paper prints 0.652 and 0.41\u00a0a₀.", "paper-figure-3", "Open c\u00a0=\u00a00.545\u00a0a₀"],
};

/** What a saved example is; undefined for other results. */
export const aboutExample = (label) => Object.values(FIGURE_3).find(([start]) => label?.startsWith(start))?.[1];
