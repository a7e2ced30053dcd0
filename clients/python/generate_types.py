"""Writes src/fretwork_client/api_types.py: a TypedDict for each schema of openapi/openapi.json.

python generate_types.py            # writes the file
python generate_types.py --check    # fails if the file is not current
"""

import json
import keyword
import pathlib
import re
import sys
from typing import Any

HERE = pathlib.Path(__file__).parent
CONTRACT = HERE.parents[1] / "openapi/openapi.json"
TARGET = HERE / "src/fretwork_client/api_types.py"
SCALARS = {"string": "str", "number": "float", "integer": "int", "boolean": "bool", "null": "None"}
HEAD = '''"""Types of the requests and answers of fretwork. generate_types.py makes this file from openapi/openapi.json."""

from typing import Any, Literal, NotRequired, TypeAlias, TypedDict

'''


class Types:
    """The definitions, by name. `alternatives` are objects without a name of their own: they get that of their parent."""

    def __init__(self, schemas: dict[str, Any]) -> None:
        self.schemas = schemas
        self.written: dict[str, str] = {}
        for name, schema in schemas.items():
            self.define(name, schema)

    def define(self, name: str, schema: dict[str, Any]) -> str:
        """Adds a definition, and returns its name."""
        schema = self.whole(schema)
        if "properties" in schema:
            self.written[name] = self.typed_dict(name, schema)
        else:
            self.written[name] = f'{name}: TypeAlias = "{self.expression(name, schema)}"'
        return name

    def whole(self, schema: dict[str, Any]) -> dict[str, Any]:
        """The schema itself; instead of `allOf` with known members, one object with the members of all parts."""
        parts = [self.schemas[part["$ref"].rsplit("/", 1)[1]] if "$ref" in part else part for part in schema.get("allOf", [])]
        if not parts or not all("properties" in part for part in parts):
            return schema
        members = {name: member for part in parts for name, member in part["properties"].items()}
        required = [name for part in parts for name in part.get("required", [])]
        return {"properties": members, "required": required, "description": schema.get("description", "")}

    def typed_dict(self, name: str, schema: dict[str, Any]) -> str:
        """An object with known members. A member such as `from` is a keyword of Python, so the call creates the type."""
        required = set(schema.get("required", []))
        members = {}
        for member, inner in schema["properties"].items():
            kind = self.expression(name + camel(member), inner)
            members[member] = kind if member in required else f"NotRequired[{kind}]"
        if any(keyword.iskeyword(member) or not member.isidentifier() for member in members):
            inside = "".join(f'        "{member}": "{kind}",\n' for member, kind in members.items())
            return f'{name} = TypedDict(\n    "{name}",\n    {{\n{inside}    }},\n)'
        inside = "".join(f'    {member}: "{kind}"\n' for member, kind in members.items())
        text = " ".join(schema.get("description", "").split()).replace("\\", "\\\\")
        return f"class {name}(TypedDict):\n" + (f'    """{text}"""\n\n' if text else "") + inside.rstrip("\n")

    def expression(self, name: str, schema: dict[str, Any]) -> str:
        """The type of a value. Objects inside get a definition with this name."""
        if "$ref" in schema:
            return str(schema["$ref"].rsplit("/", 1)[1])
        for choice in ("oneOf", "anyOf"):
            if choice in schema and "properties" not in schema:
                return self.union(self.alternative(name, at, inner) for at, inner in enumerate(schema[choice], 1))
        if "const" in schema or "enum" in schema:
            values = schema.get("enum", [schema.get("const")])
            return f"Literal[{', '.join(map(repr, values))}]".replace('"', "'")
        kinds = schema.get("type", "object")
        return self.union(self.of_kind(name, kind, schema) for kind in (kinds if isinstance(kinds, list) else [kinds]))

    def alternative(self, name: str, at: int, schema: dict[str, Any]) -> str:
        """One of the alternatives of a schema, named by its title."""
        if "properties" not in schema:
            return self.expression(f"{name}{at}", schema)
        own = camel(schema["title"]) if "title" in schema else f"{name}{at}"
        return self.define(own if own not in self.schemas and own not in self.written else name + own, schema)

    def of_kind(self, name: str, kind: str, schema: dict[str, Any]) -> str:
        if kind == "array":
            return f"list[{self.expression(name + 'Item', schema['items']) if 'items' in schema else 'Any'}]"
        if kind == "object" and "properties" in schema:
            return self.define(name, schema)
        if kind == "object":
            inner = schema.get("additionalProperties")
            known = self.expression(name + "Value", inner) if isinstance(inner, dict) and inner else "Any"
            return f"dict[str, {known}]"
        return SCALARS[kind]

    @staticmethod
    def union(kinds: Any) -> str:
        """Each alternative once, in order."""
        return " | ".join(dict.fromkeys(kinds))


def camel(text: str) -> str:
    """`power law` becomes `PowerLaw`."""
    return "".join(word[:1].upper() + word[1:] for word in re.split(r"[^0-9A-Za-z]+", text))


def generated() -> str:
    """The text of the file."""
    contract = json.loads(CONTRACT.read_text(encoding="utf-8"))
    written = Types(contract["components"]["schemas"]).written
    return HEAD + "\n\n".join(written[name] for name in sorted(written)) + "\n"


if __name__ == "__main__":
    if "--check" not in sys.argv:
        TARGET.write_text(generated(), encoding="utf-8")
    elif TARGET.read_text(encoding="utf-8") != generated():
        sys.exit("api_types.py is not current. Run: python clients/python/generate_types.py")
