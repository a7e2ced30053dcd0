// The client of OpenAPI Generator in TypeScript.
import { Configuration, JobsApi, ResultsApi, type RunResult, type Statistics, type StudyTable } from "./fetch_client/index";

declare const process: { argv: string[]; exit(code: number): void };

async function main(): Promise<void> {
  const configuration = new Configuration({ basePath: process.argv[2] });
  const [jobs, results] = [new JobsApi(configuration), new ResultsApi(configuration)];
  const scenario = {
    profile: { shape: "paraboloid" as const, radius: "10 mm" },
    moduli: { normal: "113 GPa", tangential: "93 GPa" },
    friction: 0.7,
    wear: { coefficient: "3e-5 mm^3/(N m)" },
    load: { normalForce: "20 N" },
    motion: { amplitude: "2 um" },
    cycles: [1000],
  };
  const vary = [{ pointer: "/friction", values: [0.5, 0.6, 0.7] }];
  const run = await jobs.submitJob({ jobBody: { scenario }, prefer: "wait=60" });
  const sweep = await jobs.submitJob({ jobBody: { sweep: { scenario, vary, outputs: new Set(["wear_volume"]) } }, prefer: "wait=60" });
  const { history } = await results.getResult({ key: run.key }) as RunResult;
  const { table } = await results.getTable({ key: sweep.key }) as StudyTable;
  const { statistics } = await results.getStatistics({ key: sweep.key }) as Statistics;
  const volumes = table["wear_volume"] as number[];
  const mean = volumes.reduce((sum, volume) => sum + volume, 0) / volumes.length;
  if (volumes.length !== 3 || volumes[2] !== history.wearVolume?.at(-1) || Math.abs(Number(statistics["mean"]?.[0]) / mean - 1) > 1e-9) {
    throw new Error(JSON.stringify([history.wearVolume, volumes, statistics]));
  }
}

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
