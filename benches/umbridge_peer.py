"""The simplified rule behind UM-Bridge's own Python server, for `cargo bench --bench service`: the wear depth of the steel ball, from
friction and the number of cycles. Prints its address when it listens.

    python umbridge_peer.py
"""

import math
import socket
import sys
import threading
import time

import numpy
import umbridge

# The steel ball: moduli, wear coefficient, xi, amplitude, and the unworn contact under 100 N (Hertz).
NORMAL, TANGENTIAL, WEAR, XI, AMPLITUDE = 205e9 / 1.82, 205e9 / 2.21, 3.03e-14, 0.8, 2.256e-6
CONTACT = (0.75 * 100 * 0.01 / NORMAL) ** (1 / 3)
DEPTH = CONTACT**2 / 0.01
CHARACTERISTIC = CONTACT / (4 * AMPLITUDE * WEAR * NORMAL)

# Lengths in units of the contact radius, heights in units of the depth. f = WEIGHTS @ g is the inverse transform (4),
# with g constant on each cell.
EDGES = numpy.linspace(0, 1.5, 257)
X, R = 0.5 * (EDGES[1:] + EDGES[:-1]), EDGES[1:]
ANGLES = numpy.arcsin(numpy.minimum(EDGES[None, :] / R[:, None], 1))
WEIGHTS = 2 / math.pi * numpy.diff(ANGLES, axis=1)


def limiting_radius(stick):
    """The radius at which the limiting profile meets the unworn profile, by (13)."""
    def excess(r):
        psi = math.asin(stick / r)
        core = 0.5 * (r * r * psi - stick * math.sqrt(r * r - stick * stick))
        return 2 / math.pi * (core + math.pi / 2 - psi) - 0.5 * r * r

    low, high = 1.0, 1.5
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return low


def wear_depth(friction, cycles):
    threshold = TANGENTIAL * AMPLITUDE / (friction * NORMAL * DEPTH)
    stick = math.sqrt(1 - threshold)
    limit = limiting_radius(stick)
    left = math.exp(-XI * cycles / CHARACTERISTIC / limit)
    unworn = 1 - X * X
    inside = threshold * unworn * left / (unworn * left + threshold - unworn)
    worn = numpy.where(X < 1, inside, unworn * left)
    image = numpy.where((X > stick) & (X < limit), 1 - worn, X * X)
    return DEPTH * float(numpy.max(WEIGHTS @ (image - X * X)))


class Wear(umbridge.Model):
    def __init__(self):
        super().__init__("wear")

    def get_input_sizes(self, config):
        return [2]

    def get_output_sizes(self, config):
        return [1]

    def __call__(self, parameters, config):
        return [[wear_depth(*parameters[0])]]

    def supports_evaluate(self):
        return True


def announce(port):
    while True:
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            break
        except ConnectionRefusedError:
            time.sleep(0.05)
    print(f"http://127.0.0.1:{port}", file=out, flush=True)


# The address is the first line of the output, without the banner of the server.
out, sys.stdout = sys.stdout, sys.stderr
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
threading.Thread(target=announce, args=[port], daemon=True).start()
umbridge.serve_models([Wear()], port)
