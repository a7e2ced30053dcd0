// The types of openapi-typescript, with fetch.
import type { components } from "./api";

declare const process: { argv: string[]; exit(code: number): void };

type Schemas = components["schemas"];

const scenario: Schemas["Scenario"] = {
  profile: { shape: "paraboloid", radius: "10 mm" },
  moduli: { normal: "113 GPa", tangential: "93 GPa" },
  friction: 0.7,
  wear: { coefficient: "3e-5 mm^3/(N m)" },
  load: { normal_force: "20 N" },
  motion: { amplitude: "2 um" },
  cycles: [1000],
};
const sweep: Schemas["Sweep"] = { scenario, vary: [{ pointer: "/friction", values: [0.5, 0.6, 0.7] }], outputs: ["wear_volume"] };

const submitted = async (body: Schemas["JobBody"]): Promise<Schemas["Job"]> => (await fetch(`${process.argv[2]}/v1/jobs`, {
  method: "POST", headers: { "content-type": "application/json", prefer: "wait=60" }, body: JSON.stringify(body),
})).json();
const read = async <Name extends keyof Schemas>(path: string): Promise<Schemas[Name]> => (await fetch(`${process.argv[2]}${path}`)).json();

async function main(): Promise<void> {
  const [run, study] = [await submitted({ scenario }), await submitted({ sweep })];
  const { history } = await read<"RunResult">(`/v1/results/${run.key}`);
  const { table } = await read<"StudyTable">(`/v1/results/${study.key}/table`);
  const { statistics } = await read<"Statistics">(`/v1/results/${study.key}/statistics`);
  if (table["wear_volume"]?.[2] !== history.wear_volume?.at(-1) || !(Number(statistics["mean"]?.[0]) > 0)) {
    throw new Error(JSON.stringify([history, table, statistics]));
  }
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
