"""The client of OpenAPI Generator in Python."""

import sys

sys.path.insert(0, "pydantic_client")
import openapi_client
from imported import agree, all_modules
from openapi_client import ApiClient, Configuration, JobBody, JobsApi, ResultsApi

all_modules(openapi_client)
client = ApiClient(Configuration(host=sys.argv[1]))
jobs, results = JobsApi(client), ResultsApi(client)
scenario = {
    "profile": {"shape": "paraboloid", "radius": "10 mm"},
    "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
    "friction": 0.7,
    "wear": {"coefficient": "3e-5 mm^3/(N m)"},
    "load": {"normal_force": "20 N"},
    "motion": {"amplitude": "2 um"},
    "cycles": [1000],
}
varied = {"scenario": scenario, "vary": [{"pointer": "/friction", "values": [0.5, 0.6, 0.7]}], "outputs": ["wear_volume"]}
run, sweep = (jobs.submit_job(JobBody.from_dict(body), prefer="wait=60").key for body in ({"scenario": scenario}, {"sweep": varied}))
history = results.get_result(run).actual_instance.history.wear_volume
table = results.get_table(sweep).actual_instance.table["wear_volume"]
statistics = results.get_statistics(sweep).actual_instance.statistics["mean"]
agree(history, [cell.actual_instance for cell in table], statistics[0].actual_instance)
