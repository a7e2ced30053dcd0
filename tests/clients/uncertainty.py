"""Drives the model of the server with the client of UM-Bridge: evaluates it, checks its gradient against Hertz's formulas,
and samples a posterior with emcee. With `--calibrate`, takes enough samples to recover the truth.

    python uncertainty.py http://127.0.0.1:8080 [--calibrate]
"""

import json
import math
import sys
import urllib.request

import emcee
import numpy
import umbridge

BASE, CALIBRATE = sys.argv[1], "--calibrate" in sys.argv

SCENARIO = {
    "profile": {"shape": "paraboloid", "radius": "10 mm"},
    "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
    "friction": 0.7,
    "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
    "load": {"normal_force": "100 N", "held": "depth"},
    "motion": {"amplitude": "2 um"},
    "cycles": [1000, 3000, 10000, 30000, 100000],
    "model": {"method": "simplified", "xi": 0.8, "points": 64},
}


def evaluate_by_api(scenario, outputs):
    body = json.dumps({"scenario": scenario, "outputs": outputs}).encode()
    request = urllib.request.Request(f"{BASE}/v1/evaluate", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request) as answer:
        values = json.load(answer)["outputs"]
    return [values[name] for name in outputs]


def check_evaluate(model):
    outputs = ["wear_volume", "wear_depth@3000", "limit.wear_volume"]
    config = {"scenario": SCENARIO, "parameters": ["/friction", "/wear/coefficient"], "outputs": outputs}
    assert (model.get_input_sizes(config), model.get_output_sizes(config)) == ([2], [3])
    varied = {**SCENARIO, "friction": 0.6, "wear": {"coefficient": 2e-14}}
    assert model([[0.6, 2e-14]], config) == [evaluate_by_api(varied, outputs)]


def check_gradient(model):
    """Hertz: a = (3FR/4E)^(1/3), p = 3F/(2 pi a^2)."""
    parameters = ["/load/normal_force", "/profile/radius"]
    config = {"scenario": SCENARIO, "parameters": parameters,
              "outputs": ["scales.contact_radius", "unworn.peak_pressure"]}
    force, radius = 80.0, 0.02
    contact = (0.75 * force * radius / 113e9) ** (1 / 3)
    peak = 1.5 * force / (math.pi * contact**2)
    slopes = numpy.array([[contact / force, contact / radius], [peak / force, -2 * peak / radius]]) / 3
    for sens in ([1.0, 0.0], [0.0, 1.0]):
        gradient = model.gradient(0, 0, [[force, radius]], sens, config)
        numpy.testing.assert_allclose(gradient, sens @ slopes, rtol=1e-8)
    product = model.apply_jacobian(0, 0, [[force, radius]], [1.0, 0.5], config)
    numpy.testing.assert_allclose(product, slopes @ [1.0, 0.5], rtol=1e-6)


def calibrate(model, steps):
    """Samples friction and wear coefficient. Returns the samples in units of the truth."""
    cycles = SCENARIO["cycles"]
    config = {"scenario": SCENARIO, "parameters": ["/friction", "/wear/coefficient"],
              "outputs": [f"{name}@{n}" for name in ("wear_volume", "energy_per_cycle") for n in cycles]}
    truth, noise = numpy.array([0.7, 3.03e-14]), 0.02
    random = numpy.random.default_rng(20)
    exact = numpy.array(model([truth.tolist()], config)[0])
    measured = exact * (1 + noise * random.standard_normal(exact.size))

    def log_probability(relative):
        if not numpy.all((relative > 0.5) & (relative < 1.5)):
            return -math.inf
        computed = numpy.array(model([(truth * relative).tolist()], config)[0])
        return -0.5 * numpy.sum(((computed - measured) / (noise * exact)) ** 2)

    walkers = 16
    numpy.random.seed(20)
    sampler = emcee.EnsembleSampler(walkers, truth.size, log_probability)
    sampler.run_mcmc(random.uniform(0.8, 1.2, (walkers, truth.size)), steps)
    return sampler.get_chain(discard=steps // 4, flat=True)


def main():
    model = umbridge.HTTPModel(BASE, "wear")
    check_evaluate(model)
    check_gradient(model)
    samples = calibrate(model, 500 if CALIBRATE else 20)
    mean, deviation = samples.mean(axis=0), samples.std(axis=0)
    print(f"{len(samples)} samples: friction {mean[0]:.4f} ± {deviation[0]:.4f}, wear coefficient {mean[1]:.4f} ± "
          f"{deviation[1]:.4f}, in units of the truth")
    if CALIBRATE:
        # Ten values with an error of 2 % determine two numbers to a few percent.
        assert numpy.all(abs(mean - 1) < 3 * deviation) and numpy.all(deviation < 0.03)


main()
