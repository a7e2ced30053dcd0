"""Splits Rust source into code, comments and literals, for the scripts tests/lines and tests/reading."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

TOKEN = re.compile(
    r"""
      (?P<line>//[^\n]*)
    | (?P<block>/\*)
    | (?P<raw>\b(?:br|cr|r)(?P<hashes>\#*)".*?"(?P=hashes))
    | (?P<string>\b[bc]?"(?:\\.|[^"\\])*"|"(?:\\.|[^"\\])*")
    | (?P<char>\bb?'(?:\\u\{[^}]*\}|\\.[^']*|[^'\\\n])'|'(?:\\u\{[^}]*\}|\\.[^']*|[^'\\\n])')
    """,
    re.VERBOSE | re.DOTALL,
)


# The directories of the sources of all crates.
SOURCES = [*sorted(ROOT.glob("crates/*/src")), ROOT / "src"]


def files():
    """The Rust files of all crates without their tests and benches."""
    return sorted(path for directory in SOURCES for path in directory.rglob("*.rs"))


def tokens(source):
    """Yields (kind, start, end) of each comment ("comment") and literal ("string", "char")."""
    at = 0
    while match := TOKEN.search(source, at):
        start, at = match.span()
        if match["block"]:
            depth = 1
            while depth and (edge := re.compile(r"/\*|\*/").search(source, at)):
                depth += 1 if edge[0] == "/*" else -1
                at = edge.end()
        kind = "comment" if match["line"] or match["block"] else "char" if match["char"] else "string"
        yield kind, start, at


def blank(text, filler):
    """The text with `filler` in place of every character except line breaks."""
    return re.sub(r"[^\n]", filler, text)


def without_comments(source):
    """The source, of the same length, with spaces for comments and `x` for the inside of literals."""
    out, last = [], 0
    for kind, start, end in tokens(source):
        out += [source[last:start], blank(source[start:end], " " if kind == "comment" else "x")]
        last = end
    return "".join([*out, source[last:]])


def test_items(source):
    """The spans (start, end) of the items under `#[cfg(test)]`; the whole file if it begins with `#![cfg(test)]`."""
    code = without_comments(source)
    if code.lstrip().startswith("#![cfg(test)]"):
        return [(0, len(code))]
    spans = []
    for match in re.finditer(r"#\[cfg\(test\)\]", code):
        if spans and match.start() < spans[-1][1]:
            continue
        depth, at = 0, match.end()
        while at < len(code):
            depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(code[at], 0)
            at += 1
            if depth == 0 and code[at - 1] in ";}":
                break
        at += code[at:at + 1] == ";"
        spans.append((match.start(), at))
    return spans


def code_lines(source):
    """The number of lines with code: no blank lines, no comments, nothing under `#[cfg(test)]`."""
    code = without_comments(source)
    for start, end in test_items(source):
        code = code[:start] + blank(code[start:end], " ") + code[end:]
    return sum(1 for line in code.splitlines() if line.strip())
