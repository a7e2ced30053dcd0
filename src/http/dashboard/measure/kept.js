// Where the tab keeps the measured sets: they survive a reload. Sets that are dropped on the form have `FORM` in place of the key of a run.

export const [KEPT, FORM] = ["fretwork-measured", "form"];
