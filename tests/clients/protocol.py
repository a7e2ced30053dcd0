"""Tests the model `wear` against the text of the protocol UM-Bridge 1.0: the members of each answer, the error of each mistake, and that
the products with the Jacobian agree with each other and with differences of evaluations.

    python protocol.py http://127.0.0.1:8080
"""

import json
import sys
import urllib.error
import urllib.request

BASE = sys.argv[1]
MODEL = "wear"
CONFIG = {"parameters": ["/friction", "/motion/amplitude"], "outputs": ["wear_volume", "dissipated_energy", "wear_depth"]}
POINT = [0.6, 2e-6]


def ask(path, body=None):
    """The status and the JSON of an answer."""
    request = urllib.request.Request(BASE + path, None if body is None else json.dumps(body).encode())
    try:
        with urllib.request.urlopen(request, timeout=180) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read())


def found(path, body, *members):
    """The answer of a call without a mistake. It has only these members."""
    status, document = ask(path, body)
    assert status == 200 and sorted(document) == sorted(members), (path, body, status, document)
    return document if len(members) > 1 else document[members[0]]


def refused(path, body, kind, status=400):
    """The answer of a call with a mistake."""
    code, document = ask(path, body)
    assert code == status and list(document) == ["error"], (path, body, code, document)
    assert sorted(document["error"]) == ["message", "type"] and document["error"]["type"] == kind, (path, body, document)
    assert len(document["error"]["message"]) > 10, document


def call(**members):
    return {"name": MODEL, "config": CONFIG, "input": [POINT]} | members


def models():
    info = found("/Info", None, "protocolVersion", "models")
    assert info["protocolVersion"] == 1.0 and MODEL in info["models"], info
    for name in info["models"]:
        support = found("/ModelInfo", {"name": name}, "support")
        assert support == {"Evaluate": True, "Gradient": True, "ApplyJacobian": True, "ApplyHessian": False}, support
    # Without a config, the model has one number and one output.
    for config, sizes in (({}, (1, 1)), (CONFIG, (2, 3))):
        for path, member, size in zip(("/InputSizes", "/OutputSizes"), ("inputSizes", "outputSizes"), sizes):
            assert found(path, {"name": MODEL, "config": config}, member) == [size], (path, config)
    assert len(found("/Evaluate", {"name": MODEL, "input": [[0.5]]}, "output")[0]) == 1


def numbers(values, count):
    assert len(values) == count and all(isinstance(value, float) for value in values), values
    return values


def derivatives():
    evaluate = lambda point: numbers(found("/Evaluate", call(input=[point]), "output")[0], 3)
    jacobian = lambda vec: numbers(found("/ApplyJacobian", call(outWrt=0, inWrt=0, vec=vec), "output"), 3)
    gradient = lambda sens: numbers(found("/Gradient", call(outWrt=0, inWrt=0, sens=sens), "output"), 2)
    columns = [jacobian([1, 0]), jacobian([0, 1])]
    rows = [gradient([float(place == own) for place in range(3)]) for own in range(3)]
    for output in range(3):
        for member in range(2):
            derivative = columns[member][output]
            assert abs(rows[output][member] / derivative - 1) < 1e-9, (rows, columns)
            ends = [list(POINT), list(POINT)]
            step = 0.01 * POINT[member]
            ends[0][member] -= step
            ends[1][member] += step
            low, high = (evaluate(end)[output] for end in ends)
            # The curvature contributes the square of the step, and the exact method its tolerance.
            assert abs((high - low) / (2 * step) / derivative - 1) < 0.03, (output, member, derivative)
    combined = jacobian([0.3, 2e-6])
    for output in range(3):
        expected = 0.3 * columns[0][output] + 2e-6 * columns[1][output]
        assert abs(combined[output] - expected) < 1e-9 * (abs(0.3 * columns[0][output]) + abs(2e-6 * columns[1][output])), (combined, expected)


def mistakes():
    derivative = {"/Gradient": {"sens": [1, 0, 0]}, "/ApplyJacobian": {"vec": [1, 0]}}
    for path in ("/ModelInfo", "/InputSizes", "/OutputSizes", "/Evaluate", "/Gradient", "/ApplyJacobian", "/ApplyHessian"):
        own = call(outWrt=0, inWrt=0, **derivative.get(path, {}))
        refused(path, own | {"name": "other"}, "ModelNotFound")
        refused(path, {member: value for member, value in own.items() if member != "name"}, "InvalidInput")
    refused("/ApplyHessian", call(outWrt=0, inWrt1=0, inWrt2=0, vec=[1, 0], sens=[1, 0, 0]), "UnsupportedFeature")
    for path, more in {"/Evaluate": {}, **{path: {"outWrt": 0, "inWrt": 0, **own} for path, own in derivative.items()}}.items():
        for wrong in ([], [[]], [POINT, POINT], [POINT[:1]], [POINT + [1]], [["a", 1]], 0.5):
            refused(path, call(**more) | {"input": wrong}, "InvalidInput")
    for path, more in derivative.items():
        (member, values), = more.items()
        for wrong in ({"outWrt": 1}, {"outWrt": -1}, {"inWrt": 1}, {member: values[1:]}, {member: values + [0]}, {"outWrt": None}, {member: None}):
            refused(path, call(outWrt=0, inWrt=0, **more) | wrong, "InvalidInput")
    refused("/Evaluate", call(input=[[-1, 2e-6]]), "InvalidInput")
    refused("/Evaluate", call(config={"outputs": ["nothing"]}), "InvalidInput")


def main():
    models()
    derivatives()
    mistakes()
    print("the model speaks UM-Bridge 1.0")


main()
