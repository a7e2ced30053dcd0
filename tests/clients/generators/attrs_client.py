"""The client of openapi-python-client."""

import sys

sys.path.insert(0, "attrs_client")
import fretwork_client
from fretwork_client import Client
from fretwork_client.api.jobs import submit_job
from fretwork_client.api.results import get_result, get_statistics, get_table
from fretwork_client.models import (
    JobBody,
    ByForce,
    Moduli,
    ByAmplitude,
    Paraboloid,
    ParaboloidShape,
    Scenario,
    SpecificWearRate,
    Sweep,
    Varied,
)
from imported import agree, all_modules

all_modules(fretwork_client)
client = Client(sys.argv[1])
scenario = Scenario(
    profile=Paraboloid(shape=ParaboloidShape.PARABOLOID, radius="10 mm"),
    moduli=Moduli(normal="113 GPa", tangential="93 GPa"),
    friction=0.7,
    wear=SpecificWearRate(coefficient="3e-5 mm^3/(N m)"),
    load=ByForce(normal_force="20 N"),
    motion=ByAmplitude(amplitude="2 um"),
    cycles=[1000.0],
)
run = submit_job.sync(client=client, body=JobBody(scenario=scenario), prefer="wait=60")
varied = Sweep(scenario=scenario, vary=[Varied(pointer="/friction", values=[0.5, 0.6, 0.7])], outputs=["wear_volume"])
sweep = submit_job.sync(client=client, body=JobBody(sweep=varied), prefer="wait=60")
result = get_result.sync(client=client, key=run.key)
table = get_table.sync(client=client, key=sweep.key)
statistics = get_statistics.sync(client=client, key=sweep.key)
agree(result.history.wear_volume, table.table["wear_volume"], statistics.statistics["mean"][0])
