// What the user may do. A control that the server would refuse is not drawn.

import { caller, SIGN_ON } from "./sign-in.js";

const ROLES = ["read", "submit", "admin"];
/** The lowest role for each act. `read` is false for the holder of a shared link. */
const NEEDED = { read: "read", submit: "submit", share: "submit", administrate: "admin", keys: "admin" };
/** A key signs the shared links, and a sign-on user has none. A server without keys makes none over the network. */
const EXCEPT = { share: (me) => me.key === SIGN_ON, keys: (me) => !me.key };

/** Whether the user may do this: `read`, `submit` (also cancel, pin and note), `share`, `administrate` or `keys`. */
export function may(act) {
  const me = caller();
  return Boolean(me) && ROLES.indexOf(me.role) >= ROLES.indexOf(NEEDED[act]) && !EXCEPT[act]?.(me);
}
