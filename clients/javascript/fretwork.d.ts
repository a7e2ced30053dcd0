// The types of fretwork.js.

/**
 * Yields the server-sent events of a job until it has ended. `open` sends the request with more headers; after a broken stream
 * it is called again, and the server continues after the last event that was received.
 */
export function events(open: (headers: Record<string, string>) => Promise<Response>, { signal, silence }?: Options & {
  silence?: number;
}): AsyncGenerator<JobEvent, void, void>;
/** A random Idempotency-Key for one submission. */
export function idempotencyKey(): string;
/** An error answer of the server (RFC 9457). `errors` are all faults of the request. */
export class Problem extends Error {
  constructor(status: number, members: Record<string, any>);
  status: number;
  title: string | undefined;
  detail: string | undefined;
  /** A path of the server with a page about this error. */
  type: string | undefined;
  errors: Fault[] | undefined;
}
/** The server does not answer, or not to a page of this origin. */
export class Unreachable extends Error {
}
/** A job failed or was canceled. */
export class JobFailed extends Error {
  constructor(job: Job);
  job: Job;
}
/** A server of fretwork. */
export class Client {
  /**
   * `base` is the address that the server prints, and `key` an access key. After a lost connection, and if the server is busy,
   * a request is sent again for `patience` seconds, or for 3 if the server has never answered.
   */
  constructor(base?: string, { key, patience, fetch }?: {
    key?: string;
    patience?: number;
    fetch?: typeof globalThis.fetch;
  });
  /**
   * Sends a request of the API, and returns the JSON of the answer, or its text; null if it is empty. After a failure that may
   * pass, a POST or PATCH is sent again only with `repeats` or an `Idempotency-Key`.
   */
  request(path: string, options?: Request & Options): Promise<any>;
  /** Submits a job once, however often the request is sent, and returns it at once, or at its end if this comes within `wait` seconds. */
  submit(body: JobBody, { wait, signal }?: Options & {
    wait?: number;
  }): Promise<Job>;
  /** Yields the events of a job, or of the job with this id, until it has ended. Resumes after a lost connection: each state comes once. */
  follow(job: Job | string, { signal, silence }?: Options & {
    silence?: number;
  }): AsyncGenerator<JobEvent, void, void>;
  /** Waits for the end of a job. Returns it if it has a result, and throws `JobFailed` if not. */
  wait(job: Job | string, { signal, progress }?: Options & {
    progress?: (part: number) => void;
  }): Promise<Job>;
  /** Reads the result of a job or of a key, or a part of it, such as `history`. `words` are parameters of the API, such as `{ units: "engineering" }`. */
  result(job: Job | string, part?: string, words?: Record<string, string | number>, options?: Options): Promise<any>;
  /** Cancels a job. */
  cancel(job: Job | string): Promise<Job>;
}
export type JobState = "queued" | "running" | "canceling" | "succeeded" | "failed" | "canceled";
export type Warning = {
  kind: string;
  detail: string;
};
/** A fault of a request: a JSON pointer, or a parameter, and what to change. */
export type Fault = {
  pointer?: string;
  parameter?: string;
  detail: string;
};
/** One submission. The key is that of its result. */
export type Job = {
  id: string;
  state: JobState;
  key: string;
  origin: string;
  progress: number;
  attempt: number;
  owner: string;
  label?: string | null;
  tags: string[];
  warnings: Warning[];
  error?: {
    title: string;
    detail: string;
  } | null;
};
/** A job as in the API: `{"scenario": …}` or `{"sweep": …}`, with `label` and `tags` if wanted. */
export type JobBody = Record<string, any>;
/** `name` is snapshot (the data are the job), state or progress. The last state has the `job`. */
export type JobEvent = {
  id?: string;
  name: string;
  data: any;
};
/** An aborted signal ends the call. The job continues. */
export type Options = {
  signal?: AbortSignal;
};
/** `repeats`: whether it may be sent twice. */
export type Request = {
  method?: string;
  body?: unknown;
  headers?: Record<string, string>;
  repeats?: boolean;
};
