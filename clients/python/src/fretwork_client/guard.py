"""Runs a program until the standard input of this process ends, then stops it and deletes a temporary directory.

python guard.py directory program [options]

The standard input ends when the process that started this one ends, for whatever reason. `directory` is empty if there is
nothing to delete. Uses only the standard library, because it runs without the packages of its parent.
"""

import shutil
import subprocess
import sys
import threading


def main(directory: str, command: list[str]) -> int:
    """Returns the exit code of the program."""
    try:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL)

        def stop_at_end_of_input() -> None:
            sys.stdin.buffer.read()
            process.terminate()

        threading.Thread(target=stop_at_end_of_input, daemon=True).start()
        return process.wait()
    finally:
        if directory:
            shutil.rmtree(directory, ignore_errors=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
