"""Tests clients/matlab/fretwork.m in Octave: a server with a key that is killed, a study, faults and strange answers.

    python octave.py target/debug/fretwork
"""

import pathlib
import subprocess
import sys
import tempfile

from browser import ROOT, Server, programs

KEY = "fretwork_" + "0123456789abcdef" * 3
TEST = r"""
base = argv(){1}; key = argv(){2};
client = fretwork(base, key);
steel = struct('youngs_modulus', '205 GPa', 'poisson_ratio', 0.3);
scenario.profile = struct('shape', 'paraboloid', 'radius', '10 mm');
scenario.bodies = {steel, steel};
scenario.friction = 0.7;
scenario.wear = struct('coefficient', '3.03e-5 mm^3/(N m)');
scenario.load = struct('normal_force', '100 N');
scenario.motion = struct('amplitude', '2 um');
scenario.cycles = {10000};

% A run, whose server is killed after the submission.
job = client.submit(struct('scenario', scenario, 'label', 'kugel µ "1"'));
assert(any(strcmp(job.state, {'queued', 'running', 'succeeded'})));
puts("restart\n"); fflush(stdout); input('', 's');
job = client.wait(job);
assert(job.label, 'kugel µ "1"');
result = client.result(job);
history = client.table(job, 'history', 'units=engineering');
assert(history.cycles, [0; 10000]);
assert(history.wear_volume, result.history.wear_volume * 1e9, -1e-9);

% A study.
vary = {struct('pointer', '/friction', 'values', [0.6 0.7])};
study = struct('scenario', scenario, 'vary', {vary}, 'outputs', {{'wear_volume'}});
table = client.table(client.wait(client.submit(struct('sweep', study))), 'table');
assert(table.wear_volume(2), result.history.wear_volume(2), -1e-9);

% Other requests: without an answer, with a text, and as a list.
assert(isempty(client.request('PUT', ['/v1/results/' job.key '/note'], struct('text', 'fits'))));
assert(client.request('GET', ['/v1/results/' job.key '/note']).text, 'fits');
assert(strncmp(client.request('GET', ['/v1/results/' job.key '/plot.svg']), '<svg', 4));
assert(client.request('GET', ['/v1/jobs/' job.id '/result']).key, job.key);

% Errors.
function text = failure(call)
  text = '';
  try
    call();
  catch problem
    text = problem.message;
  end
end
wrong = scenario; wrong.frction = 1; wrong.friction = '0.7 mm';
text = failure(@() client.submit(struct('scenario', wrong)));
assert(! isempty(strfind(text, '/scenario/frction: ')) && ! isempty(strfind(text, '/scenario/friction: ')), text);
text = failure(@() fretwork(base, 'wrong').request('GET', '/v1/jobs'));
assert(! isempty(strfind(text, 'key')), text);
text = failure(@() fretwork('http://127.0.0.1:9').request('POST', '/v1/evaluate', struct()));
assert(! isempty(strfind(text, 'http://127.0.0.1:9 does not answer')), text);
wide = scenario; wide.cycles = [1 2];
canceled = client.submit(struct('scenario', wide));
canceled.state = 'failed'; canceled.error = struct('title', 'Lost', 'detail', 'Again');
assert(failure(@() client.wait(canceled)), 'The job is failed: Lost. Again');
"""


def main(program):
    with tempfile.TemporaryDirectory() as made, Server(program, f"{made}/data", FRETWORK_ADMIN_KEY=KEY) as own:
        test = pathlib.Path(made, "test.m")
        test.write_text(TEST)
        temporary = pathlib.Path(made, "tmp")
        temporary.mkdir()
        command = ["octave-cli", "--no-init-file", "--path", ROOT / "clients/matlab", test, own.base, KEY]
        environment = {"PATH": "/usr/local/bin:/usr/bin:/bin", "LANG": "C.UTF-8", "TMPDIR": str(temporary), "HOME": made}
        with subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as octave:
            said = octave.stdout.readline()
            assert said == "restart\n", said
            own.kill()
            own.start()
            rest, _ = octave.communicate("\n", timeout=programs.PATIENCE)
        assert octave.returncode == 0, rest
        assert not list(temporary.iterdir()), "a file with the key stays"
    print("fretwork.m works in Octave")


main(sys.argv[1])
