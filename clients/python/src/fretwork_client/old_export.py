"""Changes an export of fretwork 0.4 or earlier, a database of SQLite, into the lines that `fretwork import` reads.

python3 -m fretwork_client.old_export results.db | fretwork import -
"""

import json
import sqlite3
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

# The SQLite application id of an export.
EXPORT = 0x66726578


def lines(file: str | Path) -> Iterator[str]:
    """The lines of an export: its form, then one for each result. The body of a result stays byte for byte the same.

    Raises `ValueError` if the file is no export.
    """
    path = Path(file).resolve()
    if not path.is_file():
        raise ValueError(f"there is no file {file}")
    database = sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)
    database.row_factory = sqlite3.Row
    try:
        (kind,) = database.execute("PRAGMA application_id").fetchone()
    except sqlite3.DatabaseError as error:
        raise ValueError(f"{file} is no database of SQLite: {error}") from error
    if kind != EXPORT:
        raise ValueError(f"{file} is not an export of fretwork 0.4 or earlier")
    about = dict(database.execute("SELECT name, value FROM about"))
    (results,) = database.execute("SELECT count(*) FROM results").fetchone()
    (numerics,) = database.execute("SELECT ifnull(max(numerics), 0) FROM results").fetchone()
    yield json.dumps(
        {
            "fretwork_export": 2,
            "version": about["program"].removeprefix("fretwork "),
            "numerics": numerics,
            "exported": about["exported"],
            "results": results,
        }
    )
    for row in database.execute("SELECT * FROM results JOIN bodies USING (key) ORDER BY key"):
        yield line(dict(row))


def line(row: dict[str, Any]) -> str:
    """A line with a result, and what the exporting server knew about it."""
    known = {name: row[name] for name in ("key", "sha256", "owner", "computed", "wall_seconds", "cpu_seconds")}
    if row["version"] is not None:
        known["program"] = {
            name: row[name] for name in ("version", "host", "architecture", "processors") if row[name] is not None
        }
    # Exports before 0.4 have no warnings.
    if row.get("warnings") is not None:
        known["warnings"] = json.loads(row["warnings"])
    if row["note"] is not None:
        known["note"] = {"text": row["note"], "owner": row["note_owner"], "at": row["note_at"]}
    return f'{json.dumps(known)[:-1]}, "result": {row["body"]}}}'


def main() -> None:
    """Prints the lines of the file that the command line names."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    try:
        for text in lines(sys.argv[1]):
            sys.stdout.buffer.write(f"{text}\n".encode())
    except (ValueError, OSError) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
