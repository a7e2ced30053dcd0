// The types of clients/javascript/fretwork.d.ts are right for programs, and agree with the OpenAPI document.
import { Client, JobFailed, Problem, type Job, type JobState, type Warning } from "./fretwork.js";
import type { components } from "./api.js";

type Schemas = components["schemas"];
export const job = (own: Schemas["Job"]): Job => own;
export const state = (own: Schemas["JobState"]): JobState => own;
export const known = (own: JobState): Schemas["JobState"] => own;
export const warning = (own: Schemas["Warning"]): Warning => own;
export const submit = (body: Schemas["JobBody"]): Promise<Job> => new Client().submit(body, { wait: 1 });

export async function depth(client: Client, signal: AbortSignal): Promise<number> {
  try {
    const submitted = await client.submit({ scenario: {} }, { signal });
    for await (const { name, data } of client.follow(submitted, { signal })) if (name === "progress") console.log(data.progress);
    const done: Job = await client.wait(submitted.id, { progress: (part: number) => console.log(part) });
    return (await client.result(done, "history", { digits: 4 })).history.wear_depth.at(-1);
  } catch (error) {
    if (error instanceof Problem) console.error(error.status, error.errors?.[0]?.pointer);
    if (error instanceof JobFailed) console.error(error.job.key);
    throw error;
  }
}

// @ts-expect-error: there is no such state.
export const wrong: JobState = "done";
// @ts-expect-error: a job is no number.
export const refused = new Client().wait(1);
