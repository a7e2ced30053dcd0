// The address of the page: it holds the state of the view, so that a reload or a bookmark restores it.

/** The address of the view that is drawn. */
let drawn;

/** A view is drawn for the present address. */
export const arrive = () => { drawn = location.href; };

/** Writes the state of the view into the address, unless a link has just changed the address and the next view is not yet drawn. */
export function keepState(hash) {
  if (location.href !== drawn) return;
  history.replaceState(null, "", hash);
  arrive();
}
