// Tests the module of clients/javascript. javascript.py runs `test` in Node.js and in a page of another origin:
//
//     node javascript.mjs fretwork.js '{"base": …}'

function check(condition, ...words) {
  if (!condition) throw new Error(`failed: ${words.map((word) => JSON.stringify(word)).join(" ")}`);
}

/** The error of a call that must fail. */
const failure = (promise) => promise.then(() => check(false, "no error"), (error) => error);

/** What sends requests, but changes the n-th answer to a path that ends so. `sent` has the headers of all of these requests. */
function changed(end, change) {
  const sent = [];
  const send = async (address, options) => {
    if (!address.split("?")[0].endsWith(end)) return fetch(address, options);
    sent.push(options.headers);
    const answer = await fetch(address, options);
    return (await change(answer, sent.length)) ?? answer;
  };
  return { send, sent };
}

/** An answer whose body ends with an error after its first state, or is silent then. */
function cut(answer, isSilent) {
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  const pull = async (controller) => {
    let text = "", end = null;
    while (!end) {
      const { value, done } = await reader.read();
      if (done) return controller.close();
      text += value;
      end = /^event: state\n[^]*?\n\n/m.exec(text);
    }
    controller.enqueue(new TextEncoder().encode(text.slice(0, end.index + end[0].length)));
    reader.cancel();
    if (!isSilent) controller.error(new TypeError("cut"));
    await new Promise(() => {});
  };
  return new Response(new ReadableStream({ pull }, { highWaterMark: 0 }), answer);
}

/**
 * `short` and `long` are jobs, and no server listens at `nowhere`. After `patience` milliseconds, something hangs. `restart` kills
 * the server, and starts it again.
 */
export function test(module, options, restart) {
  const late = new Promise((_, reject) => setTimeout(() => reject(new Error("something hangs")), options.patience));
  return Promise.race([tests(module, options, restart), late]);
}

async function tests(module, { base, key, short, long, nowhere, names }, restart) {
  const own = [...Object.keys(module).sort(), ...Object.getOwnPropertyNames(module.Client.prototype).sort()];
  check(own.join() === names.join(), own, names);
  const { Client, JobFailed, Problem, Unreachable } = module;
  const client = new Client(`${base}/`, { key });
  const states = (events) => events.filter(({ name }) => name === "state").map(({ data }) => data.state);
  const all = async (stream) => {
    const events = [];
    for await (const event of stream) events.push(event);
    return events;
  };
  let friction = 0.7;
  /** Another job. */
  const another = ({ scenario, ...words }) => ({ ...words, scenario: { ...scenario, friction: (friction -= 0.001) } });

  // A run.
  const parts = [];
  const job = await client.wait(await client.submit(short), { progress: (part) => parts.push(part) });
  check(job.state === "succeeded" && parts.at(-1) === 1 && parts.every((part) => part >= 0 && part <= 1), job, parts);
  const { history, units } = await client.result(job.key, "history", { units: "engineering", digits: 5 });
  check(history.wear_depth.at(-1) > 0 && units.wear_depth === "um", history, units);
  check((await client.result(job)).key === job.key);
  check((await client.request(`/v1/results/${job.key}/note`, { method: "PUT", body: { text: "µm" } })) === null);
  check((await client.request(`/v1/results/${job.key}/note`)).text === "µm");
  check((await client.request(`/v1/results/${job.key}/history?format=csv&comments=none`)).startsWith("cycles,"));
  check((await client.cancel(job)).state === "succeeded");
  check((await all(client.follow(job))).at(-1).data.job.id === job.id);

  // Errors.
  const fault = await failure(client.submit({ scenario: { ...short.scenario, frction: 1 } }));
  check(fault instanceof Problem && fault.status === 422 && fault.errors[0].pointer === "/scenario/frction", fault);
  check((await failure(new Client(base, { key: "wrong" }).result(job))).status === 401);
  const lost = await failure(new Client(nowhere, { patience: 0.2 }).result(job));
  check(lost instanceof Unreachable && lost.message.startsWith(nowhere), lost.message);
  const late = await failure(new Client(nowhere).result(job, "", {}, { signal: AbortSignal.timeout(200) }));
  check(late.name === "TimeoutError", late.message);

  // The answer to the first submission is lost, and the server is busy twice.
  const twice = changed("/v1/jobs", (answer, count) => {
    if (count === 1) throw new TypeError("reset");
    if (count < 4) return new Response("{}", { status: count === 2 ? 503 : 429, headers: { "Retry-After": "0" } });
  });
  const once = await new Client(base, { key, fetch: twice.send }).submit({ ...another(short), label: "once" });
  check(twice.sent.length === 4 && new Set(twice.sent.map((headers) => headers["Idempotency-Key"])).size === 1, twice.sent);
  check((await client.request("/v1/jobs?label=once")).jobs.map(({ id }) => id).join() === once.id);
  // What may have been done is not sent again.
  const posts = changed("/v1/keys", () => { throw new TypeError("reset"); });
  check((await failure(new Client(base, { key, fetch: posts.send }).request("/v1/keys", { method: "POST", body: {} }))) instanceof Unreachable);
  check(posts.sent.length === 1);

  // Each stream is cut after its first state, or silent after it. Each state comes once.
  for (const isSilent of [false, true]) {
    const streams = changed("/events", (answer) => cut(answer, isSilent));
    const followed = await client.submit(another(short));
    const found = await all(new Client(base, { key, fetch: streams.send }).follow(followed, { silence: isSilent ? 0.3 : 60 }));
    check(states(found).join() === "queued,running,succeeded", isSilent, found);
    const seen = new Set(streams.sent.map((headers) => headers["Last-Event-ID"] ?? "0"));
    check([...seen].join() === "0,1,2", streams.sent);
  }

  // The server is killed while the job is computed.
  const killed = await client.submit(another(long));
  const events = [];
  let restarting;
  for await (const event of client.follow(killed)) {
    events.push(event);
    if (event.name === "progress" && event.data.progress > 0) restarting ??= restart();
  }
  await restarting;
  check(states(events).join() === "queued,running,queued,running,succeeded", states(events));
  check(events.at(-1).data.job.attempt === 2, events.at(-1));

  // An aborted call ends; the job continues until it is canceled.
  const stop = new AbortController();
  const aborted = await client.submit(another(long));
  const waiting = failure(client.wait(aborted, { signal: stop.signal, progress: () => stop.abort(new Error("enough")) }));
  check((await waiting).message === "enough");
  check(["queued", "running"].includes((await client.request(`/v1/jobs/${aborted.id}`)).state));
  await client.cancel(aborted.id);
  const failed = await failure(client.wait(aborted.id));
  check(failed instanceof JobFailed && failed.job.state === "canceled" && failed.message === "The job was canceled.", failed);
}

if (globalThis.process) {
  const lines = (await import("node:readline")).createInterface({ input: process.stdin })[Symbol.asyncIterator]();
  const restart = () => {
    console.log("restart");
    return lines.next();
  };
  await test(await import(process.argv[2]), JSON.parse(process.argv[3]), restart);
  process.exit();
}
